"""`workbench drive`: a gait steered once a cycle along way-points, in simulation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.options import add_model, add_out, load_model, positive

if TYPE_CHECKING:
    from workbench.robot import RobotModel


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "drive",
        help="steer a gait along way-points, in simulation",
        description="Steers an optimised gait once a cycle along a smooth path through way-points. A model-predictive "
        "controller on the gait's step-to-step map, fitted to rollouts of the model, chooses how much each cycle turns, two "
        "cycles ahead; it estimates the robot's own turning bias on the way. The simulated robot may differ from the model "
        "(--robot, --draw). Writes drive.json and report.html, which also show the same robot without steering. Does not move a "
        "real robot yet.")
    parser.add_argument("points", metavar="X,Y", nargs="+", type=_point,
                        help="way-points [m]: x forward, y left of where the robot stands (put -- before a negative x)")
    parser.add_argument("--gait", metavar="MOTION", required=True,
                        help="gait.csv written by `workbench optimize`, in the same folder as its certificate")
    add_model(parser)
    truth = parser.add_mutually_exclusive_group()
    truth.add_argument("--robot", metavar="MODEL", help="ground truth of the simulated robot, a model.yaml (default: the model)")
    truth.add_argument("--draw", type=int, metavar="SEED", help="simulate a random variant of the robot, as for certificates")
    parser.add_argument("--law", choices=("mpc", "proportional"), default="mpc", help="controller (default: mpc)")
    parser.add_argument("--lost", type=_share, default=0.0, metavar="SHARE", help="share of cycles without a pose (default: 0)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="random seed of map and cameras (default: 0)")
    parser.add_argument("--cycles", type=positive, default=100, metavar="N", help="stop after so many cycles (default: 100)")
    add_out(parser, default="runs/drive")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fits the map, drives with and without steering, and writes the page."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.gait.drive.controller import CycleController
    from workbench.gait.drive.family import load_family
    from workbench.gait.drive.loop import drive
    from workbench.gait.drive.options import DriveOptions
    from workbench.gait.drive.path import WayPath
    from workbench.gait.drive.step_map import fit_step_map
    from workbench.gait.drive.walk import Cameras, SimulatedWalk
    from workbench.view.report.drive import write_drive

    path = WayPath(args.points)
    model = load_model(args.model, args.packages)
    family, options = load_family(args.gait, model), DriveOptions(law=args.law)
    with output_directory(args.out) as folder, Progress("drive") as progress:
        robot = _robot(args, model, folder)
        progress("fitting the step-to-step map")
        step_map = fit_step_map(family, model, args.seed)
        runs = []
        for steer, name in ((True, "driving"), (False, "without steering")):
            progress(name)
            controller = CycleController(path, step_map, family.period, options)
            walk = SimulatedWalk(family, robot, Cameras(lost=args.lost), args.seed)
            runs.append(drive(walk, path, controller, args.cycles, steer))
        closed, straight = runs
        progress("drawing")
        write_drive(folder, model, step_map, closed, straight, options.most)
    misses = ", ".join(f"{100 * m:.1f}" for m in closed.missed())
    print(f"stopped: {closed.reason}; way-points passed at {misses} cm (not steered: "
          f"{', '.join(f'{100 * m:.1f}' for m in straight.missed())} cm)")
    print(f"wrote {args.out}: open {args.out / 'report.html'}")
    return 0


def _robot(args: argparse.Namespace, model: RobotModel, folder: Path) -> RobotModel:
    from workbench.gait.ensemble import load_ensemble

    if args.robot:
        return load_model(args.robot, args.packages)
    return model if args.draw is None else load_ensemble().draws(model, 1, args.draw, folder)[0]


def _point(text: str) -> tuple[float, float]:
    from workbench.files.numerals import number_of

    values = [number_of(v) for v in text.split(",")]
    if len(values) != 2 or None in values:
        raise argparse.ArgumentTypeError(f"expected a way-point X,Y in metres, got {text[:40]}")
    return float(values[0] or 0.0), float(values[1] or 0.0)


def _share(text: str) -> float:
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not 0 <= value < 1:
        raise argparse.ArgumentTypeError(f"expected a share from 0 to below 1, got {text[:40]}")
    return value
