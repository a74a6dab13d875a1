"""Do the two engines mean the same by an effect? python -m studies.other_engine.agreement

Each effect is played by the Drake station and by MuJoCo, whose codes share only the contract's words. On a stand, or standing on
its feet and swaying, the response is the change caused by the effect: links' angles, their rotation off the servos' axes, and the
base's position and tilt, with the effect less without. The responses are compared, not the motions, so that other differences
between the engines (contact, steps) cancel.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from studies.concealed_effects.robots import quadruped
from studies.other_engine.excitation import MotionRows
from studies.other_engine.firmware import commands_from_rows
from studies.other_engine.player import Rollout, play
from workbench.effects.registry import known_effects
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.types import Array

RATE = 200.0
BASE_SCALE = 10.0
"""Weight of a metre of the base's path, in radians: a millimetre as half a degree."""


def E(effect: str, *where: str, **parameters: float | tuple[float, float, float]) -> EffectSpec:
    """An effect in the contract's words."""
    return EffectSpec(effect, where, parameters)


FIXED = (
    E("backlash", "flm", gap=4.0), E("joint_compliance", "flm", stiffness=4.0), E("coulomb_friction", "flm", torque=0.12),
    E("viscous_friction", "flm", coefficient=0.1), E("stribeck_friction", "flm", torque=0.15, speed=20.0),
    E("load_friction", "flm", coefficient=0.8), E("load_friction", "flm", coefficient=0.4, static=0.9, speed=80.0, backdrive=0.9),
    E("friction_asymmetry", "flm", ratio=4.0), E("supply_voltage", voltage=8.5), E("supply_sag", drop=0.3),
    E("torque_ceiling", "flm", torque=0.15), E("torque_saturation", "flm", torque=0.4), E("thermal_fade", rate=0.15),
    E("servo_gain", "flm", ratio=0.5),
    E("dead_band", "flm", margin=2.0), E("reflected_inertia", "flm", inertia=0.006),
    E("joint_stop", "flm", lower=-10.0, upper=12.0), E("zero_offset", "flm", angle=6.0),
    E("parallel_spring", "flm", stiffness=0.6),
    E("command_delay", "flm", delay=0.02), E("timing_drift", per_pose=0.006), E("clock_rate", ratio=1.015), E("speed_order"),
    E("goal_ramp", "flm", speed=40.0), E("command_filter", "flm", time=0.06), E("damping_gain", "flm", gain=0.1),
    E("minimum_duty", "flm", duty=0.1),
    E("loose_mount", "flm", play=4.0, axis=(1.0, 0.0, 0.0)), E("payload", "flb_link", mass=0.08, position=(0.01, 0.0, -0.05)),
    E("com_shift", "flm_link", offset=(0.03, 0.0, 0.0)), E("ground_tilt", forward=15.0, left=-10.0),
)
"""Seen on a stand."""
FREE = (
    E("zero_offset", "flm", angle=6.0), E("link_length", "flm_link", change=0.006),
    E("payload", "body_link", mass=0.3, position=(0.02, 0.03, 0.05)), E("com_shift", "body_link", offset=(0.03, 0.02, 0.0)),
    E("ground_friction", friction=0.08), E("foot_friction", "flb", friction=0.05), E("ground_tilt", forward=3.0, left=2.0),
    E("soft_ground", stiffness=2e3), E("tether_force", force=(-1.5, 0.8, 0.0)), E("joint_compliance", "flm", stiffness=4.0),
    E("backlash", "flb", gap=4.0), E("torque_ceiling", "flm", torque=0.15), E("load_friction", "flm", coefficient=0.4),
)
"""Seen on the feet."""


@dataclass(frozen=True)
class Agreement:
    """response: RMS of the effect's response in MuJoCo, over time, summed over channels [rad]. difference: of the two engines'
    responses."""

    effect: str
    base: str
    response: float
    difference: float

    @property
    def ratio(self) -> float:
        """Of difference to response; 0 is perfect, 1 is no relation."""
        return self.difference / self.response


