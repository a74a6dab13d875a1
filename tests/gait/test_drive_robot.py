"""A steered gait on the controller's program: tables within its reach, the emulated board in the loop, blind cameras."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.firmware.image import image, needs_compiler
from tests.firmware.native import core
from workbench.api.robot_drive import RobotDrive, drive_on_robot
from workbench.cli.main import main
from workbench.device.capture import Recorder
from workbench.device.capture.packets import BodyPose
from workbench.device.tables.table_file import encode_table, table_file
from workbench.files import InputError
from workbench.gait.drive.cameras import EmulatedCameras, MotiveCameras
from workbench.gait.drive.controller import CycleController
from workbench.gait.drive.family import GaitFamily, Steer, load_family
from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.step_map import StepMap
from workbench.gait.drive.walk import Cameras, Seen
from workbench.robot import EffectSpec, RobotModel, puppy_model

GAIT = Path(__file__).parents[2] / "data/gaits/demo/gait.csv"
MAP = StepMap(bias=0.0, gain=1.5, memory=0.15, ahead=0.05, aside=0.0, aside_gain=0.07, scatter=(0.013, 0.001), most=0.15)


def family(model: RobotModel) -> GaitFamily:
    return load_family(GAIT, model)


@needs_compiler
def test_every_change_that_the_plan_allows_is_within_the_programs_reach() -> None:
    """By the firmware's own check. It would refuse most poses of a swing, where servos are led by more than they can follow."""
    model, options = puppy_model(), DriveOptions()
    gaits, reach = family(model), core().table_reachable
    reach.restype = ctypes.c_bool
    turns = np.arange(-options.most, options.most + 1e-9, options.most / 3)
    sides = np.arange(-options.most_side, options.most_side + 1e-9, options.most_side / 2)
    steers = [Steer(float(u), float(s)) for u in turns for s in sides]
    change, side_change = options.most_change + 1e-9, options.most_side_change + 1e-9
    pairs = [(a, b) for a in steers for b in steers if abs(a.turn - b.turn) <= change and abs(a.side - b.side) <= side_change]
    for before, turn in pairs:
        last = table_file(gaits.cycle(before), model).table.goals[-1]
        goals = (ctypes.c_uint16 * len(last))(*last.tolist())
        assert reach(encode_table(table_file(gaits.cycle(turn, before), model, 4, True)), goals), (before, turn)
        assert reach(encode_table(table_file(gaits.stop(before), model, 1, True)), goals)
    cycle = gaits.cycle()
    swing = [np.roll(np.arange(len(cycle)), -k) for k in range(len(cycle))]
    rolled = [replace(cycle, goals=cycle.goals[k], speeds=cycle.speeds[k], dwells_ms=cycle.dwells_ms[k]) for k in swing]
    ways = [np.abs(t.goals[0] - t.goals[-1]).max() for t in rolled]
    assert ways[0] == min(ways)


class _Blinded(EmulatedCameras):
    """They lose the robot for good after some cycles."""

    sees = 3

    def seen(self) -> Seen:
        self.sees -= 1
        seen = super().seen()
        return replace(seen, captured=np.full(3, np.nan)) if self.sees < 0 else seen


