"""Effects of other packages: their declarations are checked as they load, and exceptions in their hooks name them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, get_args

from workbench.effects.base import Effect, Estimator, Family, Layer, Parameter, Place
from workbench.files import InputError
from workbench.robot import ServoConstants

_WORDS = {"layer": Layer, "family": Family, "estimator": Estimator}
HOOKS = tuple(name for name, value in vars(Effect).items() if callable(value) and not name.startswith("_"))


def check_effect(effect: Effect) -> None:
    """InputError names the class variable that is missing or wrong, and the expected value."""
    problem = next(_problems(effect), None)
    if problem is not None:
        raise InputError(None, f"effect '{getattr(effect, 'name', type(effect).__name__)}': {problem}")


def _problems(effect: Effect) -> Iterator[str]:
    for key in ("name", "layer", "places"):
        if not hasattr(effect, key):
            yield f"{key}: is missing"
    if not isinstance(effect.name, str) or not effect.name.isidentifier():
        yield f"name: expected letters, digits and underscores, got {effect.name!r}"
    for key, words in _WORDS.items():
        value = getattr(effect, key)
        if value not in get_args(words) and not (value is None and key != "layer"):
            yield f"{key}: expected one of {', '.join(get_args(words))}, got {value!r}"
    if not isinstance(effect.places, tuple) or not effect.places or not set(effect.places) <= set(get_args(Place)):
        yield f"places: expected a tuple of some of {', '.join(get_args(Place))}, got {effect.places!r}"
    if type(effect).sentence is Effect.sentence:
        yield "sentence: is missing; expected a method that describes how this robot differs from nominal"
    if not isinstance(effect.parameters, tuple) or not all(isinstance(p, Parameter) for p in effect.parameters):
        yield f"parameters: expected a tuple of Parameter, got {effect.parameters!r}"
    for p in effect.parameters:
        if not p.low <= p.typical <= p.high or p.low == p.high or not p.si:
            yield (f"parameter '{p.name}': expected low <= typical <= high, low < high, si not 0; got low {p.low:g}, "
                   f"typical {p.typical:g}, high {p.high:g}, si {p.si:g}")
        if p.adds_to and not isinstance(getattr(ServoConstants(), p.adds_to, None), (int, float)):
            yield f"parameter '{p.name}': adds_to: expected a number of ServoConstants, got '{p.adds_to}'"
    if len({p.name for p in effect.parameters}) < len(effect.parameters):
        yield "parameters: expected different names"


def answering_for(effect: Effect, at: str) -> Effect:
    """The same effect; an exception in one of its hooks becomes an InputError that names `at`, the effect and the hook."""
    for hook in HOOKS:
        if getattr(type(effect), hook) is not getattr(Effect, hook):
            object.__setattr__(effect, hook, partial(_call_hook, effect, hook, at))
    return effect


def _call_hook(effect: Effect, hook: str, at: str, *args: Any, **named: Any) -> Any:
    try:
        return getattr(type(effect), hook)(effect, *args, **named)
    except (InputError, MemoryError):
        raise
    except Exception as e:  # a plug-in may raise anything
        raise InputError(None, f"{at}: effect '{effect.name}', hook {hook}: {type(e).__name__}: {e}") from e
