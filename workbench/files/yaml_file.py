"""YAML written by people, read strictly: every unknown, missing or mistyped key is reported with its place."""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from workbench.files.errors import InputError
from workbench.files.reading import read_text

MOST_BYTES = 1 << 20
"""Largest YAML file that is read [bytes]; a fitted model of a hundred parameters has 0.2 MB."""
MOST_VALUES = 100_000
"""Values in one file with every alias expanded: a few hundred bytes of aliases of aliases can expand to billions."""
MOST_DEPTH = 50
"""Levels of nesting; the deepest file of the workbench has six."""
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The same either way, ten times faster in C."""


class _CoreLoader(_Loader):  # type: ignore[misc]
    """YAML 1.2's core schema. PyYAML's 1.1 reads 1e5 and 1.0e5 as text, 1:30 as 90 and a joint named `on` as true."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.MarkedYAMLError(problem="expected a name as key", problem_mark=key.start_mark)
            if key.value in seen:
                raise yaml.MarkedYAMLError(problem=f"duplicate key '{_short(key.value)}'", problem_mark=key.start_mark)
            seen.add(key.value)
        return dict(super().construct_mapping(node, deep=deep))


_CORE = "tag:yaml.org,2002:"
_PATTERNS = {
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]{1,18}", list("-+0123456789")),
    "float": (r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
              list("-+.0123456789")),
}
_CoreLoader.yaml_implicit_resolvers = {}
for _tag, (_pattern, _first) in _PATTERNS.items():
    _CoreLoader.add_implicit_resolver(_CORE + _tag, re.compile(f"(?:{_pattern})$"), _first)
_CoreLoader.add_constructor(f"{_CORE}int", lambda loader, node: int(node.value))


def _count_values(node: Any, depth: int = 0, sizes: dict[int, int] | None = None) -> int:
    """Number of values that a node expands to, with its aliases; MarkedYAMLError where that, or its depth, is too large, where
    it contains itself, or a value does not match its tag."""
    sizes = {} if sizes is None else sizes
    if id(node) in sizes:
        if sizes[id(node)] < 0:
            raise yaml.MarkedYAMLError(problem="recursive alias", problem_mark=node.start_mark)
        return sizes[id(node)]
    if depth > MOST_DEPTH:
        raise yaml.MarkedYAMLError(problem=f"nested deeper than {MOST_DEPTH} levels", problem_mark=node.start_mark)
    sizes[id(node)] = -1
    tag = node.tag.removeprefix(_CORE)
    if isinstance(node, yaml.ScalarNode):
        total = 1
        if tag != "str" and (tag not in _PATTERNS or not re.fullmatch(_PATTERNS[tag][0], node.value)):
            raise yaml.MarkedYAMLError(problem=f"'{_short(node.value)}' is no {tag}", problem_mark=node.start_mark)
        if re.fullmatch("[-+]?[0-9]{19,}", node.value):
            raise yaml.MarkedYAMLError(problem=f"a whole number of {len(node.value)} digits; expected at most 18",
                                       problem_mark=node.start_mark)
    else:
        if tag != ("map" if isinstance(node, yaml.MappingNode) else "seq"):
            raise yaml.MarkedYAMLError(problem=f"a tag '{_short(node.tag)}'; expected plain values", problem_mark=node.start_mark)
        children = [c for pair in node.value for c in pair] if isinstance(node, yaml.MappingNode) else node.value
        total = 1 + sum(_count_values(child, depth + 1, sizes) for child in children)
    if total > MOST_VALUES:
        raise yaml.MarkedYAMLError(problem=f"more than {MOST_VALUES} values, aliases written out", problem_mark=node.start_mark)
    sizes[id(node)] = total
    return total


