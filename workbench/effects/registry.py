"""All effects that this installation knows, by name: the contract's, and those of other packages."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pkgutil import iter_modules

from workbench.effects.base import Effect, Estimator
from workbench.robot import InputError

ENTRY_POINT_GROUP = "workbench.effects"


@cache
def known_effects() -> dict[str, Effect]:
    """Effects by name; an installed plug-in may not take the name of another effect."""
    import workbench.effects.library as room

    found: dict[str, Effect] = {}
    for module in iter_modules(room.__path__):
        effect = getattr(import_module(f"{room.__name__}.{module.name}"), "EFFECT", None)
        if isinstance(effect, Effect):
            found[effect.name] = effect
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        effect = entry.load()
        if not isinstance(effect, Effect):
            raise InputError(entry.value, f"entry point '{entry.name}' of group {ENTRY_POINT_GROUP}: expected an Effect instance")
        if effect.name in found:
            raise InputError(entry.value, f"effect '{effect.name}' is known already")
        found[effect.name] = effect
    return found


def estimated_by(estimator: Estimator) -> tuple[Effect, ...]:
    """The effects that are read off the recordings in this way."""
    return tuple(effect for effect in known_effects().values() if effect.estimator == estimator)


def effect_named(name: str) -> Effect:
    """The effect of that name; InputError lists the known ones."""
    effects = known_effects()
    if name not in effects:
        raise InputError(None, f"effect '{name}' is not known; known: {', '.join(sorted(effects))}")
    return effects[name]
