"""`workbench drive`: a gait steered once a cycle along way-points, in simulation, on the emulated robot and on a real one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.cli.bus_options import VIRTUAL
from workbench.cli.options import add_model, add_out, load_model, positive, seed

if TYPE_CHECKING:
    from collections.abc import Callable

    from workbench.gait.drive.certify import FamilyCertificate
    from workbench.gait.drive.controller import CycleController
    from workbench.gait.drive.family import GaitFamily
    from workbench.gait.drive.loop import Driven
    from workbench.gait.drive.robot_walk import PoseSource
    from workbench.gait.drive.step_map import StepMap
    from workbench.robot import RobotModel
    from workbench.simulation.virtual_robot import VirtualRobot


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "drive",
        help="steer a gait along way-points, in simulation or on the robot",
        description="Steers an optimised gait once a cycle along a smooth path through way-points. A model-predictive "
        "controller on the gait's step-to-step map, fitted to rollouts of the model, chooses how much each cycle turns, two "
        "cycles ahead; it estimates the robot's own turning bias on the way. In simulation the robot may differ from the model "
        "(--robot, --draw) and is shown without steering, too. With --port the robot's CM-530 plays the gait: each table is sent "
        "while another plays, and checked by the controller's program. Writes drive.json and report.html.")
    parser.add_argument("points", metavar="X,Y", nargs="*", type=_point,
                        help="way-points [m]: x forward, y left of where the robot stands (put -- before a negative x)")
    parser.add_argument("--gait", metavar="MOTION", required=True,
                        help="gait.csv written by `workbench optimize`, in the same folder as its certificate")
    add_model(parser)
    parser.add_argument("--certify", action="store_true", help="certify the gait's turns over random robots, as --port requires, "
                        "and write family.json into the gait's folder; no way-points")
    parser.add_argument("--avoid", metavar="X,Y,R", type=_disc, action="append", default=[],
                        help="a disc on the floor to walk around, centre and radius [m]; repeatable")
    truth = parser.add_mutually_exclusive_group()
    truth.add_argument("--robot", metavar="MODEL", help="ground truth of the simulated robot, a model.yaml (default: the model)")
    truth.add_argument("--draw", type=seed, metavar="SEED", help="simulate a random variant of the robot, as for certificates")
    parser.add_argument("--law", choices=("mpc", "proportional"), default="mpc", help="controller (default: mpc)")
    parser.add_argument("--lost", type=_share, default=0.0, metavar="SHARE",
                        help="share of cycles without a pose, in simulation (default: 0)")
    parser.add_argument("--blind", type=_seconds, default=1.5, metavar="SECONDS",
                        help="stop after so long without a pose (default: 1.5)")
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="random seed of map and cameras (default: 0)")
    parser.add_argument("--cycles", type=positive, default=100, metavar="N", help="stop after so many cycles (default: 100)")
    parser.add_argument("--view", action="store_true", help="show path, plan and robot live in the browser (Meshcat)")
    parser.add_argument("--port", metavar="PORT", help="serial port of the PC link of the robot's CM-530, with the workbench's "
                        f"program, or `{VIRTUAL}`: an emulated one (default: simulation without a controller)")
    parser.add_argument("--image", metavar="FILE", help=f"with --port {VIRTUAL}: the program in the emulated CM-530")
    parser.add_argument("--motive", metavar="HOST", help="with --port: computer that runs Motive")
    parser.add_argument("--interface", metavar="ADDRESS", help="this computer's address on that network (default: by the route)")
    parser.add_argument("--force", action="store_true", help="with --port: drive even if the gait's certificate is not valid")
    add_out(parser, default="runs/drive")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fits the map, drives, and writes the page."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.gait.drive.controller import CycleController
    from workbench.gait.drive.family import load_family
    from workbench.gait.drive.options import DriveOptions
    from workbench.gait.drive.path import WayPath
    from workbench.gait.drive.plan import Disc, check_discs
    from workbench.view.report.drive import write_drive

    model = load_model(args.model, args.packages)
    family = load_family(args.gait, model)
    if args.certify:
        return _certify(args, family)
    path, discs = WayPath(args.points), [Disc(*d) for d in args.avoid]
    check_discs(path, discs)
    _check_port(args, model)
    certified = _load_certificate(args, model)
    options = DriveOptions(law=args.law, blind=args.blind)
    if certified:
        options = replace(options, most=certified.most, most_change=certified.most_change, most_side=certified.most_side,
                          most_side_change=certified.most_side_change)
    with output_directory(args.out) as folder, Progress("drive") as progress:
        robot = _robot(args, model, folder)
        step_map = certified.step_map if certified else _fit_map(args, family, progress)
        controller = CycleController(path, step_map, family.period, options, discs)
        watch = _viewer(model, controller) if args.view else None
        code, straight = 0, None
        if args.port is None:
            closed, straight = (_simulate(args, family, robot, controller, progress, steer, watch) for steer in (True, False))
        else:
            code, closed = _on_robot(args, model, robot, family, controller, folder, progress, watch)
        progress("drawing")
        write_drive(folder, model, step_map, closed, straight, options.most, controller.discs)
    misses = ", ".join(f"{100 * m:.1f}" for m in closed.missed())
    beside = "" if straight is None else f" (not steered: {', '.join(f'{100 * m:.1f}' for m in straight.missed())} cm)"
    print(f"stopped: {closed.reason}; way-points passed at {misses} cm{beside}")
    print(f"wrote {args.out}: open {args.out / 'report.html'}")
    return code


def _certify(args: argparse.Namespace, family: GaitFamily) -> int:
    import tempfile

    from workbench.cli.progress import Progress
    from workbench.files import InputError
    from workbench.gait.drive.certify import certify_family, gait_sha256
    from workbench.gait.ensemble import load_ensemble

    if args.points:
        raise InputError(None, "--certify takes no way-points")
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder, Progress("drive") as progress:
        certificate = certify_family(family, gait_sha256(args.gait), load_ensemble(), Path(folder), args.seed, progress=progress)
    written = certificate.write(Path(args.gait).parent)
    print(certificate.summary())
    print(f"wrote {written}")
    return 0 if certificate.kept else 2


def _load_certificate(args: argparse.Namespace, model: RobotModel) -> FamilyCertificate | None:
    """The family's certificate; None where it is not required (in simulation, or with --force) and missing or not valid."""
    from workbench.cli.progress import warn
    from workbench.files import InputError
    from workbench.gait.drive.certify import FILE, read_family

    try:
        return read_family(args.gait, model)
    except InputError as e:
        if args.port is not None and not args.force:
            raise InputError(e.source, f"{e.problem}; use --force to drive anyway") from None
        if (Path(args.gait).parent / FILE).is_file():
            warn("drive", [str(e)])
        return None


