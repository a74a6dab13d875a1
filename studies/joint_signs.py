"""Which way does each servo turn on the model? `python -m studies.joint_signs` -> runs/studies/joint_signs/.

The ROBOTIS walk gives servo angles, whose signs on the model depend on how each servo is mounted.

1. Symmetry. Half a cycle (two poses) later the walk is its mirror image. The table itself says for each pair whether left and
   right servos then have equal or opposite angles; with the mirror image of the axis (rotation about the lateral axis stays,
   about the forward axis reverses) that fixes the sign of each right joint by that of the left one.
2. All remaining choices (middle, bottom and top of front and hind legs, tail: 128) are simulated for three seconds, then those
   that go forward without falling or turning for six: with the servo law under other friction, steps and hind feet
   (data/parts.csv), and with ideal joints in point and hydroelastic contact, which is how the thesis simulated.
3. What is left is held against what the sources say of the robot apart from distance. Hard: front and hind knees bend the same
   way, as on the published robot of this kit (Webots' BioloidDog: one inverse kinematics for all four legs). Then, from the
   thesis, 7.2: front legs do more of the propulsion than hind legs; the tail turns by less than commanded, and probably the
   tops; roll and pitch in which its runs ended. The rule: knees alike, walks in most conditions, most of these four met, the
   smaller tail ratio (the only amplitude that the thesis calls significant).

Distance takes no part in the rule; distance.csv and the figure's last column compare it afterwards. That is no blind test,
though: two earlier rules were mended with distances known. Least slip of loaded feet gave front elbows back and hind knees
forward, which walks 0.8 m where the thesis's robot went 0.37 m and drives as much with the hind legs; the servo law alone,
without the ideal joints, gave tops and a tail with which ideal joints turn by 61 and 107 deg and go backwards, where the
thesis's simulations went straight. Nearness to 0.37 m therefore confirms nothing.

What came out (Drake 1.51.1): 20 choices walk for three seconds; of those with knees alike two walk in six of the seven
conditions, and only one of them meets all four observations: all knees point back, all tops turn alike, tail +. It fails with
the hind feet right under their joints, where it goes backwards. Its tail keeps 0.93 of what is commanded, with - 0.54, which
is nearer to the thesis's "significantly smaller", but with - it walks in five. It goes 0.12 to 0.17 m with the feet as in the
tables, 0.25 m with ideal joints in hydroelastic contact: a third to three quarters of what the robot and the thesis's
simulation went. Ideal joints follow a smooth curve through the poses here; on curves that rest at each pose, as the thesis's may
have, they go 0.02 to 0.06 m, in hydroelastic contact 0.11 m (studies.thesis_runs).

Against the choice. Its feet slip two to three times as much as those of the slip rule's choice, which walks in all seven
conditions, and in a walk that was designed loaded feet should stand still. Webots' robot supports that knees are alike, not
which way they point: its own point forward (thigh forward, shank back) where these point back, and its hips turn about the
lateral axis first; here no choice with all knees forward goes forward. A photograph of the robot in a bent pose would settle
all of it.

Neck and head hardly move and carry no load: the walk does not settle them.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.build_puppy import ROOT, build
from models.puppy_assembly import read_parts
from studies.gait import Gait, read_gait
from studies.joint_signs_report import write_report
from studies.joint_signs_rule import FREE, Choice, Verdict, knees_alike, label
from workbench.files.reading import write_whole
from workbench.motion import load_motion
from workbench.motion.commands import Commands
from workbench.robot import JOINTS, Ground, data_file, puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch

Array = NDArray[np.float64]
FAST = SimulationConfig(time_step=2e-3, drive="fast_servo", settle=0.5)
FULL = SimulationConfig(time_step=1e-3, settle=0.5)
IDEAL = SimulationConfig(time_step=1e-3, settle=0.5, drive="ideal")
SCREEN_SECONDS, SECONDS = 3.0, 6.0


@dataclass(frozen=True)
class Condition:
    """What a choice is tried under. hind_foot: offset [m] of the hind feet; None: as in data/parts.csv."""

    name: str
    friction: float = 0.5
    hind_foot: float | None = None
    config: SimulationConfig = FAST


SCREEN = Condition("screen")
CONDITIONS = (
    Condition("as in the tables"),
    Condition("friction 0.6", friction=0.6),
    Condition("friction 0.7", friction=0.7),
    Condition("hind feet under their joints", hind_foot=0.0),
    Condition("full servo law, 1 ms", config=FULL),
    Condition("ideal joints, poses joined smoothly", config=IDEAL),
    Condition("ideal joints, hydroelastic", config=replace(IDEAL, contact="hydroelastic")),
)


def mirror_relations(angles: Mapping[str, Array]) -> dict[str, tuple[int, float, float]]:
    """For each left joint: +1 if the right servo, half a cycle later, has the same angle, -1 if the opposite one; with the RMS
    error [rad] of that relation and of the other one. angles: (4,) [rad] by joint, one cycle."""
    out = {}
    for left in (j for j in JOINTS if j[1:2] == "l" and j[0] in "fb" and len(j) == 3):
        right = left[0] + "r" + left[2]
        later = np.roll(angles[right], -2)
        error = {s: float(np.sqrt(np.mean((angles[left] - s * later) ** 2))) for s in (1, -1)}
        best = min(error, key=lambda s: error[s])
        out[left] = (best, error[best], error[-best])
    return out


def signs_of(choice: Choice, relations: Mapping[str, tuple[int, float, float]], fixed: Mapping[str, int]) -> dict[str, int]:
    """Signs of all joints. The mirror image of a joint's rotation about y is the same rotation, about x the opposite one, so
    sign_right = relation * sign_left about y and -relation * sign_left about x."""
    signs = dict(fixed) | dict(zip(FREE, choice))
    for left, (relation, *_) in relations.items():
        signs[left[0] + "r" + left[2]] = signs[left] * relation * (-1 if left[2] == "t" else 1)
    return signs


def with_signs(commands: Commands, factor: Mapping[str, int]) -> Commands:
    """Commands whose goals are turned about by joint: the same motion as with the joint's axis reversed."""
    return replace(commands, goals=commands.goals * np.array([factor[j] for j in commands.joints]))


