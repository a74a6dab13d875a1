"""Robots that play together, a lane of the processor's vectors each, against each of them alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.simulation_compiled.test_compiled_touching import pressing
from workbench.compare.session import load_session
from workbench.motion.commands import Commands
from workbench.motion.files import load_motion
from workbench.robot import EffectSpec, RobotModel, data_file, puppy_model
from workbench.robot.torque_table import TorqueTable
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.compiled.lanes import together
from workbench.simulation.compiled.number import LANES
from workbench.simulation.steady import JointStates

SAME = 1e-12
"""[rad]"""
CONFIG = SimulationConfig(base="fixed", settle=0.02, time_step=2e-3, engine="compiled")
TIMES = np.arange(0.0, 1.5, 0.0103)


@dataclass
class Calls:
    """How often lanes were played, and how many robots were played alone."""

    lanes: int = 0
    alone: int = 0


@pytest.fixture
def calls(monkeypatch) -> Calls:
    seen = Calls()
    play, alone = together.play_lanes, together._alone

    def lanes(*arguments):
        seen.lanes += 1
        play(*arguments)

    lanes.stats = play.stats

    def one(*arguments):
        seen.alone += 1
        return alone(*arguments)

    monkeypatch.setattr(together, "play_lanes", lanes)
    monkeypatch.setattr(together, "_alone", one)
    return seen


@pytest.fixture(scope="module")
def arm() -> RobotModel:
    return load_session(data_file("tutorial_arm") / "session.yaml").model


def swings(arm: RobotModel, size: float = 0.6, enabled: bool = True) -> Commands:
    """Goals between the steps, at several speeds, a servo off for a while where that is wanted."""
    times = np.arange(0.0, 1.4, 0.0337)
    n = len(arm.joints)
    goals = size * np.sin(times[:, None] * np.array([5.0, 8.0, 11.0])[:n])
    on = np.ones(goals.shape, dtype=bool)
    on[10:14, 1] = enabled
    speeds = np.where(np.arange(n) == 1, 3.0, 0.0) + np.zeros(goals.shape)
    return Commands(times, arm.joints, goals, speeds, on, 1.5, np.full(len(times), -1))


def worn(arm: RobotModel, *effects: tuple[str, dict[str, float]], joint: int = 1) -> RobotModel:
    for name, numbers in effects:
        whole = name in ("supply_sag", "ground_tilt", "thermal_fade")
        arm = arm.with_effect(EffectSpec(name, () if whole else (arm.joints[joint],), numbers))
    return arm


def jobs_of(models, commands: Commands, restarts: JointStates | None = None) -> list[Job]:
    return [Job(m, CONFIG, commands, 1.5, 0.1, times=TIMES, restarts=restarts) for m in models]


def largest_difference(jobs: list[Job]) -> float:
    """Between robots that play together and the same alone, after a check that they differ."""
    side_by_side, alone = servo_angles([[job] for job in jobs]), servo_angles([[job] for job in jobs], in_lanes=False)
    assert np.nanmax(np.ptp([q for (q,) in alone], axis=0)) > 1e-4
    return max(float(np.nanmax(np.abs(a - b))) for (a,), (b,) in zip(side_by_side, alone))


def of_several_kinds(arm: RobotModel) -> list[RobotModel]:
    """Each with an effect that the lanes' servo law has a formula for."""
    return [arm, *(worn(arm, *effects) for effects in (
        [("coulomb_friction", {"torque": 0.1})], [("stribeck_friction", {"torque": 0.1, "speed": 30.0})],
        [("load_friction", {"coefficient": 0.2, "static": 0.2, "speed": 30.0, "backdrive": 0.1})],
        [("friction_asymmetry", {"ratio": 1.6}), ("coulomb_friction", {"torque": 0.1})],
        [("supply_sag", {"drop": 1.0})], [("torque_ceiling", {"torque": 0.3})], [("torque_saturation", {"torque": 0.5})],
        [("command_filter", {"time": 0.03})], [("goal_ramp", {"speed": 100.0})], [("damping_gain", {"gain": 0.05})],
        [("zero_offset", {"angle": 3.0})], [("minimum_duty", {"duty": 0.05})], [("dead_band", {"margin": 1.0})],
        [("reflected_inertia", {"inertia": 0.002})], [("viscous_friction", {"coefficient": 0.05})],
        [("parallel_spring", {"stiffness": 0.5})], [("joint_stop", {"lower": -20.0, "upper": 15.0})],
        [("thermal_fade", {"rate": 0.2})]))]