def _fit_map(args: argparse.Namespace, family: GaitFamily, progress: Callable[..., None]) -> StepMap:
    from workbench.gait.drive.step_map import fit_step_map

    progress("fitting the step-to-step map")
    return fit_step_map(family, family.machine.model, args.seed)


def _check_port(args: argparse.Namespace, model: RobotModel) -> None:
    """Checks the gait's certificate, and that the options fit together; InputError if not."""
    from workbench.cli.check import check_certificate_of
    from workbench.files import InputError
    from workbench.motion import load_motion

    if args.port is None:
        given = [f"--{name}" for name in ("image", "motive", "interface", "force") if getattr(args, name)]
        if given:
            raise InputError(None, f"{given[0]} needs --port")
        return
    if args.port != VIRTUAL and (args.robot or args.draw is not None):
        raise InputError(None, "--robot and --draw are for simulated robots; --port names a real one")
    if args.port != VIRTUAL and not args.motive:
        raise InputError(None, "a real robot is steered by what cameras see: name the computer that runs Motive with --motive")
    check_certificate_of("drive", args.gait, load_motion(args.gait, model), model, args.force)


def _simulate(args: argparse.Namespace, family: GaitFamily, robot: RobotModel, controller: CycleController,
               progress: Callable[..., None], steer: bool, watch: Any) -> Driven:
    from workbench.gait.drive.loop import drive
    from workbench.gait.drive.walk import Cameras, SimulatedWalk

    progress("driving" if steer else "without steering")
    walk = SimulatedWalk(family, robot, Cameras(lost=args.lost), args.seed)
    return drive(walk, controller.path, controller, args.cycles, steer, watch=watch if steer else None)


