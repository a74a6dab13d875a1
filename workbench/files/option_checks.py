"""Checks of the fields of options objects; each raises InputError with the field's name and the expected value."""

from __future__ import annotations

from collections.abc import Collection
from numbers import Integral, Real
from typing import Any

from workbench.files.errors import InputError


def check_choice(name: str, value: Any, allowed: Collection[str]) -> None:
    """InputError where `value` is not one of `allowed`."""
    if value not in allowed:
        raise InputError(None, f"{name}: expected one of {', '.join(allowed)}, got {value!r}")


def check_whole(options: Any, **least: int) -> None:
    """InputError where a field of `options` is not a whole number of at least so much."""
    for name, bound in least.items():
        value = getattr(options, name)
        if isinstance(value, bool) or not isinstance(value, Integral) or value < bound:
            raise InputError(None, f"{name}: expected a whole number of at least {bound}, got {value!r}")


def check_positive(options: Any, *names: str) -> None:
    """InputError where a field of `options` is not a positive number; infinity is one."""
    for name in names:
        value = getattr(options, name)
        if isinstance(value, bool) or not isinstance(value, Real) or not float(value) > 0:
            raise InputError(None, f"{name}: expected a positive number, got {value!r}")
