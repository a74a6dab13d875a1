"""From a shape to counts and milliseconds."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.api.robots import load_model
from workbench.device.tables.firmware_tables import read_tables, write_tables
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.evaluate import table_sha256
from workbench.gait.limits import GaitLimits, binding, contact_margin, table_margins, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import FAMILIES, GaitShape, foot_path
from workbench.gait.table import gait_table
from workbench.motion import Motion, load_motion
from workbench.motion.files import motion_text
from workbench.robot import COUNT, puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch

TROT = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)


@pytest.fixture(scope="module")
def machine():
    return GaitMachine(puppy_model())


@pytest.mark.parametrize("family", FAMILIES)
def test_feet_on_the_ground_go_straight_back_by_what_the_body_advances(machine, family):
    shape = GaitShape(family, poses=40, stride=0.06, side=0.01, turn=0.2, duty=0.7)
    path = foot_path(shape, machine.legs, shape.phases)
    assert path.stance.mean() == pytest.approx(0.7, abs=0.04)
    for i, leg in enumerate(machine.legs):
        down = path.stance[:, i] & np.roll(path.stance[:, i], 1)
        step = np.diff(path.p[:, i], axis=0, prepend=path.p[-1:, i])[down]
        per_phase = step * shape.poses * shape.duty
        middle = np.mean([other.neutral for other in machine.legs], axis=0)
        x, y = (leg.neutral - middle)[:2]
        np.testing.assert_allclose(per_phase[:, 0], -(0.06 - 0.2 * y), atol=1e-9)
        np.testing.assert_allclose(per_phase[:, 1], -(0.01 + 0.2 * x), atol=1e-9)
        assert np.ptp(path.p[path.stance[:, i], i, 2]) < 1e-12
        assert path.p[:, i, 2].max() - path.p[path.stance[:, i], i, 2].min() == pytest.approx(shape.lift, rel=0.05)


def test_a_table_holds_the_angles_rounded_and_no_speed_beyond_the_servos(machine):
    table = gait_table(machine, replace(TROT, lead=0.0))
    assert np.abs(table.cycle.angles() - table.asked).max() <= COUNT / 2 + 1e-12
    assert abs(int(table.cycle.dwells_ms.sum()) - 1000 / 2.2) <= 0.5
    assert (table.cycle.speeds <= machine.fastest).all()
    assert table.start.angles()[0].any()
    assert not table.stop.angles()[-1].any()
    assert table.reach.max() < 1e-6


def test_the_inverse_servo_law_brings_joints_nearer_to_their_path(machine):
    """Angles reached at the poses' ends, over the last two of five cycles, against those asked."""
    off = {}
    for lead in (0.0, 1.0):
        table = gait_table(machine, replace(TROT, lead=lead))
        take = simulate_batch([Job(machine.model, SimulationConfig(time_step=2e-3), table.commands(5))])[0]
        ends = table.start_seconds + 3 * table.period + np.cumsum(np.tile(table.cycle.dwells_ms, 2)) / 1000
        reached = np.array([np.interp(ends, take.time, q) for q in take.q.T]).T
        legs = [machine.model.joints.index(j) for leg in machine.legs for j in leg.joints[1:]]
        off[lead] = float(np.sqrt(np.mean((reached - np.tile(table.asked, (2, 1)))[:, legs] ** 2)))
    assert off[1.0] < 0.75 * off[0.0]


def test_the_table_goes_through_file_and_firmware_bytes_and_gives_the_same_rollout_to_the_bit(machine, tmp_path):
    table = gait_table(machine, TROT)
    (tmp_path / "gait.csv").write_text(motion_text(Motion.from_table(table.whole), "made here"))
    written = load_motion(tmp_path / "gait.csv", machine.model).as_table()
    write_tables(written, tmp_path / "firmware")
    decoded = read_tables(tmp_path / "firmware")
    assert table_sha256(decoded) == table_sha256(table.whole)
    takes = simulate_batch([Job(machine.model, SimulationConfig(time_step=2e-3), t.commands(2)) for t in (table.whole, decoded)])
    for field in ("q", "v", "p_WB", "quat_WB", "torque"):
        np.testing.assert_array_equal(*(getattr(t, field) for t in takes))


def test_each_limit_of_the_table_is_told_by_name(machine):
    limits = GaitLimits()
    kept = table_margins(machine, gait_table(machine, TROT), limits)
    assert violation(kept) == 0.0
    heights = [gait_table(machine, replace(TROT, lead=0.0, crouch=c)) for c in (0.04, -0.02)]
    high = [binding(table_margins(machine, table, limits)) for table in heights]
    assert [m.name for m in high] != ["reach", "reach"]
    assert high[1].name == "reach"
    assert high[1].use > 1
    bent = binding(table_margins(machine, gait_table(machine, replace(TROT, crouch=0.09, lead=0.0)), limits))
    assert (bent.name, bent.use > 1) == ("range", True)


def test_the_controllers_memory_is_a_limit_where_its_program_plays_the_servos(machine):
    """A table of 4096 bytes: 60 poses of the puppy's 15 joints, those of start and stop too. The fox has another family's servos,
    which it cannot play."""
    table = gait_table(machine, replace(TROT, poses=19, frequency=0.5, lead=0.0))
    (poses,) = [m for m in table_margins(machine, table, GaitLimits()) if m.name == "poses"]
    assert (len(table.start), len(table.cycle), len(table.stop)) == (21, 19, 21)
    assert (poses.value, poses.limit, poses.use > 1) == (61, 60, True)
    short = gait_table(machine, replace(TROT, poses=18, frequency=0.5, lead=0.0))
    assert [m.value for m in table_margins(machine, short, GaitLimits()) if m.name == "poses"] == [58]
    fox = GaitMachine(load_model("fox"))
    assert "poses" not in [m.name for m in table_margins(fox, gait_table(fox, replace(TROT, poses=59, lead=0.0)), GaitLimits())]


def test_links_that_come_near_each_other_are_named(machine):
    tables = [gait_table(machine, TROT), gait_table(machine, replace(TROT, spread=-0.0575, lead=0.0))]
    apart, inward = (contact_margin(machine.self_contact.nearest(t.asked), GaitLimits()) for t in tables)
    assert apart.use < 1 < inward.use
    assert inward.value < 2 == inward.limit  # mm, at least
    assert "link" in inward.where


def test_pages_say_that_speeds_are_the_models():
    assert "15.6" in PUPPY_CLAIM
    assert "37" in PUPPY_CLAIM
