"""Makes the recording that ships in data/synthetic_walk: python -m studies.other_engine.synthetic_walk [FOLDER]"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import mujoco
import numpy as np
import yaml

from studies.other_engine.capture import Camera
from studies.other_engine.excitation import MotionRows
from studies.other_engine.firmware import read_rows
from studies.other_engine.make_session import TakePlan, record, servo_yaml, session_entry
from studies.other_engine.motive_file import write_motive_csv
from workbench.files.reading import write_together
from workbench.robot import data_file, puppy_model

SEED = 2020
CYCLES = 13
"""Six seconds of walking, as long as the thesis's runs."""
CAMERA = Camera(yaw=float(np.deg2rad(12.0)), origin=(0.04, 0.0, -0.06), gaps=0.2)

README = """# A synthetic recording

`walk.csv` is not a recording of a robot. It is the puppy of models/sdf/puppy in another engine, filmed there as OptiTrack
would: Motive CSV 1.23, 120 Hz, {assets} rigid bodies, {frames} frames. It is here so that `workbench demo` and the tests have
something to compare with. Made by `python -m studies.other_engine.synthetic_walk`; do not edit.

- Engine: MuJoCo {mujoco}, step 0.5 ms, with servo, firmware and contact code of its own (studies/other_engine).
- Motion: the ROBOTIS walk (../robotis_walk.csv), {cycles} cycles, six seconds. Nominal AX-12A at {voltage} V.
- Hidden physics: none. Model and constants are the workbench's own. What differs is the engine: its contact is a linear
  spring and damper of the same stiffness and nearly the same dissipation, its friction cone and its steps are its own.
- Seed {seed}. Rotation noise {rotation:.2f} deg and position noise {position:.1f} mm (standard deviation, each axis), a few
  gaps. First command at {starts_at} s, the robot's first heading {yaw:.0f} deg to the left of the capture's x axis.
- The truth without noise: {travel:.1f} cm walked, heading {heading:.1f} deg (positive to the left).
- sha256 of the puppy.sdf that it was made with: {sha256}
"""


def make(folder: Path) -> None:
    """Writes walk.csv, session.yaml, servo.yaml and README.md into `folder`."""
    model = puppy_model()
    walk = MotionRows(*read_rows(data_file("robotis_walk.csv")))
    rollout, capture, _ = record(model, TakePlan("walk", walk, CYCLES, "free"), CAMERA, np.random.default_rng(SEED))
    p, R = rollout.poses(np.array([0.0, rollout.time[-1]]), (model.base,))[model.base]
    ahead = R[1] @ R[0].T
    readme = README.format(
        assets=len(capture.p), frames=len(capture), mujoco=mujoco.__version__, cycles=CYCLES,
        voltage=model.servo(model.joints[0]).supply_voltage, seed=SEED, rotation=np.rad2deg(CAMERA.rotation_noise),
        position=CAMERA.position_noise * 1e3, starts_at=capture.starts_at, yaw=np.rad2deg(CAMERA.yaw),
        travel=100 * np.linalg.norm((p[1] - p[0])[:2]), heading=np.rad2deg(np.arctan2(ahead[1, 0], ahead[0, 0])),
        sha256=hashlib.sha256(model.path.read_bytes()).hexdigest())
    take = {"name": "walk", "motion": "../robotis_walk.csv", "cycles": CYCLES, "recording": "walk.csv", "base": "free"}
    session = session_entry(model, model.description, "servo.yaml") | {"takes": [take]}
    write_motive_csv(folder / "walk.csv", capture, "walk", digits=5)
    write_together(folder, {"session.yaml": yaml.safe_dump(session, sort_keys=False), "servo.yaml": servo_yaml(model),
                            "README.md": readme})


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else data_file("synthetic_walk")
    make(target)
    print(f"wrote {target}")
