"""The drift to the left (thesis, 8.1): loose screws in the front left leg, or what else?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from studies.common import COORDINATES
from studies.riddles.apart import Apart, Number, apart, end_of, number, sigma
from studies.riddles.cameras import record
from studies.riddles.hypotheses import Hypothesis, Progress, Run, Setting, run_all, walk
from workbench.robot import EffectSpec, RobotModel

Array = NDArray[np.float64]

TIGHT, TILT, SLIP, SHORT = "all tight", "floor tilted", "slippery foot", "shorter leg"
BACKLASH, BACKLASH_LEG, WEAK = "backlash flm", "backlash fl", "weak flm"
SECONDS = 6.0
PLAY = 4.0
"""Free play of a loose mount and of backlash, the whole of it [deg]. The thesis does not say how loose the screws were."""
LEG = ("flb", "flm", "flt")
ACROSS = {"flb": ("x", "z"), "flm": ("x", "z"), "flt": ("y", "z")}
"""The axes that a joint's servo does not turn: forward, left, up in neutral."""
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
PLAYS = (0.25, 0.5, 1.0, 2.0)
SOUGHT = ("flm", "x")
"""Where smaller plays are tried."""
ASKEW = 5.0
"""By how much the capture's x axis may be off the robot's first heading [deg]."""


def loose(joint: str, axis: str, play: float = PLAY, floors: bool = False) -> Hypothesis:
    """Loose screws between a servo's horn and its link."""
    where = {"x": "forward", "y": "lateral", "z": "upright"}[axis]
    return Hypothesis(f"loose {joint} {axis}", f"The link of {joint} rocks by {play:g} deg in all about the {where} axis.",
                      (EffectSpec("loose_mount", (joint,), {"play": play, "axis": AXES[axis]}),), floors=floors)


def hypotheses() -> list[Hypothesis]:
    """Loose screws at each place and axis of the leg, and what else turns a walk to one side."""
    mounts = [loose(j, a, floors=(j, a) == SOUGHT) for j in LEG for a in ACROSS[j]]
    return [
        Hypothesis(TIGHT, "Nothing is loose; the shipped puppy.", floors=True), *mounts,
        Hypothesis(BACKLASH, f"The gear of flm has {PLAY:g} deg of free play, about its own axis.",
                   (EffectSpec("backlash", ("flm",), {"gap": PLAY}),)),
        Hypothesis(BACKLASH_LEG, f"All three gears of the front left leg have {PLAY:g} deg of free play.",
                   (EffectSpec("backlash", LEG, {"gap": PLAY}),)),
        Hypothesis(WEAK, "The servo of flm gives at most 0.3 N m.",
                   (EffectSpec("torque_ceiling", ("flm",), {"torque": 0.3}),)),
        Hypothesis(TILT, "The floor falls to the left by 1 deg.",
                   (EffectSpec("ground_tilt", (), {"forward": 0.0, "left": 1.0}),)),
        Hypothesis(SLIP, "The front left foot has friction 0.3, the others 0.5.",
                   (EffectSpec("foot_friction", ("flb",), {"friction": 0.3}),)),
        Hypothesis(SHORT, "The front left shank is 2 mm shorter than the right one.",
                   (EffectSpec("link_length", ("flb_link",), {"change": -0.002}),)),
    ]


@dataclass(frozen=True)
class Result:
    """All of it. found: recording of each hypothesis beside the simulation of TIGHT. ends: where the body ends by coordinate.
    small: play [deg] -> sigma off the axis and sigma of the worst angle. turned_round: heading [deg] and sideways end [cm, right]
    on the tilted floor, walking one way and the other. askew: sideways end in the capture's own axes [cm, right], and in the
    robot's after registration, of TIGHT put down ASKEW."""

    runs: Mapping[str, Run]
    found: Mapping[str, Apart]
    ends: Mapping[str, Mapping[str, Number]]
    small: Mapping[float, tuple[float, float]]
    turned_round: Mapping[str, tuple[float, float]]
    askew: tuple[float, float]
    seconds: float

    def drift(self, name: str) -> float:
        """How much further left a hypothesis heads at the end than TIGHT [deg]."""
        return self.ends[name]["ry"].value - self.ends[TIGHT]["ry"].value

    def drift_sigma(self, name: str) -> float:
        """The same over floors and spreads of both; TIGHT's stand for those of a hypothesis without its own."""
        doubt = np.hypot(self.ends[name]["ry"].doubt or self.ends[TIGHT]["ry"].doubt, self.ends[TIGHT]["ry"].doubt)
        return float(abs(self.drift(name)) / doubt) if doubt > 0 else float("nan")


def measure(model: RobotModel, quick: bool, progress: Progress) -> Result:
    """All runs and what is read off their recordings."""
    seconds = 1.0 if quick else SECONDS
    setting = Setting(seconds, walk())
    named = [replace(h, floors=False) for h in hypotheses()] if quick else hypotheses()
    runs = run_all(named, model, setting, progress)
    progress("recording", None)
    found = {n: apart(r, runs[TIGHT], model, seconds) for n, r in runs.items()}
    ends = {n: {c: number(r, end_of(COORDINATES.index(c), seconds)) for c in ("x", "z", "ry", "rx")} for n, r in runs.items()}
    small = {}
    for play in PLAYS[:1] if quick else PLAYS:
        h = loose(*SOUGHT, play=play)
        a = apart(run_all([h], model, setting, progress)[h.name], runs[TIGHT], model, seconds)
        small[play] = sigma(a.off_axis[SOUGHT[0]]), a.sigma(a.worst())
    away = Hypothesis("away", "", (EffectSpec("ground_tilt", (), {"forward": 0.0, "left": -1.0}),))
    back = run_all([away], model, setting, progress)["away"].take
    turned = {n: tuple(end_of(COORDINATES.index(c), seconds)(t) for c in ("ry", "z"))
              for n, t in (("there", runs[TILT].take), ("back", back))}
    return Result(runs, found, ends, small, turned, _askew(runs[TIGHT], model, seconds), seconds)  # type: ignore[arg-type]


def _askew(run: Run, model: RobotModel, seconds: float) -> tuple[float, float]:
    """How far right the body ends, more than of a robot put down straight, in the capture's axes and after registration [cm]."""
    ends = []
    for yaw in (0.0, -np.radians(ASKEW)):
        recorded = record(run.take, model, seconds, run.take, yaw=yaw)
        body = next(b for a, b in recorded.recording.rigid_bodies.items() if model.rigid_bodies[a] == model.base)
        assert recorded.take.p_WB is not None
        rest = recorded.take.resting
        raw = body.p[-1, 2] - body.p[rest, 2].mean()
        registered = -(recorded.take.p_WB[-1, 1] - recorded.take.p_WB[rest, 1].mean())
        ends.append((100 * raw, 100 * registered))
    return float(ends[1][0] - ends[0][0]), float(ends[1][1] - ends[0][1])
