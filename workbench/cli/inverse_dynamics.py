"""`workbench inverse-dynamics INPUT`: the torques and contact forces that a motion requires."""

from __future__ import annotations

import argparse
import sys

from workbench.cli.check import add_yes, check_files, check_session
from workbench.cli.options import PUPPY, add_cycles, add_model, add_out, load_model
from workbench.cli.torque_log import report_torque_logs, torque_logs


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "inverse-dynamics",
        help="joint torques, contact forces, base wrench residual, servo margins",
        description="From a take or a motion: the torque of each joint, contact forces inside the friction cone, the residual "
        "wrench on the base that no such contact explains, and the margin of each servo's torque and speed. A motion on a free "
        "base is first simulated with ideal joints, since the motion alone does not determine how the body moves.",
    )
    parser.add_argument("input", metavar="INPUT", help="a motion, a rollout, a recording, a log of angles and torques without "
                        "goals, or a session.yaml with --take")
    parser.add_argument("--take", metavar="NAME", help="take of the session")
    parser.add_argument("--motion", metavar="FILE", help="motion played in the recording, if the recording does not name it")
    add_model(parser, "the bundled puppy; with --take the session's own")
    parser.add_argument("--base", choices=("free", "fixed"), default="free", help="base of a motion or recording (default: free)")
    add_cycles(parser, 1)
    add_yes(parser)
    add_out(parser, default="runs/inverse-dynamics")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Computes, writes the table and the figures, and prints the margins."""
    from workbench.api.forces import forces_of_file, forces_of_take
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.compare.session import load_session
    from workbench.dynamics import save_inverse_dynamics
    from workbench.view.figures import save_figure
    from workbench.view.report.forces import force_figures, margin_table

    if not args.take and torque_logs([args.input]):
        return report_torque_logs("inverse-dynamics", [args.input], load_model(args.model, args.packages), args.out)
    if args.take:
        check_session("inverse-dynamics", load_session(args.input), args.yes)
    else:
        check_files("inverse-dynamics", (args.input, *([args.motion] if args.motion else [])),
                    load_model(args.model, args.packages), args.cycles, args.yes)
    stages = ("simulating", "inverse dynamics", "writing")
    with output_directory(args.out) as folder, Progress("inverse-dynamics", stages=stages) as progress:
        if args.take:
            other = None if args.model == PUPPY else load_model(args.model, args.packages)
            model, result = forces_of_take(args.input, args.take, progress, other)
        else:
            model = load_model(args.model, args.packages)
            result = forces_of_file(args.input, model, args.base, args.cycles, args.motion, progress)
        progress("writing")
        written = [save_inverse_dynamics(result, folder / "inverse_dynamics.csv")]
        written += [save_figure(figure, folder / f"{name}.png") for name, figure in force_figures(result, model).items()]
    for problem in result.problems:
        print(f"workbench inverse-dynamics: warning: {problem}", file=sys.stderr)
    print(margin_table(result))
    print(f"wrote {args.out}: {', '.join(path.name for path in written)}")
    return 0