class _Dumper(yaml.SafeDumper):
    """Quotes what YAML 1.1 or 1.2 would take for something else than text; no anchors, as a person would write."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


_Dumper.add_multi_representer(str, yaml.SafeDumper.represent_str)  # problems are text with a kind
_Dumper.yaml_implicit_resolvers = {
    first: [*yaml.SafeDumper.yaml_implicit_resolvers.get(first, []), *_CoreLoader.yaml_implicit_resolvers.get(first, [])]
    for first in {*yaml.SafeDumper.yaml_implicit_resolvers, *_CoreLoader.yaml_implicit_resolvers}}


def yaml_text(content: Mapping[str, Any]) -> str:
    """Plain types as YAML, in their order, that `read_yaml` gives back; lists of numbers on one line."""
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def read_yaml(path: str | Path) -> Any:
    """Content of a YAML file (1.2 core schema, no key twice, no tags, sizes bounded); InputError if it cannot be read."""
    text = read_text(path, MOST_BYTES)
    try:
        loader = _CoreLoader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _count_values(node)
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except RecursionError:
        raise InputError(path, f"not valid YAML: nested deeper than {MOST_DEPTH} levels") from None
    except yaml.YAMLError as e:
        raise InputError(path, f"not valid YAML: {' '.join(str(e).replace(_UNNAMED, '').split()).replace(' , ', ', ')}") from None


class Fields:
    """A mapping inside a YAML file whose keys are taken one by one; `done` rejects keys that nobody took.

    Every error names the file, the place in it (`takes[2].base`) and the expected value.
    """

    def __init__(self, path: Path, content: Any, place: str = "") -> None:
        self.path, self.place = path, place
        if not isinstance(content, Mapping):
            raise InputError(path, f"{place or 'top level'}: expected a mapping, got {_show(content)}")
        self._left = dict(content)
        self._known: list[str] = []

    def error(self, key: str, expected: str) -> InputError:
        """The error to raise about `key`."""
        return InputError(self.path, f"{self.at(key)}: {expected}")

    def missing(self, keys: Sequence[str]) -> InputError:
        """The error to raise about required keys that are absent."""
        return self.error(", ".join(keys), "is missing" if len(keys) == 1 else "are missing")

    def at(self, key: str) -> str:
        """Place of a key in the file."""
        return f"{self.place}.{key}" if self.place else key

    def raw(self, key: str) -> Any:
        """The value as YAML gave it; None where the key is absent. InputError where it is left empty."""
        self._known.append(key)
        if key in self._left and self._left[key] is None:
            raise self.error(key, "is empty; expected a value, or no such key")
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

    def number(self, key: str, least: float = -math.inf, most: float = math.inf, finite: bool = True) -> float | None:
        """A number from `least` to `most`."""
        value = self.raw(key)
        if value is None:
            return None
        good = isinstance(value, (int, float)) and not isinstance(value, bool) and least <= value <= most
        if not good or (finite and math.isinf(value)):
            raise self.error(key, f"expected a number{_bounds(least, most)}, got {_show(value)}")
        return float(value)

    def whole(self, key: str, default: int | None = None, least: int = 0, most: float = math.inf) -> int | None:
        """A whole number from `least` to `most`."""
        value = self.raw(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise self.error(key, f"expected a whole number{_bounds(least, most)}, got {_show(value)}")
        return value

    def flag(self, key: str) -> bool:
        """true or false; false where the key is absent."""
        value = self.raw(key)
        if value is not None and not isinstance(value, bool):
            raise self.error(key, f"expected true or false, got {_show(value)}")
        return bool(value)

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
        """Takes all keys that are left, with their values, for mappings whose keys are names."""
        while self._left:
            key = next(iter(self._left))
            if not isinstance(key, str):
                raise self.error(str(key), "expected a name as key")
            yield key, self.raw(key)

    def numbered(self) -> dict[int, Any]:
        """Takes all keys that are left, with their values, for mappings whose keys are whole numbers of at least 0."""
        for key in self._left:
            if isinstance(key, bool) or not isinstance(key, int) or key < 0:
                raise self.error(str(key), "expected a whole number as key")
        out, self._left = self._left, {}
        return out

    def sequence(self, key: str) -> list[Fields]:
        """A list of mappings; empty where the key is absent."""
        value = self.raw(key)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self.error(key, f"expected a list, got {_show(value)}")
        return [Fields(self.path, v, f"{self.at(key)}[{i}]") for i, v in enumerate(value)]

    def only(self, *keys: str) -> None:
        """InputError at a key that is none of these: a misspelled key is reported as such, not as another one that is missing."""
        for key in self._left:
            if key not in keys:
                raise self.error(str(key), f"unknown key; expected one of {', '.join(keys)}")

    def required(self, key: str, value: Any) -> Any:
        """`value`, as taken from `key`, unless it was absent."""
        if value is None:
            raise self.error(key, "is missing")
        return value

    def done(self) -> None:
        """InputError if a key was never taken."""
        if self._left:
            raise self.error(str(next(iter(self._left))), f"unknown key; expected one of {', '.join(self._known)}")


def _bounds(least: float, most: float) -> str:
    low = "" if math.isinf(least) else f" of at least {least:g}"
    return low if math.isinf(most) else f"{low or ' of'}{' and' if low else ''} at most {most:g}"


def _show(value: Any) -> str:
    return "nothing" if value is None else _short(_SHORT.repr(value))


def _short(text: str) -> str:
    return text if len(text) < 60 else f"{text[:57]}..."


_UNNAMED = ' in "<unicode string>"'
_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 2, 60, 60


def top_of(path: Path, *keys: str) -> Fields:
    """The file's keys, of which none is unknown; its `format` is 1."""
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise InputError(path, "top level: expected a mapping, as in a session.yaml or a model.yaml "
                               "(`workbench inspect` recognises other files)")
    top = Fields(path, content)
    version = top.raw("format")
    if version is None:
        top.only("format", *keys)
    if version != 1 or isinstance(version, bool):
        raise top.error("format", "expected 1")
    top.only(*keys)
    return top
