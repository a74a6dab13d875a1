"""A user's own defaults, from a YAML file: `VERB: {option: value}`; those under `all` apply to every verb that has the option.

    diagnose: {jobs: 8}
    all: {model: my_robot/model.yaml}

The file is defaults.yaml in the user's configuration folder (`~/.config/workbench`), or the one that WORKBENCH_DEFAULTS names.
Arguments on the command line take precedence.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def defaults_file() -> Path:
    """The path of the user's defaults file, whether or not it exists."""
    named = os.environ.get("WORKBENCH_DEFAULTS")
    folder = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return Path(named) if named else folder / "workbench/defaults.yaml"


def apply_defaults(verbs: Mapping[str, argparse.ArgumentParser]) -> None:
    """Puts the file's values into the parsers. InputError names the file, the key and the expected value."""
    path = defaults_file()
    if not path.is_file():
        if os.environ.get("WORKBENCH_DEFAULTS"):
            _refuse(path, "WORKBENCH_DEFAULTS: file not found")
        return
    from workbench.files.yaml_file import read_yaml

    content = read_yaml(path)
    if content is None:
        return
    if not isinstance(content, dict) or not all(isinstance(v, dict) for v in content.values()):
        _refuse(path, "expected verbs, each with its options, such as 'diagnose: {jobs: 8}'")
    unknown = set(map(str, content)) - {*verbs, "all"}
    if unknown:
        _refuse(path, f"unknown verb '{min(unknown)}'; expected all, {', '.join(verbs)}")
    for option in content.get("all", {}):
        if not any(_action(parser, option) for parser in verbs.values()):
            _refuse(path, f"all: no verb has an option --{option}")
    for verb, parser in verbs.items():
        for option, value in {**content.get("all", {}), **content.get(verb, {})}.items():
            action = _action(parser, option)
            if action is None and option in content.get(verb, {}):
                _refuse(path, f"{verb}: no option --{option}")
            if action is not None:
                parser.set_defaults(**{action.dest: _value(action, value, path, f"{verb}: {option}")})
                action.required = False


def _action(parser: argparse.ArgumentParser, option: object) -> argparse.Action | None:
    return next((a for a in parser._actions if f"--{option}" in a.option_strings and a.dest != "help"), None)


def _value(action: argparse.Action, value: Any, path: Path, key: str) -> Any:
    """The value as argparse would have parsed it from the command line."""
    if action.nargs == 0:
        if not isinstance(value, bool):
            _refuse(path, f"{key}: expected true or false, got {value!r}")
        return value
    try:
        made = action.type(str(value)) if callable(action.type) else str(value)
    except (ValueError, argparse.ArgumentTypeError) as e:
        _refuse(path, f"{key}: {e}")
    if action.choices is not None and made not in action.choices:
        _refuse(path, f"{key}: expected one of {', '.join(map(str, action.choices))}, got {value!r}")
    return made


def _refuse(path: Path, problem: str) -> None:
    from workbench.files import InputError

    raise InputError(path, problem)