def test_robots_with_links_of_other_lengths_play_together(arm, calls):
    """Drake parses each, but their trees have the same branches."""
    link = arm.kinematics.frames[arm.joints[1]].child
    models = [arm, *(arm.with_effect(EffectSpec("link_length", (link,), {"change": change})) for change in (-0.02, 0.01, 0.02))]
    assert largest_difference(jobs_of(models, swings(arm))) < SAME
    assert calls.lanes == 2  # settling, and the run


@pytest.mark.parametrize("enabled", [True, False], ids=["on", "one servo off"])
def test_robots_with_other_effects_play_in_lanes_as_each_does_alone(arm, calls, enabled):
    models = of_several_kinds(arm)
    assert largest_difference(jobs_of(models, swings(arm, enabled=enabled))) < SAME
    assert calls.lanes >= 2 * (len(models) // LANES)  # settling, and the run
    assert calls.alone == len(models)  # each for comparison


def test_robots_with_play_are_put_back_in_lanes_as_each_is_alone(arm, calls):
    gaps = [worn(arm, ("backlash", {"gap": g}), ("coulomb_friction", {"torque": 0.02 * g})) for g in (0.5, 1.0, 2.0, 4.0)]
    q = 0.1 * np.ones((2, len(arm.joints)))
    q[1, 0] = np.nan  # nothing was seen of this joint there
    back = JointStates(np.array([0.4, 0.8]), q, 2.0 * q)
    assert largest_difference(jobs_of(gaps, swings(arm), back)) < SAME
    assert calls.lanes == 2


def test_robots_whose_servos_hear_goals_later_play_together(arm, calls):
    """A fit moves the delay of every servo, so that hardly two robots hear their goals in the same step."""
    late = [arm.with_physics({j: arm.servo(j).updated({"goal_delay": delay, "command_filter": 0.01 * (k % 2)})
                              for j, delay in zip(arm.joints, (0.003 * k, 0.02 - 0.002 * k))}, ()) for k in range(LANES)]
    assert largest_difference(jobs_of(late, swings(arm))) < SAME
    assert calls.lanes == 2


def test_robots_with_torque_tables_play_alone(arm, calls):
    tables = [TorqueTable("angle", (-1.0, 0.0, 1.0), (size, -size, size)) for size in (0.05, 0.1, 0.15)]
    models = [arm.with_servos({"torque_tables": (table,)}) for table in tables]
    assert largest_difference(jobs_of(models, swings(arm))) == 0.0
    assert calls.lanes == 0


def test_who_plays_along_changes_no_bit(arm):
    """Else results would depend on the number of workers, and on where a run that was killed is resumed."""
    jobs = jobs_of(of_several_kinds(arm), swings(arm))
    together_, one_by_one = servo_angles([[job] for job in jobs]), [servo_angles([[job]])[0] for job in jobs]
    for (a,), (b,) in zip(together_, one_by_one):
        np.testing.assert_array_equal(a, b)


def rubbing(model: RobotModel) -> list[RobotModel]:
    return [worn(model, ("coulomb_friction", {"torque": t}), joint=4) for t in (0.0, 0.02, 0.05)]


def test_legs_that_stay_apart_play_in_lanes(calls):
    robot = puppy_model()
    jobs = jobs_of(rubbing(robot), load_motion(data_file("robotis_walk.csv"), robot).commands(1))
    assert largest_difference(jobs) < SAME
    assert (calls.lanes, calls.alone) == (2, len(jobs))


def test_legs_that_touch_play_alone(calls):
    job = pressing("fixed", duration=1.2, lead=0.1, times=np.arange(0.0, 1.2, 0.01))
    jobs = [replace(job, model=m) for m in rubbing(job.model)]
    assert largest_difference(jobs) < SAME
    assert (calls.lanes, calls.alone) == (2, 2 * len(jobs))
