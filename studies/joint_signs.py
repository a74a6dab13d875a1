"""Which way does each servo turn on the model? `python -m studies.joint_signs` -> runs/studies/joint_signs/.

The ROBOTIS walk gives servo angles, whose signs on the model depend on how each servo is mounted. Three steps, none of
which looks at the distance walked:

1. Symmetry. Half a cycle (two poses) later the walk is its mirror image. The table itself says for each pair whether left and
   right servos then have equal or opposite angles; with the mirror image of the axis (rotation about the lateral axis stays,
   about the forward axis reverses) that fixes the sign of each right joint by that of the left one.
2. All remaining choices (middle, bottom and top of front and hind legs, tail: 128) are simulated for a few seconds. Out go
   those that fall, that do not go forward, or that turn.
3. What is left is repeated, until it fails, with other friction, servo law, steps and the two hind feet that the sources
   allow (data/parts.csv). A sign is a fact about the robot, so the right choice has to walk in all of them. Between those that
   do, the feet decide: in a walk that was designed, loaded feet stand still; where a leg turns the wrong way, front and hind
   legs pull against each other.

What came out (Drake 1.51.1): six choices walk in all six conditions. Two have half the slip of the others and differ in the tail
alone: front elbows point back, hind knees forward, top servos' horns look forwards in front and backwards behind. The table alone
agrees: while front right and hind left carry (first to third pose; the other two are shorter), both feet of this choice move back
under the body by 32 mm, those of the choices with the other hind legs move 32 mm apart. The tail's sign rests on less. This
choice goes about 0.8 m in six seconds where the thesis measured 0.37 m; that gap is open, and a photograph of the standing, bent
robot would test the choice.

Neck and head hardly move and carry no load: the walk does not settle them.
"""

from __future__ import annotations

import csv
import io
import itertools
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from models.build_puppy import ROOT, build
from models.puppy_sdf import read_signs
from workbench.motion.commands import Commands
from workbench.motion.motion import load_motion
from workbench.recording.take import Take
from workbench.robot import FEET, JOINTS, Ground, RobotModel, data_file, puppy_model
from workbench.robot.files import write_whole
from workbench.simulation import Job, SimulationConfig, simulate_batch

matplotlib.use("Agg")
from matplotlib import pyplot as plt

Array = NDArray[np.float64]
FREE = ("flm", "flb", "flt", "blm", "blb", "blt", "tail")
"""Joints whose signs symmetry leaves open; the right legs follow the left ones."""
Choice = tuple[int, ...]
FALLEN_TILT, FALLEN_HEIGHT, TURNED = np.radians(25), 0.6, np.radians(30)
"""A fall: tilt, or height by the height at rest. A turn: heading at the end of six seconds
(the step and the contact approximation alone move it by about 25 degrees); shorter runs get less in proportion."""


@dataclass(frozen=True)
class Gait:
    """How one run went. forward, left [m], heading [rad] (left positive), slip: load-weighted speed of loaded feet over the
    ground [m/s]; a fallen run keeps what it did until its end."""

    fell: bool
    forward: float
    left: float
    heading: float
    slip: float
    seconds: float

    @property
    def walks(self) -> bool:
        """Goes forward without falling or turning."""
        return not self.fell and self.forward > 0 and abs(self.heading) < TURNED * self.seconds / 6


FAST = SimulationConfig(time_step=2e-3, drive="fast_servo", settle=0.5)


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
    Condition("full servo law, 1 ms", config=SimulationConfig(time_step=1e-3, settle=0.5)),
    Condition("hind feet 14.5 mm back", hind_foot=-0.0145),
    Condition("hind feet 14.5 mm back, friction 0.7", friction=0.7, hind_foot=-0.0145),
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


