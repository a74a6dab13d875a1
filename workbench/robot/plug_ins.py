"""What can be added from outside (effects, formats of recordings, servo families): found and checked in one way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules
from types import ModuleType
from typing import TypeVar

from workbench.robot.errors import InputError

T = TypeVar("T")
S = TypeVar("S")


def of_folder(folder: ModuleType, attribute: str, kind: type[T]) -> Iterator[T]:
    """What the modules of a package offer under one name, a file each."""
    for module in iter_modules(folder.__path__):
        offered = getattr(import_module(f"{folder.__name__}.{module.name}"), attribute, None)
        if isinstance(offered, kind):
            yield offered


def with_plug_ins(own: Mapping[str, T], group: str, kind: type[S], called: str, make: Callable[[S], tuple[str, T]]
                    ) -> dict[str, T]:
    """What ships with the workbench, by name, and what the entry points of a group add.

    kind: what an entry point has to name; make: its name and what it stands for; called: the word for one in messages. InputError
    names the entry point that is none, or that takes a name which is known already.
    """
    found = dict(own)
    for entry in entry_points(group=group):
        offered = entry.load()
        if not isinstance(offered, kind):
            raise InputError(entry.value, f"entry point '{entry.name}' of group {group}: expected {kind.__name__}, got "
                                          f"{type(offered).__name__}")
        name, made = make(offered)
        if name in found:
            raise InputError(entry.value, f"{called} '{name}' is known already")
        found[name] = made
    return found
