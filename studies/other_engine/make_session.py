"""Makes a whole session of recordings from a seed: python -m studies.other_engine.make_session OUT [--seed N]

The folder has a user's files (session.yaml, motions, takes, starts of the takes to predict) and, in answer/,
the judge's: the takes to predict, the same without noise, and the truth.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from studies.other_engine.capture import Camera, Capture, film, pivots_for
from studies.other_engine.excitation import MotionRows, stand_motion, sway_motion, varied_walk
from studies.other_engine.firmware import commands_from_rows, read_rows
from studies.other_engine.hidden import turned_frames
from studies.other_engine.motive_file import write_motive_csv
from studies.other_engine.player import Rollout, play
from workbench.robot import RobotModel, ServoConstants, data_file, load_servo_constants, puppy_model

REST_AFTER = 0.5
"""Duration of a recording after the last command's dwell [s]."""


@dataclass(frozen=True)
class TakePlan:
    """One take: a motion, how often, on which base, and whether it is to be predicted."""

    name: str
    motion: MotionRows
    cycles: int
    base: str
    predict: bool = False


def plan_takes(walk: MotionRows, rng: np.random.Generator) -> list[TakePlan]:
    """Stand, sway and walk to learn from; another walk and another stand to foretell."""
    return [
        TakePlan("stand", stand_motion(walk, rng), 1, "fixed"),
        TakePlan("sway", sway_motion(walk, rng), 1, "free"),
        TakePlan("walk", walk, 10, "free"),
        TakePlan("hidden_walk", varied_walk(walk), 8, "free", predict=True),
        TakePlan("hidden_stand", stand_motion(walk, rng, amplitude=0.8), 1, "fixed", predict=True),
    ]


def random_camera(rng: np.random.Generator, gaps: float = 0.3) -> Camera:
    """A camera that was set down somewhere: the robot's heading within 30 degrees of its x axis."""
    x, z = rng.uniform(-0.1, 0.1, 2)
    return Camera(yaw=float(rng.uniform(-0.5, 0.5)), origin=(float(x), 0.0, float(z)), gaps=gaps)


def record(
    model: RobotModel, plan: TakePlan, camera: Camera, rng: np.random.Generator, timestep: float = 5e-4
) -> tuple[Rollout, Capture, Capture]:
    """Plays and films one take: the run, the recording, and the same recording without noise and gaps."""
    starts_at = round(float(rng.uniform(0.25, 0.6)), 5)
    commands = commands_from_rows(plan.motion.joints, plan.motion.times, plan.motion.angles, plan.cycles)
    duration, lead = commands.end + REST_AFTER, starts_at + 2 * timestep
    rollout = play(model, commands, duration, lead, plan.base, timestep, chance=int(rng.integers(2**31)))
    pivots, turned = pivots_for(rollout, model.rigid_bodies, rng), turned_frames(model)
    clean = film(rollout, model.rigid_bodies, pivots, camera.noiseless(), starts_at, rng, turned)
    return rollout, film(rollout, model.rigid_bodies, pivots, camera, starts_at, rng, turned), clean


def session_entry(model: RobotModel, robot: str, servos: str) -> dict[str, object]:
    """The head of a session.yaml for a model whose SDF and servo constants are at these paths."""
    ground = {k: v for k, v in asdict(model.ground).items() if v is not None and np.isfinite(v)}
    return {
        "format": 1,
        "robot": {"model": robot, "base": model.base, "servos": servos, "rigid_bodies": dict(model.rigid_bodies)},
        "ground": ground,
    }


def servo_yaml(model: RobotModel) -> str:
    """servo.yaml of a robot whose servos are all equal; ValueError if they are not."""
    kinds = {model.servo(j) for j in model.joints}
    if len(kinds) != 1:
        raise ValueError("expected one kind of servo for all joints")
    return yaml.safe_dump(kinds.pop().as_dict(), sort_keys=False)


def make_session(out: Path, model: RobotModel, walk: MotionRows, seed: int, gaps: float = 0.3) -> None:
    """Writes the session folder `out`, whole or not at all; FileExistsError if it is there. Same seed, same bytes.

    ValueError for a model with effects: this session is one with nothing hidden.
    """
    if model.effects:
        raise ValueError(f"expected a nominal robot, got the effect '{model.effects[0].effect}'")
    if out.exists():
        raise FileExistsError(f"{out}: exists already")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as temporary:
        folder = Path(temporary) / out.name
        _write_session(folder, model, walk, seed, gaps)
        os.replace(folder, out)


