"""`workbench optimize`: a gait that the servos can follow, as a table with a certificate."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from workbench.cli.check import check_model
from workbench.cli.options import PUPPY, add_model, add_out, load_model, positive, seed

if TYPE_CHECKING:
    from workbench.gait.optimize import OptimizeOptions
    from workbench.gait.request import Request
    from workbench.robot import RobotModel


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "optimize",
        help="search for a gait that the servos can follow, as a certified table",
        description="Searches for a gait as the table of poses that the firmware plays, within the limits of joints, servos and "
        "supply, on random variants of the robot (an ensemble), and certifies it: gait.csv (from neutral into the "
        "gait, the cycle, and back), certificate.json and a page. If a request cannot be met, the command names the binding "
        "limit and exits with 2. An interrupted run continues when it is called again with the same arguments.")
    parser.add_argument("--speed", type=_parse_speed, metavar="V|max",
                        help="at least V m/s, or as fast as possible (default: max)")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--backward", action="store_true", help="walk backwards")
    way.add_argument("--sideways", action="store_true", help="walk to the left, or with --right to the right")
    way.add_argument("--turn", type=_parse_speed, metavar="RATE|max", help="turn on the spot to the left, at least RATE deg/s; "
                     "with --speed V, along an arc")
    way.add_argument("--arc", type=_positive, metavar="R", help="follow a circle of radius R m to the left")
    parser.add_argument("--right", action="store_true", help="turn, arc or sideways to the right")
    parser.add_argument("--slope", type=_angle, default=0.0, metavar="DEG", help="slope, positive uphill (default: 0)")
    parser.add_argument("--rms", type=_positive, metavar="NM", help="largest RMS torque of each servo (default: half of that at "
                        "full duty; ROBOTIS recommends a fifth)")
    best = parser.add_mutually_exclusive_group()
    best.add_argument("--least-energy", action="store_true", help="minimise electrical power, at the required speed or that of "
                      "the ROBOTIS walk")
    best.add_argument("--smoothest", action="store_true", help="minimise base jerk (speed as for --least-energy)")
    best.add_argument("--gentlest", action="store_true", help="minimise RMS torque (speed as for --least-energy)")
    parser.add_argument("--knees", choices=("any", "built"), default="any", help="built: all bend backward, as on the real robot")
    parser.add_argument("--ensemble", metavar="FILE", help="YAML file of the random robot variants on which the gait must work "
                        "(default: the bundled one)")
    parser.add_argument("--method", choices=("search", "plan", "both"), default="search", help="plan: joint paths of trajectory "
                        "optimisation as tables, without a search; both: a search that also starts from those (default: search)")
    parser.add_argument("--start", metavar="MOTION", help="the gait.csv of another gait: the search starts there instead of from "
                        "random gaits; its certificate is read from the same folder")
    parser.add_argument("--map", metavar="FILE", nargs="?", const="", help="map.json of a map of gaits: the search also starts "
                        "from its nearest gait (without FILE: the map of the puppy that ships)")
    parser.add_argument("--effort", type=positive, default=4, metavar="N",
                        help="search effort: 1 for a first look, more for longer (default: 4)")
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="random seed (default: 0)")
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    add_model(parser)
    add_out(parser, default="runs/optimize")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Searches, certifies, writes, and prints the result."""
    from workbench.cli.output import memory_folder, output_directory
    from workbench.cli.progress import Progress
    from workbench.gait.engines import other_engine
    from workbench.gait.ensemble import load_ensemble
    from workbench.gait.machine import GaitMachine
    from workbench.gait.optimize import MEMORY, optimize, write_gait
    from workbench.robot.model_file import load_model_file
    from workbench.view.report.gait import write_gait_page

    model = load_model(args.model, args.packages)
    check_model("optimize", model)
    posterior = load_model_file(args.model).posterior if _is_model_file(args.model) else None
    machine, ensemble = GaitMachine(model), load_ensemble(args.ensemble, posterior)
    request = _request(args, model)
    options = _options(args, model, request)
    with output_directory(args.out) as folder, memory_folder(args.out), Progress("optimize") as progress:
        result = optimize(machine, request, ensemble, options, progress, args.out / MEMORY, other_engine())
        if result.table is not None and result.certified is not None:
            progress("drawing")
            write_gait(folder, result.table, result.certified)
            write_gait_page(folder, model, result)
    if not result.met:
        where = f" (written to {args.out})" if result.table is not None else ""
        print(f"workbench optimize: error: {result.problem}{where}", file=sys.stderr)
        return 2
    assert result.certified is not None
    print(result.certified.certificate.summary())
    print(f"wrote {args.out}: open {args.out / 'report.html'}")
    return 0


def _options(args: argparse.Namespace, model: RobotModel, request: Request) -> OptimizeOptions:
    """Size, method and starting point of the search."""
    from dataclasses import replace

    from workbench.files import InputError
    from workbench.gait.certificate import read_shape
    from workbench.gait.gait_map import load_map
    from workbench.gait.optimize import options_of
    from workbench.robot import data_file

    options = replace(options_of(args.effort, args.seed, args.jobs), method=args.method)
    for given in ("start", "map"):
        if args.method == "plan" and getattr(args, given) is not None:
            raise InputError(None, f"--{given} with --method plan: expected a method that searches")
    if args.map is not None:
        options = replace(options, given=(load_map(args.map or data_file("gaits/map.json"), model).start_for(request),))
    if args.start is None:
        return options
    return replace(options, given=(*options.given, read_shape(args.start)), planned=False,
                   budget=replace(options.budget, seeds=0))


def _request(args: argparse.Namespace, model: RobotModel) -> Request:
    from workbench.files import InputError
    from workbench.gait.limits import GaitLimits
    from workbench.gait.optimize import walk_speed
    from workbench.gait.request import Aim, Request, Way

    way: Way = "forward"
    for name, asked in (("backward", args.backward), ("sideways", args.sideways), ("turn", args.turn), ("arc", args.arc)):
        way = name if asked else way  # type: ignore[assignment]
    aim: Aim = "energy" if args.least_energy else "smoothness" if args.smoothest else "gentleness" if args.gentlest else "speed"
    speed = None if args.speed in (None, math.inf) else args.speed
    radius = args.arc
    if way == "turn" and args.speed is not None:
        if speed is None or args.turn == math.inf:
            raise InputError(None, "--turn with --speed: expected a rate in deg/s and a speed in m/s, neither of them max")
        way, radius = "arc", speed / math.radians(args.turn)
    elif way == "turn":
        speed = None if args.turn == math.inf else math.radians(args.turn)
    elif aim != "speed" and speed is None:
        speed = walk_speed(model)
    return Request(way=way, speed=speed, radius=radius, right=args.right, slope=math.radians(args.slope), aim=aim,
                   built_knees=args.knees == "built", limits=GaitLimits(rms=args.rms))


def _is_model_file(name: str) -> bool:
    from pathlib import Path

    from workbench.files.yaml_file import read_yaml

    if name == PUPPY or Path(name).suffix.lower() not in (".yaml", ".yml"):
        return False
    content = read_yaml(name)
    return isinstance(content, dict) and {"takes", "predict"}.isdisjoint(content)


def _parse_speed(text: str) -> float:
    """A positive number or `max`, for argparse."""
    return math.inf if text == "max" else _positive(text)


def _angle(text: str) -> float:
    """A number, for argparse."""
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a number of degrees, got {text[:40]}")
    return value


def _positive(text: str) -> float:
    from workbench.files.numerals import number_of

    value = number_of(text)
    if value is None or not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text[:40]}")
    return value
