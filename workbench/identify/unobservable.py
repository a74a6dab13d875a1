"""Effects that a session's takes cannot show, whatever the robot is like, and why: what their absence from the findings does not
mean."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from workbench.effects.base import Effect
from workbench.effects.registry import known_effects
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.servo_logs import is_log
from workbench.robot import RobotModel

HELD = "the base was held in every take"
NO_CAMERA = "only cameras can see it, and the takes are servo logs"
NO_COMMAND = "these servos and commands never excite it"
NO_START = "a later start of the take looks the same, and no take states when it started"
NO_LOAD = "gravity loads none of the joints"


def unobservable(model: RobotModel, evidence: Sequence[TakeEvidence], unloaded: Collection[str] = ()) -> dict[str, str]:
    """Why these takes cannot show an effect at any place, by effect; under "still joints", those that no take moves. unloaded:
    joints that nothing loads in these takes (`unloaded_joints`)."""
    if not evidence:
        return {}
    logs = all(is_log(e) for e in evidence)
    held = all(e.take.spec.base == "fixed" for e in evidence)
    moving = {j for e in evidence for j in e.channels if j in model.joints and _moves(e, j)}
    out = {}
    for name, effect in known_effects().items():
        reason = _reason(effect, model, evidence, held, logs, set(model.joints) <= set(unloaded))
        if reason:
            out[name] = reason
    if held:
        out |= {f"{name} at {model.base}": HELD for name, e in known_effects().items() if e.point_mass or e.moves_center}
    still = [j for j in model.joints if j not in moving]
    if still:
        out["anything at " + ", ".join(still)] = f"no take moves {'it' if len(still) == 1 else 'them'}"
    return out


def _reason(effect: Effect, model: RobotModel, evidence: Sequence[TakeEvidence], held: bool, logs: bool, unloaded: bool) -> str:
    sent = [e.take.commands for e in evidence if e.take.commands is not None]
    if logs and (effect.layer == "measurement" or "rigid_body" in effect.places):
        return NO_CAMERA
    if held and not effect.observable_when_fixed:
        return HELD
    if logs and effect.free_play and not effect.from_neutral:
        return NO_CAMERA
    if not effect.could_act(model, sent):
        return NO_COMMAND
    if effect.like_a_late_start and effect.places == ("robot",) and any(e.start_is_free for e in evidence):
        return NO_START
    return NO_LOAD if effect.needs_steady_load and unloaded else ""


def _moves(e: TakeEvidence, joint: str) -> bool:
    column = e.recorded[:, e.channels.index(joint)]
    seen = column[np.isfinite(column)]
    return bool(len(seen) and np.ptp(seen) > PROBLEM.still)