def _write_session(folder: Path, model: RobotModel, walk: MotionRows, seed: int, gaps: float) -> None:
    rng = np.random.default_rng(seed)
    camera = random_camera(rng, gaps)
    truth = {}
    for plan, rollout, capture, clean in write_recordings(folder, model, model, plan_takes(walk, rng), camera, rng):
        truth[plan.name] = _truth(rollout, plan, capture)
        if plan.predict:
            write_motive_csv(folder / f"answer/{plan.name}.nominal.csv", clean, plan.name)
    answer = {"name": "nothing_hidden", "effects": [], "seed": seed, "takes": truth}
    (folder / "answer/truth.json").write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")


def write_recordings(folder: Path, model: RobotModel, hidden: RobotModel, plans: Sequence[TakePlan], camera: Camera,
                     rng: np.random.Generator) -> list[tuple[TakePlan, Rollout, Capture, Capture]]:
    """Writes a session of a model, with recordings of the robot `hidden`, and the recordings that are to be predicted under
    answer/. Returns each plan with what `record` made of it."""
    for sub in ("motions", "takes", "predict", "answer"):
        (folder / sub).mkdir(parents=True)
    shipped = model.description.startswith("package://")
    if not shipped:
        shutil.copyfile(model.path, folder / "robot.sdf")
    (folder / "servo.yaml").write_text(servo_yaml(model), encoding="utf-8")
    session = session_entry(model, model.description if shipped else "robot.sdf", "servo.yaml")
    takes, predict, made = [], [], []
    for plan in plans:
        rollout, capture, clean = record(hidden, plan, camera, rng)
        made.append((plan, rollout, capture, clean))
        motion = f"{'predict' if plan.predict else 'motions'}/{plan.name}.csv"
        (folder / motion).write_text(plan.motion.to_csv(), encoding="utf-8")
        entry: dict[str, object] = {"name": plan.name, "motion": motion, "cycles": plan.cycles}
        if plan.predict:
            # The start ends before the first command, so that it tells nothing of what is to be foretold.
            start = capture.cut(int(capture.starts_at * capture.rate) - 2)
            write_motive_csv(folder / f"predict/{plan.name}_start.csv", start, plan.name, frames_in_take=len(capture))
            write_motive_csv(folder / f"answer/{plan.name}.csv", capture, plan.name)
            entry |= {"start": f"predict/{plan.name}_start.csv", "starts_at": capture.starts_at, "frames": len(capture)}
            predict.append(entry | {"base": plan.base})
        else:
            write_motive_csv(folder / f"takes/{plan.name}.csv", capture, plan.name)
            takes.append(entry | {"recording": f"takes/{plan.name}.csv", "base": plan.base})
    text = yaml.safe_dump(session | {"takes": takes, "predict": predict}, sort_keys=False)
    (folder / "session.yaml").write_text(text, encoding="utf-8")
    return made


def _truth(rollout: Rollout, plan: TakePlan, capture: Capture) -> dict[str, object]:
    root = rollout.model.body(1).name
    p, R = rollout.poses(np.array([0.0, rollout.time[-1]]), (root,))[root]
    truth: dict[str, object] = {
        "duration": float(rollout.time[-1]),
        "fell": bool(R[1, 2, 2] < 0.5),
        "travel": float(np.linalg.norm((p[1] - p[0])[:2])),
    }
    # What the judge's score takes for the first command of a take to foretell.
    return truth | {"lead": capture.starts_at} if plan.predict else truth


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robot", type=Path, help="SDF of a robot with the puppy's names (default: the puppy)")
    parser.add_argument("--servos", type=Path, help="servo.yaml (default: AX-12A)")
    parser.add_argument("--walk", type=Path, default=data_file("robotis_walk.csv"), help="motion table to walk by")
    parser.add_argument("--friction", type=float, help="of foot on ground (default: the model's)")
    parser.add_argument("--gaps", type=float, default=0.3, help="mean number of gaps of each rigid body per take")
    args = parser.parse_args()
    model = puppy_model()
    if args.robot is not None:
        model = RobotModel(description=str(args.robot), rigid_bodies=model.rigid_bodies, ground=model.ground)
    servo = ServoConstants() if args.servos is None else load_servo_constants(args.servos)
    model = replace(model, servos=dict.fromkeys(model.joints, servo))
    if args.friction is not None:
        model = replace(model, ground=replace(model.ground, friction=args.friction))
    make_session(args.out, model, MotionRows(*read_rows(args.walk)), args.seed, args.gaps)
    print(f"wrote {args.out}")


if __name__ == "__main__":
    main()
