"""A motion to the virtual robot with hidden physics, its recordings back, and what diagnosis makes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.device.servos import arm
from tests.firmware.image import image
from workbench.compare.robot_run import run_on_robot
from workbench.compare.session import load_session
from workbench.compare.session_file import write_session
from workbench.device.bus import Bus
from workbench.device.capture import Recorder, VirtualLink, VirtualMotive, record_take
from workbench.device.link import ControllerState, FrameReader, FrameType, LogMessage, StateMessage, frame, message, upload_frames
from workbench.device.play.telemetry import write_telemetry
from workbench.device.table_file import TableFile, bounds_of, encode_table
from workbench.device.virtual import MILLISECOND, SECOND
from workbench.device.virtual.cm530 import Board
from workbench.identify.diagnosis import diagnose_session
from workbench.motion import Motion, load_motion, save_motion
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.simulation.virtual_robot import VirtualRobot

HIDDEN = {
    "quiet": (),
    "backlash": (EffectSpec("backlash", ("flm",), {"gap": 3.0}),),
    "slippery_foot": (EffectSpec("foot_friction", ("brb",), {"friction": 0.15}),),
    "payload": (EffectSpec("payload", ("body_link",), {"mass": 0.25, "position": (-0.02, 0.03, 0.05)}),),
    "late_firmware": (EffectSpec("timing_drift", (), {"per_pose": 0.006}),),
    "sagging_supply": (EffectSpec("supply_voltage", (), {"voltage": 9.2}),),
    "stiff_gearbox": (EffectSpec("coulomb_friction", ("frm",), {"torque": 0.18}),),
    "two_at_once": (EffectSpec("servo_gain", ("brb",), {"ratio": 0.45}), EffectSpec("ground_friction", (), {"friction": 0.3})),
}
"""Those of the practice sessions; a supply that a preflight lets pass."""


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
        motion = stand(model) if base == "fixed" else walk(model)
        count = 1 if base == "fixed" else cycles
        started, ended, log, zero = _played_by_the_image(robot, motion, count)
        names, scene, begin, end = robot.scene(started, seed)
        motive = VirtualMotive(names, scene, rate=120.0, started=begin, seed=seed)
        capture = record_take(Recorder(VirtualLink(motive)), folder / f"{motion.name}.csv", lambda: False, end - begin - 0.01,
                              until_time=lambda ended=ended: ended)
        save_motion(motion, folder / f"{motion.name}_motion.csv")
        table = {"motion": f"{motion.name}_motion.csv", "cycles": count, "base": base}
        takes.append({"name": motion.name, "recording": f"{motion.name}.csv", **table,
                      "starts_at": round(started - capture.first_host, 5)})
        if log:
            write_telemetry(folder / f"{motion.name}_joints.csv", log, motion.joints, robot.profile)
            first = log[0].time + log[0].duration / 2 + zero
            takes.append({"name": f"{motion.name}_joints", "recording": f"{motion.name}_joints.csv", **table,
                          "starts_at": round(started - first, 5)})
    write_session(folder, model, takes)
    return folder


def _played_by_the_image(robot, motion, cycles):
    """Start and end on the virtual clock [s], the controller's rounds from a second before the start on, and its clock's zero."""
    board = Board(image(), robot.clock, robot.bus)
    goals = []
    talk = robot.bus.talk

    def heard(talker, values, rate, starts):
        end = talk(talker, values, rate, starts)
        if talker is board and len(values) > 5 and values[4] == 0x83:
            goals.append(end)
        return end

    robot.bus.talk = heard
    reader, messages, read = FrameReader(), [], 0

    def run(ms):
        nonlocal read
        board.run(robot.clock.now + round(ms * MILLISECOND))
        new = bytes(board.pc.received[read:])
        read += len(new)
        messages.extend(m for f in reader.feed(new) if (m := message(f)) is not None)

    def until(state, seconds):
        end = robot.clock.now + seconds * SECOND
        while not any(isinstance(m, StateMessage) and m.state == state for m in messages[-40:]):
            assert robot.clock.now < end, messages[-3:]
            run(20)

    table = motion.as_table()
    data = encode_table(TableFile(table, bounds_of(table, robot.model), cycles, True))
    board.power_on()
    zero = robot.clock.now / SECOND
    until(ControllerState.NEUTRAL, 12)
    for part in upload_frames(data, 1, ramps=True):
        board.send(board.pc, part)
    run(1500)
    goals.clear()
    board.send(board.pc, frame(FrameType.PLAY))
    while not goals:
        run(5)
        assert robot.clock.now < (zero + 30) * SECOND, messages[-3:]
    began = goals[0] / SECOND
    seconds = motion.commands(cycles).end
    run(1000 * (began + seconds - robot.clock.now / SECOND) + 100)
    rounds = [m for m in messages if isinstance(m, LogMessage) and m.time + zero > began - 0.9]
    assert not board.violations
    return began, began + seconds, rounds, zero


ARM_MOTION = Motion("wave", np.array([0.0, 0.35, 0.6, 0.85, 1.2, 1.45, 1.8]), ("one", "three", "two"),
                    np.radians([[0.0, 0, 0], [25, -15, 30], [-20, 12, -25], [10, -20, 20], [-30, 25, -10], [15, 0, 25],
                                [0, 0, 0]]))


def of_an_arm(folder: Path, effects, cycles=2, seed=3):
    """By `run`, on a robot of three joints that a stand holds."""
    bodies = {"Trunk": "trunk", "Upper": "upper", "Middle": "middle", "Lower": "lower"}
    model = replace(arm(folder), rigid_bodies=bodies)
    robot = VirtualRobot(replace(model, effects=effects), "fixed")
    bus = Bus(robot.port, robot.profile)
    done = run_on_robot(bus, model, ARM_MOTION, cycles, folder, lambda: "", base="fixed", virtual=robot, seed=seed)
    assert done.played.stopped == ""
    return folder


def named(folder: Path, jobs=1):
    """Verdict, and effects with their places that diagnosis is sure of by half or more."""
    diagnosis = diagnose_session(load_session(folder), n_jobs=jobs).diagnosis
    return diagnosis.verdict, {(f.effect, f.where): f.confidence for f in diagnosis.findings if f.confidence >= 0.5}
