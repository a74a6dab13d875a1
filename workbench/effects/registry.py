"""All effects that this installation knows, by name: the workbench's own, and those of other packages."""

from __future__ import annotations

from functools import cache

from workbench.effects.base import Effect, Estimator
from workbench.effects.foreign import answering_for, check_effect
from workbench.files import InputError
from workbench.files.plug_ins import of_folder, with_plug_ins

ENTRY_POINT_GROUP = "workbench.effects"


@cache
def known_effects() -> dict[str, Effect]:
    """Effects by name; an installed plug-in may not take the name of another effect."""
    import workbench.effects.library as room

    own = {effect.name: effect for effect in of_folder(room, "EFFECT", Effect)}
    return with_plug_ins(own, ENTRY_POINT_GROUP, Effect, "effect", _check)


def _check(effect: Effect, at: str) -> tuple[str, Effect]:
    check_effect(effect)
    return effect.name, answering_for(effect, at)


@cache
def estimated_by(estimator: Estimator) -> tuple[Effect, ...]:
    """The effects that are estimated directly from the recordings in this way."""
    return tuple(effect for effect in known_effects().values() if effect.estimator == estimator)


def effect_named(name: str) -> Effect:
    """The effect of that name; InputError lists the known ones."""
    effects = known_effects()
    if name not in effects:
        raise InputError(None, f"effect '{name}' is not known, or its package is not installed; known: "
                               f"{', '.join(sorted(effects))}")
    return effects[name]
