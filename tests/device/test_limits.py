"""Motions beyond the servos' limits are found, and exported only with --force."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from workbench.device import check_limits, export, read_tables
from workbench.files import InputError
from workbench.motion import Motion, PoseTable, load_motion
from workbench.recording.take import Take
from workbench.robot import COUNT, JOINTS, RobotModel, ServoConstants, data_file

WALK = load_motion(data_file("robotis_walk.csv"))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    """A body with fifteen joints of the puppy's names; flm stops at 45 degrees."""
    inertial = "<inertial><mass>0.1</mass><inertia><ixx>1e-4</ixx><iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial>"
    parts = [f"<link name='body_link'>{inertial}</link>"]
    for j in JOINTS:
        upper = math.radians(45 if j == "flm" else 150)
        limit = f"<limit><lower>-2.6</lower><upper>{upper}</upper></limit>"
        parts.append(f"<link name='{j}_link'>{inertial}</link><joint name='{j}' type='revolute'><parent>body_link</parent>"
                     f"<child>{j}_link</child><axis><xyz>0 1 0</xyz>{limit}</axis></joint>")
    path = tmp_path_factory.mktemp("model") / "robot.sdf"
    path.write_text(f"<sdf version='1.9'><model name='m'>{''.join(parts)}</model></sdf>")
    return RobotModel(description=str(path))


def take(torque: float, v: float = 0.0, seconds: float = 1.0, spike: float = 0.0) -> Take:
    """One second at rest, then `torque` on flm [N m] at joint speed `v` [rad/s], more by `spike` for two milliseconds."""
    time = np.arange(-1.0, seconds, 1e-3)
    n = len(JOINTS)
    tau, speed = np.zeros((len(time), n)), np.zeros((len(time), n))
    tau[:, 7], speed[:, 7] = torque, v
    tau[1500:1502, 7] += spike
    tau[:900, 7] = 5.0  # while it is put down; not the motion's doing
    return Take("walk", "simulation", time, JOINTS, np.zeros((len(time), n)), starts_at=0.0, torque=tau, v=speed)


def test_the_thesis_walk_is_within_every_limit(model: RobotModel) -> None:
    """Its fastest, frb at 473 counts, 52.5 rpm, is below the 54.6 rpm of 11.1 V, but above what friction leaves of them."""
    found = check_limits(WALK.as_table(), model)
    assert [(v.kind, v.joint, v.pose, v.warning) for v in found] == [("speed", "frb", 3, True)]
    assert found[0].value == pytest.approx(473 * 0.111)
    assert found[0].limit == pytest.approx((1.5 * 11.1 / 12 - 0.06) / (1.5 / 6.18 + 0.01) * 60 / (2 * math.pi))
    weaker = replace(model, servos=dict.fromkeys(JOINTS, ServoConstants(supply_voltage=10.0)))
    broken = [v for v in check_limits(WALK.as_table(), weaker) if not v.warning]
    assert [(v.joint, v.pose) for v in broken] == [("frb", 3)]
    assert broken[0].limit == pytest.approx(59.01 * 10 / 12, rel=1e-3)


def test_the_servo_law_agrees_with_the_warning(model: RobotModel) -> None:
    """Unloaded at full duty the servo settles at the speed from which the warning counts (docs/formats.md, section 4)."""
    servo, speed = ServoConstants(), 0.0
    for _ in range(2000):
        torque = servo.torque_at_full_duty - servo.back_emf * speed - servo.viscous_friction * speed - servo.coulomb_friction
        speed += 1e-3 * torque / servo.reflected_inertia
    assert check_limits(WALK.as_table(), model)[0].limit == pytest.approx(speed * 60 / (2 * math.pi), rel=1e-6)


