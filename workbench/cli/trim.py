"""`workbench trim RECORDING --gait MOTION`: a gait corrected to walk straight on the robot that was recorded."""

from __future__ import annotations

import argparse
import math
import sys

from workbench.cli.options import add_model, add_out, load_model, positive


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "trim",
        help="straighten a gait for the robot in a recording",
        description="Estimates from a recording of a certified gait (a metre of walking is enough) how much the robot "
        "veers, and writes the same gait with a corrected turn in each stance, certified again: gait.csv, "
        "certificate.json and a page. The change follows from the recorded heading per metre, its scatter from cycle to cycle, "
        "and how the gait responds to its turn on the model. Trim the result again with the next recording.")
    parser.add_argument("recording", metavar="RECORDING",
                        help="recording of the base's rigid body while the robot walks the gait")
    parser.add_argument("--gait", metavar="MOTION", required=True,
                        help="the gait.csv that was played; its certificate is read from the same folder")
    parser.add_argument("--ensemble", metavar="FILE", help="YAML file of the random robot variants for the certificate "
                        "(default: the bundled one)")
    parser.add_argument("--effort", type=positive, default=4, metavar="N", help="1 for a short certificate (default: 4)")
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    add_model(parser)
    add_out(parser, default="runs/trim")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Reads, trims, certifies, writes, and prints what to expect."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.gait.certificate import check_certificate
    from workbench.gait.engines import other_engine
    from workbench.gait.ensemble import load_ensemble
    from workbench.gait.machine import GaitMachine
    from workbench.gait.optimize import Optimized, options_of, write_gait
    from workbench.gait.trim import read_gait, trim, turn_in
    from workbench.motion import load_motion
    from workbench.view.report.gait import write_gait_page

    model = load_model(args.model, args.packages)
    check_certificate(args.gait, load_motion(args.gait, model), model)
    gait = read_gait(args.gait, model)
    machine, options = GaitMachine(model), options_of(args.effort, 0, args.jobs).certify
    ensemble = load_ensemble(args.ensemble)
    with output_directory(args.out) as folder, Progress("trim") as progress:
        progress("reading")
        recorded = turn_in(args.recording, model, load_motion(args.gait, model).as_table().period)
        done = trim(machine, gait, recorded, ensemble, options, progress, other_engine())
        progress("drawing")
        write_gait(folder, done.table, done.certified)
        write_gait_page(folder, model, Optimized(done.request, not done.problem, done.problem, done.table, done.certified, None))
    h, sd = math.degrees(recorded.heading), math.degrees(recorded.sd)
    print(f"recorded: {h:+.1f} deg/m (standard deviation {sd:.1f}) over {recorded.metres:.2f} m, {recorded.cycles} cycles")
    print(f"turn changed by {done.turn:+.4f} rad in a stance; expected now: {math.degrees(done.expected):+.1f} deg/m")
    if done.problem:
        print(f"workbench trim: error: {done.problem} (written to {args.out})", file=sys.stderr)
        return 2
    print(done.certified.certificate.summary())
    print(f"wrote {args.out}: open {args.out / 'report.html'}")
    return 0
