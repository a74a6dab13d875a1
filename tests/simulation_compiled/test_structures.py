"""Tables of a robot whose structure is known equal those that Drake parses, for every number that is written into them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from workbench.effects.apply import physics_of
from workbench.robot import EffectSpec, RobotModel, puppy_model
from workbench.simulation.compiled import structures
from workbench.simulation.compiled.tables import Tables, read_tables

ARM = Path(__file__).parents[2] / "data/tutorial_arm/robot.sdf"
Parameters = dict[str, float | tuple[float, float, float]]
CHANGES: dict[str, tuple[Parameters, Parameters]] = {
    "payload": ({"mass": 0.05, "position": (0.01, 0.02, -0.03)}, {"mass": 0.11, "position": (0.0, -0.01, 0.02)}),
    "com_shift": ({"offset": (0.01, 0.0, 0.0)}, {"offset": (-0.004, 0.003, 0.002)}),
    "backlash": ({"gap": 1.0}, {"gap": 2.5}),
    "joint_compliance": ({"stiffness": 8.0}, {"stiffness": 31.0}),
    "parallel_spring": ({"stiffness": 0.3}, {"stiffness": 0.7}),
    "joint_stop": ({"lower": -20.0, "upper": 30.0}, {"lower": -11.0, "upper": 17.0}),
}
"""What changes a number of a description alone, in two sizes."""


@pytest.fixture(params=["arm", "puppy"])
def robot(request: pytest.FixtureRequest) -> RobotModel:
    return puppy_model() if request.param == "puppy" else RobotModel(str(ARM), base="base")


@pytest.mark.parametrize("effect", CHANGES)
def test_numbers_are_written_as_drake_reads_them(robot: RobotModel, effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    joint = robot.joints[-1]
    where = robot.kinematics.frames[joint].child if effect in ("payload", "com_shift") else joint
    one, other = (robot.with_effect(EffectSpec(effect, (where,), p)) for p in CHANGES[effect])
    parsed = []

    def counted(model: RobotModel, description: str | None, free: bool) -> Tables:
        parsed.append(model)
        return read_tables(model, description, free)

    monkeypatch.setattr(structures, "read_tables", counted)
    free = not robot.kinematics.fixed_to_world
    first = structures.tables_of(one, physics_of(one).build, free)
    written = structures.tables_of(other, physics_of(other).build, free)
    assert len(parsed) <= 1
    read = read_tables(other, physics_of(other).description, free)
    assert written.joints == read.joints
    for name, of_drake in read.tree._asdict().items():
        np.testing.assert_allclose(getattr(written.tree, name), of_drake, rtol=1e-14, atol=1e-18, err_msg=name)
    assert any(not np.array_equal(getattr(first.tree, n), getattr(written.tree, n)) for n in first.tree._fields)


def test_another_axis_is_another_structure() -> None:
    robot = RobotModel(str(ARM), base="base")
    said: list[Parameters] = [{"play": 1.0, "axis": axis} for axis in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8))]
    found = []
    for parameters in said:
        model = robot.with_effect(EffectSpec("loose_mount", (robot.joints[0],), parameters))
        found.append(structures.tables_of(model, physics_of(model).build, False).tree.axis)
    axes = {tuple(a.ravel().round(6)) for a in found}
    assert len(axes) == 3
