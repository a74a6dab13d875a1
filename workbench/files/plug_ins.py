"""Plug-ins from other packages (effects, formats of recordings, servo families): all found and checked in the same way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from types import ModuleType
from typing import TypeVar

from workbench.files.errors import InputError

T = TypeVar("T")
S = TypeVar("S")


def of_folder(folder: ModuleType, attribute: str, kind: type[T]) -> Iterator[T]:
    """The objects of one name that the modules of a package define, one per file."""
    for module in iter_modules(folder.__path__):
        offered = getattr(import_module(f"{folder.__name__}.{module.name}"), attribute, None)
        if isinstance(offered, kind):
            yield offered


def with_plug_ins(own: Mapping[str, T], group: str, kind: type[S], called: str, make: Callable[[S, str], tuple[str, T]]
                    ) -> dict[str, T]:
    """The workbench's own objects, by name, and those that the entry points of a group add.

    kind: type that an entry point has to name; make: returns the name and the object, given its origin for messages; called:
    the word for one in messages. InputError names package and entry point of anything that cannot be loaded, has another type,
    or takes a name that is already known.
    """
    found = dict(own)
    for entry in entry_points(group=group):
        at = _place(entry)
        try:
            offered = entry.load()
        except Exception as e:  # a plug-in may raise anything
            raise InputError(None, f"{at}: {entry.value} cannot be loaded ({type(e).__name__}: {e})") from e
        if not isinstance(offered, kind):
            raise InputError(None, f"{at}: expected {kind.__name__}, got {type(offered).__name__} ({entry.value})")
        try:
            name, made = make(offered, at)
        except InputError as e:
            raise InputError(None, f"{at}: {e}") from None
        if name in found:
            raise InputError(None, f"{at}: {called} '{name}' is known already")
        found[name] = made
    return found


def list_installed(group: str) -> dict[str, str]:
    """The package of each entry point of a group, by the entry point's name; they are not loaded."""
    return {entry.name: _package(entry) for entry in entry_points(group=group)}


def _package(entry: EntryPoint) -> str:
    return "of no name" if entry.dist is None else entry.dist.name


def _place(entry: EntryPoint) -> str:
    return f"package {_package(entry)}, entry point {entry.name} of {entry.group}"