def short_motion(joints: tuple[str, ...], base: str) -> Commands:
    """Two seconds that move all joints, on the stand widely, on the feet by a crouch and a sway."""
    legs = {"b": 30.0, "m": 15.0, "t": 6.0}
    side = {"fl": 1.0, "fr": -1.0, "bl": -1.0, "br": 1.0}
    crouch = np.array([side[j[:2]] * legs[j[2]] if len(j) == 3 and j[:2] in side else 10.0 for j in joints])
    crouch[[j.endswith("t") and len(j) == 3 for j in joints]] = 0.0 if base == "free" else 6.0
    wide = base == "fixed"
    share = np.array([0.0, 1.0, -1.0, 0.6, 0.0] if wide else [0.0, 0.8, 1.2, 0.9, 1.2])
    times = np.array([0.0, 0.4, 0.75, 1.3, 1.8])
    rows = MotionRows(joints, times, share[:, None] * (1.3 if wide else 1.0) * crouch)
    return commands_from_rows(rows.joints, rows.times, rows.angles)


def seen_in_mujoco(run: Rollout, model: RobotModel, time: Array) -> Array:
    """Channels (N, c) [rad] at `time`: links' rotation vectors against their parents, and the base's place and tilt."""
    k = model.kinematics
    poses = run.poses(time, tuple(k.links))
    channels = [_against_parent(poses[k.frames[j].parent][1], poses[k.frames[j].child][1]) for j in model.joints]
    return _with_base(channels, poses[model.base][0], poses[model.base][1])


def seen_in_drake(take: Take, model: RobotModel, time: Array) -> Array:
    """The same of a take of the station."""
    k = model.kinematics
    at = take.resampled(time)
    assert at.p_WB is not None
    assert at.quat_WB is not None
    R_WB = Rotation.from_quat(at.quat_WB, scalar_first=True).as_matrix()
    if take.links:
        R = {l: Rotation.from_quat(b.quat, scalar_first=True).as_matrix() for l, b in at.links.items()}
    else:
        R = {l: pose[1] for l, pose in k.forward(at.q).items()}
    channels = [_against_parent(R[k.frames[j].parent], R[k.frames[j].child]) for j in model.joints]
    return _with_base(channels, at.p_WB, R_WB)


def _against_parent(R_WP: Array, R_WL: Array) -> Array:
    return np.asarray(Rotation.from_matrix(np.swapaxes(R_WP, 1, 2) @ R_WL).as_rotvec(), dtype=float)


def _with_base(channels: Sequence[Array], p: Array, R: Array) -> Array:
    tilt = Rotation.from_matrix(R).as_rotvec()
    return np.column_stack([*channels, tilt, BASE_SCALE * (p - [p[0, 0], p[0, 1], 0.0])])


class SideBySide:
    """One robot on one base in both engines; the nominal one is played once."""

    def __init__(self, model: RobotModel, base: str, timestep: float = 5e-4, drake_step: float = 1e-3) -> None:
        self.model, self.base, self.timestep = model, base, timestep
        self.config = SimulationConfig(time_step=drake_step, base=base, contact_period=0.0)
        self.commands = short_motion(model.joints, base)
        self.time = np.arange(0.0, self.commands.end + 0.2, 1 / RATE)
        self.nominal = self.mujoco(model), self.drake(model)

    def agreement(self, effect: EffectSpec) -> Agreement:
        """Of the two engines' responses to an effect."""
        hidden = self.model.with_effect(effect)
        ours, theirs = self.mujoco(hidden) - self.nominal[0], self.drake(hidden) - self.nominal[1]
        return Agreement(effect.effect, self.base, _size(ours), _size(ours - theirs))

    def mujoco(self, model: RobotModel) -> Array:
        """Channels of a run in MuJoCo."""
        run = play(model, self.commands, self.commands.end + 0.3, 0.1, self.base, self.timestep)
        return seen_in_mujoco(run, self.model, self.time)

    def drake(self, model: RobotModel) -> Array:
        """Channels of a run of the station."""
        take = Simulation(model, self.config).run(self.commands, self.commands.end + 0.3, 0.1)
        return seen_in_drake(take, self.model, self.time)


def _size(x: Array) -> float:
    return float(np.sqrt(np.sum(np.mean(np.square(x), axis=0))))


def main() -> None:
    """Prints the table."""
    with tempfile.TemporaryDirectory() as folder:
        model = quadruped(np.random.default_rng(2)).model(Path(folder) / "robot.sdf")
        for base, effects in (("fixed", FIXED), ("free", FREE)):
            engines = SideBySide(model, base)
            for spec in effects:
                if spec.effect not in known_effects():
                    print(f"{spec.effect:18s} {base:6s} not in the station")
                    continue
                a = engines.agreement(spec)
                print(f"{a.effect:18s} {base:6s} response {np.rad2deg(a.response):7.3f} deg, "
                      f"difference {np.rad2deg(a.difference):6.3f} deg, ratio {a.ratio:.3f}", flush=True)


if __name__ == "__main__":
    main()