def _on_robot(args: argparse.Namespace, model: RobotModel, robot: RobotModel, family: GaitFamily, controller: CycleController,
              folder: Path, progress: Callable[..., None], watch: Any) -> tuple[int, Driven]:
    from workbench.api.robot_drive import drive_on_robot
    from workbench.cli.bus_options import open_pc_link
    from workbench.device.stop import stop_on_signals

    virtual = _virtual(args, robot)
    with (stop_on_signals() as stop, _cameras(args, model, virtual, folder) as cameras, open_pc_link(args, virtual) as port):
        done = drive_on_robot(port, model, family, controller.path, controller, cameras, folder, lambda: stop.reason,
                              virtual=virtual, most_cycles=args.cycles, progress=progress, watch=watch)
    for warning in done.warnings:
        print(f"workbench drive: warning: {warning}", file=sys.stderr)
    return (0 if done.arrived else 130 if stop.interrupted else 2), done.driven


def _virtual(args: argparse.Namespace, robot: RobotModel) -> VirtualRobot | None:
    from workbench.simulation.virtual_robot import VirtualRobot

    return VirtualRobot(robot, "free") if args.port == VIRTUAL else None


@contextmanager
def _cameras(args: argparse.Namespace, model: RobotModel, virtual: VirtualRobot | None, folder: Path) -> Iterator[PoseSource]:
    """The emulated robot's, or Motive's, whose whole recording is kept in `folder`."""
    from workbench.device.capture import BackgroundRecording, Recorder, UdpLink
    from workbench.gait.drive.cameras import EmulatedCameras, MotiveCameras
    from workbench.gait.drive.walk import Cameras

    if virtual is not None:
        yield EmulatedCameras(virtual, Cameras(lost=args.lost), args.seed)
        return
    recorder = Recorder(UdpLink(args.motive, args.interface))
    cameras, recording = MotiveCameras(recorder, model), BackgroundRecording(recorder, folder / "driven.csv")
    recording.start()
    try:
        yield cameras
    finally:
        recording.stop()


def _viewer(model: RobotModel, controller: CycleController) -> Any:
    from workbench.view.scene.drive import DriveScene

    scene = DriveScene(model, controller.path, controller.discs)
    print(f"open {scene.url}", file=sys.stderr)
    return scene.show


def _robot(args: argparse.Namespace, model: RobotModel, folder: Path) -> RobotModel:
    from workbench.gait.ensemble import load_ensemble

    if args.robot:
        robot = load_model(args.robot, args.packages)
        robot.check_build(model, "the robot of the gait (--model)")
        return robot
    return model if args.draw is None else load_ensemble().draws(model, 1, args.draw, folder)[0]


def _point(text: str) -> tuple[float, ...]:
    return _numbers(text, 2, "a way-point X,Y in metres")


def _disc(text: str) -> tuple[float, ...]:
    x, y, radius = _numbers(text, 3, "a disc X,Y,R in metres")
    if radius <= 0:
        raise argparse.ArgumentTypeError(f"expected a radius above 0, got {text[:40]}")
    return x, y, radius


def _numbers(text: str, count: int, expected: str) -> tuple[float, ...]:
    from workbench.files.numerals import number_of

    values = [number_of(v) for v in text.split(",")]
    if len(values) != count or None in values:
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text[:40]}")
    return tuple(float(v or 0.0) for v in values)


def _share(text: str) -> float:
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not 0 <= value < 1:
        raise argparse.ArgumentTypeError(f"expected a share from 0 to below 1, got {text[:40]}")
    return value


def _seconds(text: str) -> float:
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not 0 < value <= 60:
        raise argparse.ArgumentTypeError(f"expected seconds above 0, at most 60, got {text[:40]}")
    return value