def test_range_of_the_joint(model: RobotModel) -> None:
    def pose(angle: float) -> PoseTable:
        return Motion("m", np.array([0, 1.0]), ("flm",), np.radians([[0.0], [angle]])).as_table()

    assert check_limits(pose(45), model) == []
    found = check_limits(pose(46), model)
    assert [(v.kind, v.joint, v.pose, v.warning) for v in found] == [("position", "flm", 1, False)]
    assert found[0].limit == pytest.approx(45)
    assert check_limits(pose(-149.5), model)[0].limit == pytest.approx(math.degrees(-2.6))


def test_speed_zero_asks_for_the_travel(model: RobotModel) -> None:
    """At once: 100 counts in 100 ms are 5.1 rad/s, which it can; in 80 ms they are beyond it."""
    def jump(dwell: int) -> PoseTable:
        return PoseTable(("flm",), np.array([[512], [612]]), np.zeros((2, 1), dtype=int), np.array([dwell, dwell]))

    assert check_limits(jump(100), model) == []
    assert [v.value for v in check_limits(jump(80), model)] == pytest.approx([100 * COUNT / 0.08 * 60 / (2 * math.pi)] * 2)


@pytest.mark.parametrize(("run", "kinds"), [
    (take(0.1), []),
    (take(0.1, spike=4.0), []),  # two milliseconds of impact; its RMS is below a fifth
    (take(0.3), ["warning"]),
    (take(1.38), ["warning"]),
    (take(1.42), ["broken", "warning"]),  # stall torque at 11.1 V: 1.3875
    (take(1.0, v=2.0), ["broken", "warning"]),  # at 2 rad/s the line leaves 0.902
    (take(0.88, v=2.0), ["warning"]),
    (take(1.9, v=-2.0), ["warning"]),  # driven backwards, back-EMF and friction help to hold: 1.953
    (take(2.0, v=-2.0), ["broken", "warning"]),
])
def test_torque_in_simulation(run: Take, kinds: list[str], model: RobotModel) -> None:
    slow = PoseTable(("flm",), np.array([[512], [522]]), np.array([[10], [10]]), np.array([500, 500]))
    found = check_limits(slow, model, run)
    assert [v.kind for v in found] == ["torque"] * len(kinds)
    assert ["warning" if v.warning else "broken" for v in found] == kinds


def test_unknown_joints(model: RobotModel) -> None:
    other = PoseTable(("wing",), np.array([[512]]), np.array([[1]]), np.array([100]))
    with pytest.raises(InputError, match="no joint 'wing'"):
        check_limits(other, model)
    run = take(0.1)
    with pytest.raises(InputError, match="lacks joint 'blb'"):
        check_limits(WALK.as_table(), model, replace(run, joints=("flm",), torque=run.torque[:, 7:8], v=None))  # type: ignore[index]
    with pytest.raises(InputError, match="holds no torque"):
        check_limits(WALK.as_table(), model, replace(run, torque=None))


def test_export_refuses_unless_forced(model: RobotModel, tmp_path: Path) -> None:
    too_fast = replace(WALK, times=WALK.times * 0.8, source="fast.csv")
    with pytest.raises(InputError, match=r"fast.csv: pose 3, joint blm: moving speed 532 is 59.1 rpm.* \(and 2 more\)"):
        export(too_fast, model, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    forced = export(too_fast, model, tmp_path / "out", force=True)
    assert [v.joint for v in forced.violations if not v.warning] == ["blm", "flb", "frb"]
    assert np.array_equal(read_tables(tmp_path / "out").speeds, too_fast.as_table().speeds)
    with pytest.raises(InputError, match="outside 0 to 1023"):
        export(replace(WALK, times=WALK.times / 4), model, tmp_path / "out", force=True)
    fair = export(WALK, model, tmp_path / "fair", take(0.1))
    assert {f.name for f in fair.files} == {"pos.txt", "speed.txt", "timeDiff.txt", "motion.h", "motion.table"}
    assert all(v.warning for v in fair.violations)


def test_export_to_a_folder_that_cannot_be_written(model: RobotModel, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        export(WALK, model, tmp_path / "file" / "out")
