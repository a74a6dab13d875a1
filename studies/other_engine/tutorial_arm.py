"""Makes the data of the tutorial, data/tutorial_arm: python -m studies.other_engine.tutorial_arm [FOLDER]

A small arm of three bus servos in another engine, with a hidden dry friction in its elbow, logged as its servos would: 100 rows a
second, counts of 4096 to the turn, noise. Not a recording of a robot; the truth is in its README.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
import yaml

from studies.concealed_effects.robots import arm
from studies.concealed_effects.takes import LogPlan, log_csv, log_rows, logged_takes, play_log
from workbench.files.reading import write_together
from workbench.robot import EffectSpec, data_file

SEED = 7
HIDDEN = EffectSpec("coulomb_friction", ("elbow",), {"torque": 0.12})
STEP = 5e-4
"""Of the other engine [s]."""
MOUNT = '<joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>'
"""The arm stands on a table; the other engine holds its base without help."""
KEPT = {"slow": 5.0, "steps": 5.0}
"""Takes that ship, cut to so many seconds."""
README = """# The tutorial's data

Not recordings of a robot: a small arm in MuJoCo {mujoco} (step {step:g} ms), logged as three bus servos would log themselves, at
100 rows a second in counts of 4096 to the turn. Made by `python -m studies.other_engine.tutorial_arm`; do not edit.

Hidden, for the tutorial to find: dry friction of {torque:g} N m in the elbow, beyond the nominal {nominal:g}. Seed {seed}.
"""


def make(folder: Path) -> None:
    """Writes robot.sdf, servo.yaml, session.yaml, takes/ and README.md into `folder`."""
    rng = np.random.default_rng(SEED)
    robot = arm(rng)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.sdf").write_text(robot.sdf, encoding="utf-8")
    model = robot.model(folder / "robot.sdf")
    worn = model.with_effect(HIDDEN)
    files, takes = {}, []
    for plan in logged_takes(model, rng):
        if plan.name not in KEPT:
            continue
        short = plan.time < KEPT[plan.name]
        plan = LogPlan(plan.name, plan.time[short], plan.joints, plan.goals[short])
        position, _ = log_rows(play_log(worn, plan, STEP, chance=1), plan, rng)
        files[f"{plan.name}.csv"] = log_csv(plan, position)
        takes.append({"name": plan.name, "recording": f"takes/{plan.name}.csv", "base": "fixed"})
    servo = {k: v for k, v in vars(robot.servo).items() if isinstance(v, (float, str))}
    session = {"format": 1, "robot": {"model": "robot.sdf", "base": "base", "servos": "servo.yaml"}, "takes": takes}
    (folder / "robot.sdf").write_text(robot.sdf.replace("</model>", f"{MOUNT}\n</model>"), encoding="utf-8")
    write_together(folder / "takes", files)
    write_together(folder, {
        "servo.yaml": yaml.safe_dump(servo, sort_keys=False), "session.yaml": yaml.safe_dump(session, sort_keys=False),
        "README.md": README.format(mujoco=mujoco.__version__, step=1e3 * STEP, torque=HIDDEN.parameters["torque"],
                                   nominal=robot.servo.coulomb_friction, seed=SEED)})


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else data_file("tutorial_arm")
    make(target)
    print(f"wrote {target}")
