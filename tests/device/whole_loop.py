"""A motion to the virtual robot with hidden physics, its recordings back, and what diagnosis makes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.device.servos import arm
from tests.firmware.image import image
from workbench.api.robot_run import run_by_controller, run_on_robot
from workbench.compare.session import load_session
from workbench.compare.session_file import write_session
from workbench.device.bus import Bus
from workbench.device.virtual import SECOND
from workbench.device.virtual.cm530 import Board
from workbench.device.virtual.cm530.port import PcLinkPort
from workbench.identify.diagnosis import diagnose_session
from workbench.motion import Motion, load_motion
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.simulation.virtual_robot import VirtualRobot

HIDDEN = {
    "quiet": (),
    "backlash": (EffectSpec("backlash", ("flm",), {"gap": 3.0}),),
    "slippery_foot": (EffectSpec("foot_friction", ("brb",), {"friction": 0.15}),),
    "payload": (EffectSpec("payload", ("body_link",), {"mass": 0.25, "position": (-0.02, 0.03, 0.05)}),),
    "late_firmware": (EffectSpec("timing_drift", (), {"per_pose": 0.006}),),
    "sagging_supply": (EffectSpec("supply_voltage", (), {"voltage": 9.8}),),
    "stiff_gearbox": (EffectSpec("coulomb_friction", ("frm",), {"torque": 0.18}),),
    "two_at_once": (EffectSpec("servo_gain", ("brb",), {"ratio": 0.45}), EffectSpec("ground_friction", (), {"friction": 0.3})),
}
"""Those of the practice sessions; a supply that preflight and program let pass."""


def stand(model, seed=1, poses=16):
    """A motion for the robot on a stand: some joints at a time, far and fast; no pose of the table thesis."""
    rng = np.random.default_rng(seed)
    angles = np.zeros((poses + 1, len(model.joints)))
    for k in range(1, poses):
        angles[k] = angles[k - 1]
        moved = rng.choice(len(model.joints), 5, replace=False)
        angles[k, moved] = np.radians(rng.uniform(-35, 35, 5))
        for i in moved:
            frame_ = model.kinematics.frames[model.joints[i]]
            angles[k, i] = np.clip(angles[k, i], frame_.lower, frame_.upper)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 0.5, poses))])
    return Motion("stand", times, model.joints, angles)


def walk(model):
    return replace(load_motion(data_file("robotis_walk.csv"), model), name="walk")


def from_host(folder: Path, effects, bases=("fixed", "free"), cycles=8, seed=3):
    """By `run`: preflight, play over the bus, cameras, joint log. Returns the session's folder."""
    model = puppy_model()
    takes = []
    for base in bases:
        robot = VirtualRobot(replace(model, effects=effects), base)
        motion = stand(model) if base == "fixed" else walk(model)
        done = run_on_robot(Bus(robot.port, robot.profile), model, motion, 1 if base == "fixed" else cycles, folder, lambda: "",
                            base=base, virtual=robot, seed=seed)
        assert done.played.stopped == ""
        takes += done.takes
    write_session(folder, model, takes, "registers.yaml")
    return folder


def from_controller(folder: Path, effects, bases=("fixed", "free"), cycles=8, seed=3):
    """By the flashed image: table uploaded and played by the controller, cameras, its log over the PC link."""
    model = puppy_model()
    takes = []
    for base in bases:
        robot = VirtualRobot(replace(model, effects=effects), base)
        board = Board(image(), robot.clock, robot.bus)
        board.power_on()
        board.run(robot.clock.now + SECOND // 2)
        motion = stand(model) if base == "fixed" else walk(model)
        count = 1 if base == "fixed" else cycles
        done = run_by_controller(PcLinkPort(board), model, motion, count, folder, lambda: "", base=base, virtual=robot, seed=seed)
        assert done.played.stopped == ""
        assert not board.violations
        takes += done.takes
    write_session(folder, model, takes)
    return folder


ARM_MOTION = Motion("wave", np.array([0.0, 0.35, 0.6, 0.85, 1.2, 1.45, 1.8]), ("one", "three", "two"),
                    np.radians([[0.0, 0, 0], [25, -15, 30], [-20, 12, -25], [10, -20, 20], [-30, 25, -10], [15, 0, 25],
                                [0, 0, 0]]))


def of_an_arm(folder: Path, effects, cycles=2, seed=3, registers=()):
    """By `run`, on a robot of three joints that a stand holds. registers: what somebody set, by joint, as keys of servo.yaml."""
    bodies = {"Trunk": "trunk", "Upper": "upper", "Middle": "middle", "Lower": "lower"}
    model = replace(arm(folder), rigid_bodies=bodies)
    servos = {j: replace(model.servo(j), **dict(registers).get(j, {})) for j in model.joints}
    robot = VirtualRobot(replace(model, effects=effects, servos=servos), "fixed")
    bus = Bus(robot.port, robot.profile)
    done = run_on_robot(bus, model, ARM_MOTION, cycles, folder, lambda: "", base="fixed", virtual=robot, seed=seed)
    assert done.played.stopped == ""
    return folder


def named(folder: Path, jobs=1):
    """Verdict, and effects with their places that diagnosis is sure of by half or more."""
    diagnosis = diagnose_session(load_session(folder), n_jobs=jobs).diagnosis
    return diagnosis.verdict, {(f.effect, f.where): f.confidence for f in diagnosis.findings if f.confidence >= 0.5}
