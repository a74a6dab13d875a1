"""Inverse dynamics against MuJoCo: the same links written into an MJCF, joint for joint."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from tests.quadruped import quadruped_sdf
from workbench.dynamics import InverseDynamics, RobotTrajectory
from workbench.robot import ConfigureParser, Ground, RobotModel, puppy_model, resource_dir


def twin(model: RobotModel, free: bool) -> mujoco.MjModel:
    """The model's links and joints in MuJoCo, without geometry; armature is the servos' reflected inertia."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    ConfigureParser(parser)
    parser.AddModels(str(model.path))
    plant.Finalize()
    kinematics = model.kinematics
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, -9.81]
    bodies = {}
    for link in kinematics.links:
        joint = kinematics.joint_of(link)
        parent = spec.worldbody if joint is None else bodies[kinematics.frames[joint].parent]
        body = bodies[link] = parent.add_body(name=link)
        if joint is not None:
            f = kinematics.frames[joint]
            body.pos = f.X_PF_p + f.X_PF_R @ f.X_MB_p
            body.quat = quaternion(f.X_PF_R @ f.X_MB_R)
            if joint in model.joints:
                body.add_joint(name=joint, type=mujoco.mjtJoint.mjJNT_HINGE, axis=f.X_MB_R.T @ f.axis,
                               pos=-f.X_MB_R.T @ f.X_MB_p, armature=model.servo(joint).reflected_inertia)
        elif free:
            body.add_freejoint()
        M = plant.GetBodyByName(link).default_spatial_inertia()
        I = M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
        body.mass, body.ipos = M.get_mass(), M.get_com()
        body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
        body.explicitinertial = True
    spec.compiler.balanceinertia = False
    return spec.compile()


def quaternion(R: np.ndarray) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, R.ravel())
    return quat


def random_states(model: RobotModel, count: int, moving_base: bool) -> RobotTrajectory:
    rng = np.random.default_rng(3)
    n = len(model.joints)
    quat = rng.normal(size=(count, 4))
    quat = quat / np.linalg.norm(quat, axis=1, keepdims=True) if moving_base else np.tile([1.0, 0, 0, 0], (count, 1))
    return RobotTrajectory(
        np.arange(float(count)), model.joints,
        rng.uniform(-2, 2, (count, n)), rng.normal(0, 5, (count, n)), rng.normal(0, 80, (count, n)),
        rng.normal(size=(count, 3)) * moving_base, quat,
        rng.normal(0, 3, (count, 6)) * moving_base, rng.normal(0, 20, (count, 6)) * moving_base)


def set_state(m: mujoco.MjModel, d: mujoco.MjData, model: RobotModel, t: RobotTrajectory, i: int, free: bool) -> np.ndarray:
    """Puts sample i into MuJoCo; returns R_WB. Its free joint has linear velocity in W and angular velocity in B."""
    R = np.eye(3)
    if free:
        flat = np.zeros(9)
        mujoco.mju_quat2Mat(flat, t.quat_WB[i])
        R = flat.reshape(3, 3)
        d.qpos[:7] = [*t.p_WB[i], *t.quat_WB[i]]
        d.qvel[:6] = [*t.V_WB[i, 3:], *(R.T @ t.V_WB[i, :3])]
        d.qacc[:6] = [*t.A_WB[i, 3:], *(R.T @ t.A_WB[i, :3])]
    for k, joint in enumerate(model.joints):
        j = m.joint(joint)
        d.qpos[j.qposadr], d.qvel[j.dofadr], d.qacc[j.dofadr] = t.q[i, k], t.v[i, k], t.a[i, k]
    return R


def dofs(m: mujoco.MjModel, model: RobotModel) -> list[int]:
    return [int(m.joint(j).dofadr[0]) for j in model.joints]


@pytest.fixture(params=["quadruped", "puppy"])
def model(request: pytest.FixtureRequest) -> RobotModel:
    if request.param == "quadruped":
        return RobotModel(description=str(quadruped_sdf()), ground=Ground(friction=0.6))
    if not (Path(resource_dir("models")) / "puppy" / "puppy.sdf").is_file():
        pytest.skip("the puppy's SDF is not made yet")
    return puppy_model()


def test_free_base_equals_mj_inverse(model: RobotModel) -> None:
    t = random_states(model, 40, moving_base=True)
    nothing_down = {f: np.zeros(40, dtype=bool) for f in ("blb", "brb", "flb", "frb")}
    ours = InverseDynamics(model, servo_friction=False).of(t, stance=nothing_down)
    m = twin(model, free=True)
    d = mujoco.MjData(m)
    for i in range(40):
        R = set_state(m, d, model, t, i, free=True)
        mujoco.mj_inverse(m, d)
        wrench = [*(R @ d.qfrc_inverse[3:6]), *d.qfrc_inverse[:3]]
        np.testing.assert_allclose(ours.base_wrench_residual[i], wrench, rtol=0, atol=1e-6 * np.abs(wrench).max())
        torque = d.qfrc_inverse[dofs(m, model)]
        np.testing.assert_allclose(ours.motor_torque[i], torque, rtol=0, atol=1e-6 * np.abs(torque).max())


def test_fixed_base_equals_mj_inverse(model: RobotModel) -> None:
    t = random_states(model, 40, moving_base=False)
    ours = InverseDynamics(model, base="fixed", servo_friction=False).of(t)
    m = twin(model, free=False)
    d = mujoco.MjData(m)
    for i in range(40):
        set_state(m, d, model, t, i, free=False)
        mujoco.mj_inverse(m, d)
        torque = d.qfrc_inverse[dofs(m, model)]
        np.testing.assert_allclose(ours.motor_torque[i], torque, rtol=0, atol=1e-6 * np.abs(torque).max())
    assert np.all(ours.base_wrench_residual == 0)


def test_mujoco_moves_as_told_under_our_torques_contacts_and_residual(model: RobotModel) -> None:
    """Forward again: what inverse dynamics found, applied in the other engine, gives back the accelerations."""
    t = random_states(model, 20, moving_base=True)
    machine = InverseDynamics(model).machine
    down = {f: np.ones(20, dtype=bool) for f in machine.points.feet}
    solver = InverseDynamics(model, servo_friction=False)
    ours = solver.of(t, stance=down)
    # The result keeps one force for each foot; here it matters at which points they act.
    places = machine.places(t)
    forces = solver._solve(t, solver._dearness(t, down, 0.0)).forces
    for f, foot in enumerate(machine.points.feet):
        np.testing.assert_allclose(forces[:, machine.points.foot == f].sum(axis=1), ours.contact[foot], atol=1e-9)
    assert max(np.abs(force).max() for force in ours.contact.values()) > 1
    m = twin(model, free=True)
    d = mujoco.MjData(m)
    for i in range(20):
        R = set_state(m, d, model, t, i, free=True)
        wanted = d.qacc.copy()
        d.qfrc_applied[:] = 0
        mujoco.mj_fwdPosition(m, d)
        d.qfrc_applied[dofs(m, model)] = ours.motor_torque[i]
        d.qfrc_applied[:3] = ours.base_wrench_residual[i, 3:]
        d.qfrc_applied[3:6] = R.T @ ours.base_wrench_residual[i, :3]
        for c, link in enumerate(machine.points.links):
            mujoco.mj_applyFT(m, d, forces[i, c], np.zeros(3), places[i, c], m.body(link).id, d.qfrc_applied)
        mujoco.mj_forward(m, d)
        np.testing.assert_allclose(d.qacc, wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())

