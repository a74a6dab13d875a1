"""YAML that a person wrote, read strictly: what is unknown, missing or of the wrong type is named with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from workbench.robot.errors import InputError
from workbench.robot.files import read_text


class _CoreLoader(yaml.SafeLoader):
    """YAML 1.2's core schema. PyYAML's 1.1 reads 1e5 and 1.0e5 as text, 1:30 as 90 and a joint named `on` as true."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key, _ in node.value:
            if key.value in seen:
                raise yaml.MarkedYAMLError(problem=f"key '{key.value}' stands twice", problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


_CoreLoader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
     list("-+.0123456789")),
):
    _CoreLoader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"(?:{_pattern})$"), _first)
_CoreLoader.add_constructor("tag:yaml.org,2002:int", lambda loader, node: int(node.value))


class _Dumper(yaml.SafeDumper):
    """Quotes what YAML 1.1 or 1.2 would take for something else than text; no anchors, as a person would write."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


_Dumper.yaml_implicit_resolvers = {
    first: [*yaml.SafeDumper.yaml_implicit_resolvers.get(first, []), *_CoreLoader.yaml_implicit_resolvers.get(first, [])]
    for first in {*yaml.SafeDumper.yaml_implicit_resolvers, *_CoreLoader.yaml_implicit_resolvers}}


def yaml_text(content: Mapping[str, Any]) -> str:
    """Plain types as YAML, in their order, that `read_yaml` gives back; lists of numbers on one line."""
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def read_yaml(path: str | Path) -> Any:
    """Content of a YAML file (1.2 core schema, no key twice); InputError if it cannot be read."""
    text = read_text(path)
    try:
        return yaml.load(text, Loader=_CoreLoader)
    except (yaml.YAMLError, TypeError, RecursionError) as e:  # TypeError: a list as key
        raise InputError(path, f"not valid YAML: {e}") from None


class Fields:
    """A mapping inside a YAML file whose keys are taken one by one; `done` refuses what nobody took.

    Every error names the file, the place in it (`takes[2].base`) and what was expected.
    """

    def __init__(self, path: Path, content: Any, place: str = "") -> None:
        self.path, self.place = path, place
        if not isinstance(content, Mapping):
            raise InputError(path, f"{place or 'top level'}: expected keys with values, got {_show(content)}")
        self._left = dict(content)
        self._known: list[str] = []

    def error(self, key: str, expected: str) -> InputError:
        """The error to raise about `key`."""
        return InputError(self.path, f"{self.at(key)}: {expected}")

    def at(self, key: str) -> str:
        """Place of a key in the file."""
        return f"{self.place}.{key}" if self.place else key

    def raw(self, key: str) -> Any:
        """The value as YAML gave it; None where the key is absent or empty."""
        self._known.append(key)
        return self._left.pop(key, None)

    def text(self, key: str, default: str | None = None, choices: tuple[str, ...] = ()) -> str | None:
        """A string; a plain number is taken as one (a take called 1)."""
        value = self.raw(key)
        if value is None:
            return default
        if isinstance(value, int) and not isinstance(value, bool):
            value = str(value)
        if not isinstance(value, str) or not value or (choices and value not in choices):
            raise self.error(key, f"expected {' or '.join(choices) or 'text'}, got {_show(value)}")
        return value

    def number(self, key: str, least: float = -math.inf, finite: bool = True) -> float | None:
        """A number, at least `least`."""
        value = self.raw(key)
        if value is None:
            return None
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and value >= least
        if not good or (finite and math.isinf(value)):
            bound = "" if math.isinf(least) else f" of at least {least:g}"
            raise self.error(key, f"expected a number{bound}, got {_show(value)}")
        return float(value)

    def whole(self, key: str, default: int | None = None, least: int = 0) -> int | None:
        """A whole number, at least `least`."""
        value = self.raw(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.error(key, f"expected a whole number of at least {least}, got {_show(value)}")
        return value

    def file(self, key: str) -> Path | None:
        """A file that exists, relative to the YAML file's folder."""
        name = self.text(key)
        return None if name is None else self.existing(key, name)

    def existing(self, key: str, name: Any) -> Path:
        """The file called `name`, relative to the YAML file's folder; InputError at `key` if there is none."""
        if not isinstance(name, str):
            raise self.error(key, f"expected the name of a file, got {_show(name)}")
        path = self.path.parent / name
        if not path.is_file():
            raise self.error(key, f"file not found: {path}")
        return path

    def mapping(self, key: str) -> Fields | None:
        """A mapping, to be taken apart in its turn."""
        value = self.raw(key)
        return None if value is None else Fields(self.path, value, self.at(key))

    def items(self) -> Iterator[tuple[str, Any]]:
        """All keys that are left, with their values, for mappings whose keys are names."""
        while self._left:
            key = next(iter(self._left))
            if not isinstance(key, str):
                raise self.error(str(key), "expected a name as key")
            yield key, self.raw(key)

    def sequence(self, key: str) -> list[Fields]:
        """A list of mappings; empty where the key is absent."""
        value = self.raw(key)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self.error(key, f"expected a list, got {_show(value)}")
        return [Fields(self.path, v, f"{self.at(key)}[{i}]") for i, v in enumerate(value)]

    def required(self, key: str, value: Any) -> Any:
        """`value`, as taken from `key`, unless it was absent."""
        if value is None:
            raise self.error(key, "is missing")
        return value

    def done(self) -> None:
        """InputError if a key was never taken."""
        if self._left:
            raise self.error(str(next(iter(self._left))), f"unknown key; expected one of {', '.join(self._known)}")


def _show(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) < 60 else f"{text[:57]}..."