def _driven(folder: Path, cameras: type[EmulatedCameras], stop: Any = lambda: "") -> tuple[RobotDrive, Any]:
    from workbench.device.virtual import SECOND
    from workbench.device.virtual.cm530 import Board
    from workbench.device.virtual.cm530.port import PcLinkPort
    from workbench.simulation.virtual_robot import VirtualRobot

    model = puppy_model()
    real = model.with_effects((EffectSpec("ground_friction", (), {"friction": 0.6}),))
    robot = VirtualRobot(real)
    board = Board(image(), robot.clock, robot.bus)
    board.power_on()
    board.run(robot.clock.now + SECOND // 2)
    gaits, path = family(model), WayPath([(0.35, 0.03)])
    controller = CycleController(path, MAP, gaits.period)
    done = drive_on_robot(PcLinkPort(board), model, gaits, path, controller, cameras(robot, Cameras(), 0), folder, stop,
                          virtual=robot)
    assert not board.violations
    board.run(robot.clock.now + 2 * SECOND)
    assert all(not servo["torque_enable"] for servo in robot.servos.values()), "nothing re-energises after the release"
    return done, robot


needs_board = pytest.mark.skipif(find_spec("unicorn") is None, reason="needs unicorn (the extra [emulator])")


@needs_compiler
@needs_board
@pytest.mark.slow
def test_the_image_walks_the_path_and_is_released(tmp_path: Path) -> None:
    done, _ = _driven(tmp_path, EmulatedCameras)
    assert done.arrived
    assert done.late == 0
    assert np.abs(np.diff(done.driven.turns)).max() > 0, "tables of different turns were played"
    assert done.driven.missed()[0] < 0.05
    assert done.log is not None
    assert done.log.is_file()


@needs_compiler
@needs_board
@pytest.mark.slow
def test_the_robot_stops_when_the_cameras_lose_it(tmp_path: Path) -> None:
    done, _ = _driven(tmp_path, _Blinded)
    assert done.driven.reason == "lost by the cameras"
    assert not done.arrived


@needs_compiler
@needs_board
@pytest.mark.slow
def test_ctrl_c_in_the_walk_brings_it_to_neutral_and_releases_it(tmp_path: Path) -> None:
    asked = iter(range(10**9))
    done, _ = _driven(tmp_path, EmulatedCameras, lambda: "Ctrl-C" if next(asked) > 9000 else "")
    assert done.driven.reason == "Ctrl-C"


def _motive(bodies: Mapping[str, tuple[np.ndarray, Rotation]], now: float = 0.0) -> Recorder:
    """A recorder whose stream shows these bodies, y up."""
    latest = {name: (0.0, BodyPose(1, tuple(p), tuple(R.as_quat()), 0.0, True)) for name, (p, R) in bodies.items()}
    return cast(Recorder, SimpleNamespace(latest=latest, link=SimpleNamespace(now=lambda: now)))


def test_motives_stream_becomes_the_pose_from_where_the_robot_started() -> None:
    """Whatever the capture's heading and the bodies' own rotations."""
    model, y_up = puppy_model(), Rotation.from_matrix([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    neutral = model.kinematics.forward(np.zeros(len(model.joints)), model.joints)
    capture, odd = Rotation.from_euler("z", 1.1), Rotation.from_euler("xyz", [0.2, -0.3, 0.5])

    def bodies(x: float, y: float, heading: float) -> dict[str, tuple[np.ndarray, Rotation]]:
        turned = Rotation.from_euler("z", heading)
        to_capture = y_up * capture
        places = {asset: turned.apply(neutral[link][0][0]) + np.array([x, y, 0.1]) for asset, link in model.rigid_bodies.items()}
        return {asset: (to_capture.apply(p), to_capture * turned * odd) for asset, p in places.items()}

    recorder = _motive(bodies(0.0, 0.0, 0.0))
    cameras = MotiveCameras(recorder, model)
    cameras.rest()
    assert cameras.seen().captured == pytest.approx(np.zeros(3), abs=1e-9)
    recorder.latest.update(_motive(bodies(0.5, -0.2, 0.4)).latest)
    base = neutral[model.base][0][0]
    moved = Rotation.from_euler("z", 0.4).apply(base) - base
    assert cameras.seen().captured == pytest.approx([0.5 + moved[0], -0.2 + moved[1], 0.4], abs=1e-9)
    recorder.link.now = lambda: 1.0  # type: ignore[method-assign]
    assert np.isnan(cameras.seen().captured).all()


def test_a_robot_that_cameras_do_not_see_is_refused() -> None:
    with pytest.raises(InputError, match="cameras see no rigid body"):
        MotiveCameras(_motive({}), puppy_model()).rest()


@pytest.mark.parametrize(("arguments", "said"), [
    (["--image", "x.bin"], "--image needs --port"),
    (["--port", "/dev/null"], "--motive"),
    (["--port", "/dev/null", "--motive", "h", "--draw", "1"], "--robot and --draw"),
    (["--robot", "fox"], "expected the links and joints of the robot of the gait (--model)"),
    (["--avoid", "1.1,0,0.3"], "way-point 1 (1, 0) lies in the disc to walk around, 0.3 m about (1.1, 0)"),
    (["--avoid", "3,3,0.1", "--avoid", "0,-0.1,0.2"], "the start (0, 0) lies in the disc to walk around, 0.2 m about (0, -0.1)"),
])
def test_options_that_do_not_fit_are_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str],
                                              tmp_path: Path) -> None:
    assert main(["drive", "1,0", "--gait", str(GAIT), "--out", str(tmp_path / "out"), *arguments]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--seed", "--draw"])
def test_a_seed_below_zero_is_one_line(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["drive", "1,0", "--gait", str(GAIT), option, "-1"])
    assert f"{option}: expected a whole number of at least 0" in capsys.readouterr().err