@dataclass(frozen=True)
class Walk:
    """The ROBOTIS walk: one cycle's angles [rad] by joint, its length [s], and commands of enough cycles for a run."""

    angles: Mapping[str, Array]
    cycle: float
    commands: Commands


def robotis_walk() -> Walk:
    motion = load_motion(data_file("robotis_walk.csv"))
    cycle = float(motion.times[-1] - motion.times[0])
    return Walk({j: motion.angles[:-1, i] for i, j in enumerate(motion.joints)}, cycle,
                motion.commands(cycles=int(np.ceil(SECONDS / cycle))))


def try_choices(choices: Sequence[Choice], condition: Condition, seconds: float, folder: Path,
                progress: Callable[[int, int], None] | None = None) -> list[Gait]:
    """Simulates the walk for each choice under one condition. folder: where a puppy with other feet may be built."""
    table, parts = data_file("joint_signs.csv"), data_file("parts.csv")
    walk = robotis_walk()
    relations = mirror_relations(walk.angles)
    model = puppy_model(ground=Ground(friction=condition.friction, stiffness=float("inf")))
    if condition.hind_foot is not None:
        text = parts.read_text(encoding="utf-8").splitlines()
        row = next(i for i, line in enumerate(text) if line.startswith("dimension,back_foot_offset"))
        cells = text[row].split(",", 4)
        text[row] = ",".join([*cells[:3], str(condition.hind_foot), cells[4]])
        parts = write_whole(folder / "parts.csv", "\n".join(text) + "\n")
        model = replace(model, description=str(build(folder / f"hind_foot_{condition.hind_foot}", parts, table)))
    in_model = {j: int(frame.axis.sum()) for j, frame in model.kinematics.frames.items()}
    d = read_parts(parts).length
    tips = {foot: np.array([0, 0, -d["front_shank"]] if foot[0] == "f" else [d["back_foot_offset"], 0, -d["back_shank"]])
            for foot in model.foot_links}
    jobs = []
    for choice in choices:
        signs = signs_of(choice, relations, in_model)
        jobs.append(Job(model, condition.config, with_signs(walk.commands, {j: signs[j] * in_model[j] for j in JOINTS}), seconds))
    return [read_gait(take, model, walk.cycle, tips) for take in simulate_batch(jobs, progress=progress)]


def _progress(what: str) -> Callable[[int, int], None]:
    def show(done: int, total: int) -> None:
        print(f"\r{what}: {done}/{total}", end="\n" if done == total else "", file=sys.stderr, flush=True)
    return show


def main(out: Path = ROOT / "runs/studies/joint_signs") -> int:
    """Runs the study; writes its tables and figure into `out`."""
    walk = robotis_walk()
    for joint, (relation, error, other) in mirror_relations(walk.angles).items():
        word = "opposite" if relation < 0 else "equal"
        print(f"{joint}: right servo {word} half a cycle later, "
              f"RMS {np.degrees(error):.2f} deg (else {np.degrees(other):.1f} deg)")
    choices = list(itertools.product((1, -1), repeat=len(FREE)))
    runs: dict[Choice, list[Gait]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        first = try_choices(choices, SCREEN, SCREEN_SECONDS, Path(scratch), _progress(f"all choices, {SCREEN_SECONDS:.0f} s"))
        tried = [c for c, g in zip(choices, first) if g.walks]
        for condition in CONDITIONS:
            for c, g in zip(tried, try_choices(tried, condition, SECONDS, Path(scratch), _progress(condition.name))):
                runs.setdefault(c, []).append(g)
    ranked = sorted((Verdict(c, knees_alike(c, walk.angles), gaits) for c, gaits in runs.items()), key=lambda v: v.rank)
    write_report(out, dict(zip(choices, first)), ranked, [c.name for c in CONDITIONS])
    print(f"chosen: {label(ranked[0].choice)}\nwrote {out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