def judge(take: Take, model: RobotModel) -> Gait:
    """Reads a gait off a take; heading unwrapped, slip from the tips of the feet."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    w, x, y, z = take.quat_WB.T
    up = 1 - 2 * (x**2 + y**2)
    heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))
    height = take.p_WB[:, 2] / take.p_WB[0, 2]
    fell = bool(np.min(up) < np.cos(FALLEN_TILT) or np.min(height) < FALLEN_HEIGHT)
    after = take.time >= 0
    start, end = int(np.argmax(after)), len(take) - 1
    moved = take.p_WB[end] - take.p_WB[start]
    return Gait(fell, float(moved[0]), float(moved[1]), float(heading[end] - heading[start]), _slip(take, model),
                float(take.time[end]))


def _slip(take: Take, model: RobotModel) -> float:
    """Speed of the feet's tips over the ground, weighted by their load [m/s]."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    poses = model.kinematics.forward(take.q, take.joints)
    base = Rotation.from_quat(take.quat_WB, scalar_first=True)
    tip = {"f": -0.089, "b": -0.086}
    total = load = 0.0
    for knee in FEET:
        p, R = poses[f"{knee}_link"]
        p_W = take.p_WB + base.apply(p + R @ [0, 0, tip[knee[0]]])
        speed = np.linalg.norm(np.gradient(p_W[:, :2], take.time, axis=0), axis=1)
        f = np.nan_to_num(take.contact[knee][:, 2])
        total, load = total + float(f @ speed), load + float(f.sum())
    return total / load if load else float("nan")


def try_choices(choices: Sequence[Choice], condition: Condition, seconds: float, folder: Path,
                progress: Callable[[int, int], None] | None = None) -> list[Gait]:
    """Simulates the walk for each choice under one condition. folder: where a puppy with other feet may be built."""
    table = data_file("joint_signs.csv")
    in_model = {j: s for j, (_, s) in read_signs(table).items()}
    motion = load_motion(data_file("robotis_walk.csv"))
    cycle = {j: motion.angles[:-1, i] for i, j in enumerate(motion.joints)}
    relations = mirror_relations(cycle)
    model = puppy_model(ground=Ground(friction=condition.friction, stiffness=float("inf")))
    if condition.hind_foot is not None:
        text = data_file("parts.csv").read_text(encoding="utf-8").splitlines()
        row = next(i for i, line in enumerate(text) if line.startswith("dimension,back_foot_offset"))
        cells = text[row].split(",", 4)
        text[row] = ",".join([*cells[:3], str(condition.hind_foot), cells[4]])
        parts = write_whole(folder / "parts.csv", "\n".join(text) + "\n")
        model = replace(model, description=str(build(folder / f"hind_foot_{condition.hind_foot}", parts, table)))
    commands = motion.commands(cycles=int(np.ceil(seconds / (motion.times[-1] - motion.times[0]))))
    jobs = []
    for choice in choices:
        signs = signs_of(choice, relations, in_model)
        jobs.append(Job(model, condition.config, with_signs(commands, {j: signs[j] * in_model[j] for j in JOINTS}), seconds))
    return [judge(take, model) for take in simulate_batch(jobs, progress=progress)]


def label(choice: Choice) -> str:
    """Signs of the left legs' joints and of the tail, as text."""
    return " ".join(f"{j}{'+' if s > 0 else '-'}" for j, s in zip(FREE, choice))


