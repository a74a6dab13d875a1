"""The recordings as a session: robot.sdf, servos and session.yaml, takes that name their programme, the split as `use`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from studies.so101.programmes import FILE, VALIDATION
from studies.so101.robot import BASE, arm_sdf, servo, servo_yaml
from workbench.files.reading import write_together
from workbench.files.yaml_file import yaml_text
from workbench.recording.formats.sage import JOINTS

URDF = "so101_inertias_only.urdf"


def write_session(data: Path, out: Path, names: Sequence[str], jaw_range: float, name: str = "session.yaml") -> Path:
    """Writes robot, servos and the session of some programmes into `out`; returns the session's path."""
    servos = dict.fromkeys(JOINTS, "servo.yaml") | {"Jaw": "servo_jaw.yaml"}
    source = os.path.relpath(data / FILE, out)
    takes = [{"name": n, "recording": f"{source}#{n}", "base": "fixed", "use": "validate" if n in VALIDATION else "fit"}
             for n in names]
    content = {"format": 1, "robot": {"model": "robot.sdf", "base": BASE, "servos": servos}, "takes": takes}
    write_together(out, {"robot.sdf": arm_sdf(data / URDF), "servo.yaml": servo_yaml(servo()),
                         "servo_jaw.yaml": servo_yaml(servo(round(jaw_range, 4))), name: yaml_text(content)})
    return out / name
