"""Two engines on the same table over friction, supply and entry, where the optimum of one point would show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from workbench.gait.limits import Margin
from workbench.gait.measure import GaitMeasure
from workbench.gait.request import Request
from workbench.gait.requirements import drift
from workbench.robot import EffectSpec, RobotModel

AS_IT_IS = "nominal"
FRICTIONS = (0.3, 0.5, 0.7, 0.9)
"""Of foot on ground: the range of the ensemble that ships."""
SUPPLIES = (9.6, 12.0)
"""[V] of a lithium polymer battery of three cells, nearly empty and nearly full."""
AT_ONCE = "from neutral at once"
"""The gait without its way in."""


@dataclass(frozen=True)
class Condition:
    """One robot and entry that both engines play. effects: in addition to the model's own. at_once: without the start."""

    name: str
    effects: tuple[EffectSpec, ...] = ()
    at_once: bool = False

    def of(self, model: RobotModel) -> RobotModel:
        """The robot under this condition."""
        return model.with_effects((*model.effects, *self.effects))


def conditions() -> tuple[Condition, ...]:
    """The nominal robot, then each friction, each supply, and the gait entered at once."""
    return (Condition(AS_IT_IS),
            *(Condition(f"friction {f:g}", (EffectSpec("ground_friction", (), {"friction": f}),)) for f in FRICTIONS),
            *(Condition(f"{v:g} V", (EffectSpec("supply_voltage", (), {"voltage": v}),)) for v in SUPPLIES),
            Condition(AT_ONCE, at_once=True))


Pair = tuple[GaitMeasure, GaitMeasure]
"""Of one condition: by this engine, and by the other."""


def summary(request: Request, name: str, pairs: Mapping[str, Pair]) -> dict[str, object]:
    """The comparison, for a certificate; speeds in the request's unit. pairs: by condition, the nominal one too."""
    ours, theirs = pairs[AS_IT_IS]
    nominal = max(abs(request.progress(ours)), 1e-9)
    rows = {k: {"speed": request.progress(a), "speed elsewhere": request.progress(b),
                "heading deg/m": math.degrees(drift(request, a)), "heading elsewhere deg/m": math.degrees(drift(request, b)),
                "fell": a.fell, "fell elsewhere": b.fell}
            for k, (a, b) in pairs.items()}
    return {"name": name, "speed": request.progress(theirs), "speed kept": request.progress(theirs) / nominal,
            "heading deg/m": math.degrees(drift(request, theirs)), "fell": theirs.fell, "slip m/s": theirs.slip,
            "heading apart deg/m": math.degrees(drift(request, theirs) - drift(request, ours)), "conditions": rows,
            "largest speed apart": max(_apart(request, p) for p in pairs.values()) / nominal}


def margins(request: Request, name: str, pairs: Mapping[str, Pair], allowed: float) -> list[Margin]:
    """Limits of the comparison: nothing falls in either engine, and speeds agree. allowed: largest difference of the speeds in a
    condition, as a share of the nominal speed."""
    nominal = max(abs(request.progress(pairs[AS_IT_IS][0])), 1e-9)
    worst = max(pairs, key=lambda k: _apart(request, pairs[k]))
    apart = _apart(request, pairs[worst]) / nominal
    out = [Margin("engines apart", f"{worst}, in {name}", 100 * apart, 100 * allowed, "% of the speed", apart / allowed)]
    fell = [k for k, (a, b) in pairs.items() if a.fell or b.fell]
    where = fell[0] if fell else f"{len(pairs)} conditions"
    out.append(Margin("falls in two engines", where, float(len(fell)), 0.0, "allowed", 1.0 + len(fell) if fell else 0.0))
    return out


def _apart(request: Request, pair: Pair) -> float:
    """Difference of the speeds."""
    return abs(request.progress(pair[0]) - request.progress(pair[1]))