def main(out: Path = ROOT / "runs/studies/joint_signs") -> int:
    """Runs the study; writes every.csv, survivors.csv and joint_signs.png."""
    motion = load_motion(data_file("robotis_walk.csv"))
    relations = mirror_relations({j: motion.angles[:-1, i] for i, j in enumerate(motion.joints)})
    for joint, (relation, error, other) in relations.items():
        word = "opposite" if relation < 0 else "equal"
        print(f"{joint}: right servo {word} half a cycle later, "
              f"RMS {np.degrees(error):.2f} deg (else {np.degrees(other):.1f} deg)")
    choices = list(itertools.product((1, -1), repeat=len(FREE)))
    runs: dict[Choice, list[Gait]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        first = try_choices(choices, SCREEN, 3.0, Path(scratch), _progress("all choices, 3 s"))
        left = [c for c, g in zip(choices, first) if g.walks]
        for condition in CONDITIONS:
            for c, g in zip(left, try_choices(left, condition, 6.0, Path(scratch), _progress(condition.name))):
                runs.setdefault(c, []).append(g)
            left = [c for c in left if runs[c][-1].walks]
    ranked = sorted(runs, key=lambda c: (-sum(g.walks for g in runs[c]), float(np.mean([g.slip for g in runs[c]]))))
    write_whole(out / "every.csv", _csv(["choice", "fell", "forward_m", "left_m", "heading_deg", "slip_mm_s"], [
        [label(c), g.fell, f"{g.forward:.3f}", f"{g.left:.3f}", f"{np.degrees(g.heading):.1f}", f"{1e3 * g.slip:.1f}"]
        for c, g in zip(choices, first)]))
    write_whole(out / "survivors.csv", _csv(
        ["choice", "walks_in", "slip_mm_s",
         *(f"{c.name}: {k}" for c in CONDITIONS for k in ("fell", "forward_m", "heading_deg"))],
        [[label(c), f"{sum(g.walks for g in runs[c])}/{len(CONDITIONS)}", f"{1e3 * np.mean([g.slip for g in runs[c]]):.1f}",
          *(v for g in runs[c] for v in (g.fell, f"{g.forward:.3f}", f"{np.degrees(g.heading):.1f}")),
          *[""] * (3 * (len(CONDITIONS) - len(runs[c])))] for c in ranked]))
    _figure(out / "joint_signs.png", ranked, runs)
    for c in ranked:
        print(f"{label(c)}  walks in {sum(g.walks for g in runs[c])}/{len(CONDITIONS)}, slip "
              f"{1e3 * np.mean([g.slip for g in runs[c]]):.0f} mm/s, heading "
              + " ".join(f"{np.degrees(g.heading):.0f}" for g in runs[c]) + " deg, forward "
              + " ".join("fell" if g.fell else f"{g.forward:.2f}" for g in runs[c]) + " m")
    print(f"wrote {out}")
    return 0


def _progress(what: str) -> Callable[[int, int], None]:
    def show(done: int, total: int) -> None:
        print(f"\r{what}: {done}/{total}", end="\n" if done == total else "", file=sys.stderr, flush=True)
    return show


def _csv(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def _figure(path: Path, ranked: Sequence[Choice], runs: Mapping[Choice, Sequence[Gait]]) -> None:
    """Signs of each choice beside its slip, heading and distance, the best on top."""
    fig, (signs, slip, heading, forward) = plt.subplots(
        1, 4, figsize=(13, 0.24 * len(ranked) + 2), sharey=True, width_ratios=(1.1, 1, 1.2, 1.2), layout="constrained")
    signs.imshow([[(s + 1) / 2 for s in c] for c in ranked], cmap="coolwarm", vmin=-0.4, vmax=1.4, aspect="auto")
    for i, c in enumerate(ranked):
        for k, s in enumerate(c):
            signs.text(k, i, "+" if s > 0 else "−", ha="center", va="center", fontsize=9)
        n = sum(g.walks for g in runs[c])
        colour = "tab:blue" if n == len(CONDITIONS) else "0.6"
        standing = [g for g in runs[c] if not g.fell]
        slip.plot([1e3 * g.slip for g in runs[c]], [i] * len(runs[c]), "o", ms=4, color=colour)
        heading.plot([np.degrees(g.heading) for g in standing], [i] * len(standing), "o", ms=4, color=colour)
        forward.plot([100 * g.forward for g in standing], [i] * len(standing), "o", ms=4, color=colour)
        forward.text(1.02, i, f"{n}/{len(CONDITIONS)}", transform=forward.get_yaxis_transform(), va="center", fontsize=8,
                     color=colour)
    signs.set_xticks(range(len(FREE)), FREE)
    signs.set_yticks([])
    signs.set_title("sign, left legs and tail")
    slip.set_title("slip of loaded feet, mm/s")
    heading.axvspan(-np.degrees(TURNED), np.degrees(TURNED), color="tab:green", alpha=0.12)
    heading.set_xlim(-120, 120)
    heading.set_title("heading after 6 s, deg")
    forward.set_title("forward in 6 s, cm (took no part)")
    for ax in (slip, heading, forward):
        ax.axvline(0, color="0.8", lw=0.8)
        ax.grid(axis="x", alpha=0.3)
    signs.set_ylim(len(ranked) - 0.5, -0.5)
    fig.suptitle("Choices of joint signs that walk for 3 s, tried in six conditions until they fail; "
                 "blue: forward, no fall, no turn in all of them")
    image = io.BytesIO()
    fig.savefig(image, dpi=110)
    plt.close(fig)
    write_whole(path, image.getvalue())


if __name__ == "__main__":
    raise SystemExit(main())
