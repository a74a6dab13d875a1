"""Inverse dynamics against closed-form solutions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.quadruped import quadruped_sdf
from workbench.dynamics import InverseDynamics, RobotTrajectory
from workbench.dynamics.contact import STICKING, project, share_forces
from workbench.dynamics.margins import motor_torque, servo_load, speed_margin, torque_margin
from workbench.files import InputError
from workbench.motion import Motion
from workbench.robot import Ground, RobotModel, ServoConstants

G = 9.81
RISE = np.array([0, 0, 0.1])
MASS, LENGTH, INERTIA = 0.3, 0.12, 4e-4
PENDULUM = f"""<sdf version="1.9"><model name="pendulum">
<link name="stand"><inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia></inertial></link>
<link name="arm"><pose>0 0 0.5 0 0 0</pose><inertial><pose>0 0 {-LENGTH} 0 0 0</pose><mass>{MASS}</mass>
<inertia><ixx>{INERTIA}</ixx><iyy>{INERTIA}</iyy><izz>{INERTIA}</izz></inertia></inertial></link>
<joint name="swing" type="revolute"><parent>stand</parent><child>arm</child><axis><xyz>0 1 0</xyz>
<limit><lower>-3</lower><upper>3</upper><effort>1.5</effort></limit><dynamics><damping>9</damping></dynamics></axis></joint>
EXTRA</model></sdf>"""
BOX = """<sdf version="1.9"><model name="box"><link name="box">
<inertial><mass>2</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>
<collision name="hull"><geometry><box><size>0.4 0.4 0.02</size></box></geometry></collision></link></model></sdf>"""
BOX_MASS, BOX_HALF_HEIGHT = 2.0, 0.01


def write(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


@pytest.fixture
def pendulum(tmp_path: Path) -> RobotModel:
    servo = ServoConstants(reflected_inertia=0.005, viscous_friction=0.02, coulomb_friction=0.07)
    return RobotModel(write(tmp_path / "pendulum.sdf", PENDULUM.replace("EXTRA", "")), base="stand", servos={"swing": servo})


@pytest.fixture
def box(tmp_path: Path) -> RobotModel:
    return RobotModel(write(tmp_path / "box.sdf", BOX), base="box", ground=Ground(friction=0.5))


@pytest.fixture
def quadruped() -> RobotModel:
    return RobotModel(description=str(quadruped_sdf()), ground=Ground(friction=0.6))


def standing(model: RobotModel, **changes: np.ndarray) -> RobotTrajectory:
    """At rest in neutral, feet on the floor, and whatever is said otherwise."""
    q = np.zeros((1, len(model.joints)))
    machine = InverseDynamics(model).machine
    lowest = machine.places(RobotTrajectory.at_rest(model.joints, q))[0, :, 2].min()
    return replace(RobotTrajectory.at_rest(model.joints, q, p_WB=np.array([0, 0, -lowest])), **changes)


# ---- joints ------------------------------------------------------------------------------------------------------------------


def test_pendulum_needs_gravity_and_inertia(pendulum: RobotModel) -> None:
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2, 2, (3, 50, 1)) * np.array([1, 3, 40])[:, None, None]
    t = replace(RobotTrajectory.at_rest(("swing",), q), v=v, a=a)
    result = InverseDynamics(pendulum, base="fixed").of(t)
    links = MASS * G * LENGTH * np.sin(q) + (INERTIA + MASS * LENGTH**2) * a
    np.testing.assert_allclose(result.torque, links, atol=1e-12)
    motor = links + 0.005 * a + 0.02 * v + 0.07 * np.clip(v / 0.05, -1, 1)
    np.testing.assert_allclose(result.motor_torque, motor, atol=1e-12)


def test_the_mount_carries_weight_and_reaction(pendulum: RobotModel) -> None:
    q = np.array([[0.7]])
    result = InverseDynamics(pendulum, base="fixed").of(RobotTrajectory.at_rest(("swing",), q))
    x_com = -MASS * LENGTH * np.sin(0.7)  # mass times offset; the arm hangs from above the stand's origin
    np.testing.assert_allclose(result.support[0], [0, -x_com * G, 0, 0, 0, (1 + MASS) * G], atol=1e-12)
    assert np.all(result.base_wrench_residual == 0)
    assert result.contact == {}


def test_a_base_welded_to_the_world_is_seen_through_its_mount(tmp_path: Path) -> None:
    weld = '<joint name="mount" type="fixed"><parent>world</parent><child>stand</child></joint>'
    tilted = PENDULUM.replace("EXTRA", weld).replace('<link name="stand">', '<link name="stand"><pose>0 0 1 0 0.4 0</pose>')
    tilted = tilted.replace("<pose>0 0 0.5 0 0 0</pose>", '<pose relative_to="stand">0 0 0.5 0 0 0</pose>')
    model = RobotModel(write(tmp_path / "welded.sdf", tilted), base="stand")
    motion = Motion("still", np.array([0.0, 1.0]), ("swing",), np.zeros((2, 1)))
    result = InverseDynamics(model, base="fixed").of_motion(motion)
    np.testing.assert_allclose(result.torque, MASS * G * LENGTH * np.sin(0.4), atol=1e-9)
    np.testing.assert_allclose(result.support[:, 3:], [[0, 0, (1 + MASS) * G]] * len(result.time), atol=1e-9)
    with pytest.raises(InputError, match="fixed to the world"):
        InverseDynamics(model)


def test_a_motion_on_a_fixed_base_follows_its_cubic(pendulum: RobotModel) -> None:
    motion = Motion("swing", np.array([0.0, 0.5, 1.0]), ("swing",), np.radians([[0.0], [60.0], [0.0]]))
    result = InverseDynamics(pendulum, base="fixed").of_motion(motion, cycles=2)
    assert result.time[-1] == pytest.approx(2.0)
    inertia = INERTIA + MASS * LENGTH**2
    np.testing.assert_allclose(result.torque, MASS * G * LENGTH * np.sin(result.q) + inertia * result.a, atol=1e-12)
    np.testing.assert_allclose(np.gradient(np.gradient(result.q, result.time, axis=0), result.time, axis=0)[3:-3],
                               result.a[3:-3], atol=0.02 * np.abs(result.a).max())
    with pytest.raises(InputError, match="free base"):
        InverseDynamics(pendulum).of_motion(motion)


# ---- contact -----------------------------------------------------------------------------------------------------------------


def test_standing_feet_carry_the_weight_and_left_equals_right(quadruped: RobotModel) -> None:
    solver = InverseDynamics(quadruped)
    result = solver.of(standing(quadruped))
    weight = solver.machine.mass * G
    np.testing.assert_allclose(sum(result.contact.values())[0], [0, 0, weight], atol=1e-5 * weight)
    np.testing.assert_allclose(result.base_wrench_residual, 0, atol=1e-5 * weight)
    for side in ("f", "b"):
        left, right = result.contact[f"{side}lb"][0], result.contact[f"{side}rb"][0]
        np.testing.assert_allclose(left, right * [1, -1, 1], atol=1e-9)
        for part in "tmb":  # the axes of the two sides are opposite
            left_torque, right_torque = (result.torque[0, result.column(f"{side}{s}{part}")] for s in "lr")
            assert left_torque == pytest.approx(-right_torque, abs=1e-9)


def test_a_lifted_foot_carries_nothing(quadruped: RobotModel) -> None:
    down = {f: np.array([f != "flb"]) for f in ("blb", "brb", "flb", "frb")}
    result = InverseDynamics(quadruped).of(standing(quadruped), stance=down)
    assert np.all(result.contact["flb"] == 0)
    assert all(result.contact[f][0, 2] > 0 for f in ("blb", "frb"))


def test_free_fall_leaves_nothing_to_explain(quadruped: RobotModel) -> None:
    t = standing(quadruped)
    t = replace(t, p_WB=t.p_WB + RISE, A_WB=np.array([[0, 0, 0, 0, 0, -G]]), V_WB=np.array([[0, 0, 0, 0.5, 0, 0.2]]))
    result = InverseDynamics(quadruped).of(t)
    np.testing.assert_allclose(result.base_wrench_residual, 0, atol=1e-9)
    np.testing.assert_allclose(result.torque, 0, atol=1e-9)
    assert all(np.all(f == 0) for f in result.contact.values())


def test_a_body_that_hangs_in_the_air_is_residual(quadruped: RobotModel) -> None:
    t = standing(quadruped)
    solver = InverseDynamics(quadruped)
    result = solver.of(replace(t, p_WB=t.p_WB + RISE))
    np.testing.assert_allclose(result.base_wrench_residual[0, 3:], [0, 0, solver.machine.mass * G], atol=1e-9)


def test_what_the_box_needs_beyond_friction_is_residual(box: RobotModel) -> None:
    """A flat box on its corners pushed along x: up to mu g nothing is left, beyond it the distance from the cone."""
    pushes = np.array([0.0, 0.4, 0.49, 0.6, 1.0, 2.0]) * G
    N = len(pushes)
    t = RobotTrajectory.at_rest((), np.zeros((N, 0)), p_WB=np.array([0, 0, BOX_HALF_HEIGHT]))
    t = replace(t, A_WB=np.column_stack([np.zeros((N, 3)), pushes, np.zeros((N, 2))]))
    result = InverseDynamics(box).of(t)
    demand = np.column_stack([pushes, np.zeros(N), np.full(N, G)]) * BOX_MASS
    np.testing.assert_allclose(result.contact["box"] + result.base_wrench_residual[:, 3:], demand, atol=1e-9)
    mu, beyond = 0.5, pushes > 0.5 * G
    assert np.abs(result.base_wrench_residual[~beyond]).max() < 1e-4
    # Distance of (a, g) from the cone, by hand: (a - mu g) m / sqrt(1 + mu^2), along (1, -mu) / sqrt(1 + mu^2).
    missing = (pushes[beyond] - mu * G) * BOX_MASS / (1 + mu**2)
    np.testing.assert_allclose(result.base_wrench_residual[beyond, 3], missing, rtol=1e-3)
    np.testing.assert_allclose(result.base_wrench_residual[beyond, 5], -mu * missing, rtol=1e-3)
    force = result.contact["box"]
    assert np.all(np.hypot(force[:, 0], force[:, 1]) <= mu * force[:, 2] * (1 + 1e-9))


def test_a_floor_cannot_pull(box: RobotModel) -> None:
    t = RobotTrajectory.at_rest((), np.zeros((1, 0)), p_WB=np.array([0, 0, BOX_HALF_HEIGHT]))
    result = InverseDynamics(box).of(replace(t, A_WB=np.array([[0, 0, 0, 0, 0, -2 * G]])))
    np.testing.assert_allclose(result.base_wrench_residual[0, 3:], [0, 0, -BOX_MASS * G], atol=1e-9)


@pytest.mark.parametrize(("model_ground", "asked", "expected"), [(0.3, None, 0.3), (0.3, 0.8, 0.8), (None, None, 0.6)])
def test_friction_comes_from_the_call_the_ground_or_the_feet(
        quadruped: RobotModel, model_ground: float | None, asked: float | None, expected: float) -> None:
    solver = InverseDynamics(replace(quadruped, ground=Ground(friction=model_ground)), friction=asked)
    np.testing.assert_allclose(solver.friction, expected)


def test_forces_equal_those_of_a_general_solver() -> None:
    """The same second-order cone programme by Clarabel, sample by sample."""
    from pydrake.solvers import ClarabelSolver, MathematicalProgram

    rng = np.random.default_rng(5)
    N, C, mu = 6, 5, 0.6
    wrench, arms = rng.normal(0, 5, (N, 6)) + np.array([0, 0, 0, 0, 0, 8]), rng.uniform(-0.15, 0.15, (N, C, 3))
    cost = rng.uniform(1, 5, (N, C)) * 1e-3
    cost[:, 0] = np.inf
    scale = np.array([1.5, 1.5, 1.5, 10, 10, 10])
    forces, residual = share_forces(wrench, arms, np.zeros((N, C, 2)), np.full(C, mu), cost, scale)
    for i in range(N):
        program = MathematicalProgram()
        f = program.NewContinuousVariables(C - 1, 3)
        wide = program.NewContinuousVariables(C - 1, 3)  # at rest the dear cone is the cheap one again, and adds to it
        matrix, offset = np.zeros((6, 6 * (C - 1))), wrench[i] / scale
        for c in range(C - 1):
            x, y, z = arms[i, c + 1]
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            for block in (0, 3 * (C - 1)):
                matrix[:, block + 3 * c:block + 3 * c + 3] = np.vstack([cross, np.eye(3)]) / scale[:, None]
            for force, dear in ((f, 1.0), (wide, 100.0)):
                program.AddLorentzConeConstraint(np.array([mu * force[c, 2], force[c, 0], force[c, 1]]))
                program.AddQuadraticCost(cost[i, c + 1] * dear * np.eye(3), np.zeros(3), force[c], is_convex=True)
        variables = np.concatenate([f.ravel(), wide.ravel()])
        program.Add2NormSquaredCost(matrix / np.sqrt(2), offset / np.sqrt(2), variables)
        solution = ClarabelSolver().Solve(program)
        assert solution.is_success()
        expected = solution.GetSolution(f) + solution.GetSolution(wide)
        np.testing.assert_allclose(forces[i, 1:], expected, atol=2e-3)
        np.testing.assert_allclose(residual[i], wrench[i] - scale * (matrix @ solution.GetSolution(variables)), atol=2e-3)
    assert np.all(forces[:, 0] == 0)


def test_friction_works_against_the_slip() -> None:
    """Two feet that slide apart squeeze the body between them, though its motion needs no force along the floor."""
    wrench = np.array([[0, 0, 0, 0, 0, 10.0]])
    arms = np.array([[[0.1, 0, -0.2], [-0.1, 0, -0.2]]])
    slip = np.array([[[50 * STICKING, 0.0], [-50 * STICKING, 0.0]]])
    scale = np.array([2.0, 2, 2, 10, 10, 10])
    forces, residual = share_forces(wrench, arms, slip, np.array([0.5, 0.5]), np.full((1, 2), 1e-8), scale)
    np.testing.assert_allclose(forces[0], [[-2.5, 0, 5], [2.5, 0, 5]], atol=0.05)
    np.testing.assert_allclose(residual, 0, atol=1e-4)


def test_projection_is_the_nearest_point_of_the_cone() -> None:
    rng = np.random.default_rng(1)
    z, mu = rng.normal(size=(200, 3)), np.full(200, 0.7)
    p = project(z, mu)
    size = np.hypot(p[:, 0], p[:, 1])
    assert np.all(size <= 0.7 * p[:, 2] + 1e-12)
    np.testing.assert_allclose(np.sum(p * (z - p), axis=1), 0, atol=1e-12)  # Moreau: orthogonal to what is left,
    left = z - p
    assert np.all(left[:, 2] + 0.7 * np.hypot(left[:, 0], left[:, 1]) <= 1e-12)  # which lies in the polar cone


# ---- servos ------------------------------------------------------------------------------------------------------------------


def test_margins_follow_the_torque_speed_line() -> None:
    servo = ServoConstants(stall_torque=1.5, no_load_speed=6.0, rated_voltage=12, supply_voltage=10)
    full, v = 1.25, np.array([[0.0], [2.0], [5.0], [2.0], [-2.0], [6.0]])
    needed = np.array([[1.0], [0.75], [0.0], [-1.0], [-0.75], [0.5]])
    left = torque_margin([servo], needed, v)
    # At rest; on the line (1.25 - 0.25 * 2 = 0.75); at no-load speed nothing is needed; braking; mirrored; impossible.
    np.testing.assert_allclose(left[:, 0], [full - 1.0, 0.0, full, full + 0.5 - 1.0, 0.0, full - 1.5 - 0.5], atol=1e-12)
    np.testing.assert_allclose(speed_margin([servo], v)[:, 0], 5.0 - np.abs(v[:, 0]), atol=1e-12)
    load = servo_load(servo, needed[:, 0], left[:, 0], speed_margin([servo], v)[:, 0])
    assert load.peak == 1.0
    assert load.rms == pytest.approx(np.sqrt(np.mean(needed**2)))
    assert load.beyond_fifth == pytest.approx(5 / 6)  # a fifth of 1.5 N m is 0.3 N m
    assert load.torque_margin == pytest.approx(-0.75)
    assert not load.feasible
    assert np.isnan(servo_load(servo, np.full(3, np.nan), np.full(3, np.nan), np.zeros(3)).rms)


def test_a_margin_within_noise_is_not_exceeded() -> None:
    servo, left, free = ServoConstants(), np.array([0.4, -0.2, 0.1]), np.ones(3)
    exact = servo_load(servo, np.ones(3), left, free)
    assert (exact.torque_sigma, exact.feasible, exact.exceeded) == (0.0, False, True)
    noisy = servo_load(servo, np.ones(3), left, free, np.array([0.01, 0.1, 0.01]), np.zeros(3))
    assert (noisy.torque_sigma, noisy.feasible, noisy.exceeded) == (0.1, False, False)
    assert servo_load(servo, np.ones(3), left, free, np.full(3, 0.05), np.zeros(3)).exceeded


def test_motor_torque_without_friction_is_torque_and_rotor() -> None:
    servo = ServoConstants(reflected_inertia=0.01)
    torque = motor_torque([servo], np.array([[0.2]]), np.array([[3.0]]), np.array([[5.0]]), friction=False)
    np.testing.assert_allclose(torque, 0.25)


# ---- bad input -----------------------------------------------------------------------------------------------------------------


def test_bad_input_is_one_readable_line(quadruped: RobotModel, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no link 'torso'"):
        InverseDynamics(replace(quadruped, base="torso"))
    with pytest.raises(InputError, match="cannot float"):
        InverseDynamics(replace(quadruped, base="tail_link"))
    with pytest.raises(InputError, match="expected the root"):
        InverseDynamics(replace(quadruped, base="tail_link"), base="fixed")
    with pytest.raises(InputError, match="expected free or fixed"):
        InverseDynamics(quadruped, base="swinging")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="friction: expected a non-negative number"):
        InverseDynamics(quadruped, friction=-0.1)
    solver = InverseDynamics(quadruped)
    with pytest.raises(InputError, match="joint 'knee'"):
        solver.of(RobotTrajectory.at_rest(("knee",), np.zeros((1, 1))))
    with pytest.raises(InputError, match="no foot 'head'"):
        solver.of(standing(quadruped), stance={"head": np.array([True])})
    with pytest.raises(InputError, match=r"stance, flb: expected shape \(1,\)"):
        solver.of(standing(quadruped), stance={"flb": np.array([True, False])})
    with pytest.raises(InputError, match="v: expected shape"):
        replace(standing(quadruped), v=np.zeros((2, 15)))
    with pytest.raises(InputError, match="increase"):
        replace(standing(quadruped), time=np.array([np.nan]))
