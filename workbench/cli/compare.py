"""`workbench compare SESSION` and `workbench compare A B`: how far takes differ."""

from __future__ import annotations

import argparse

from workbench.cli.check import add_yes, check_files, check_session, say_left_out
from workbench.cli.options import PUPPY, add_cycles, add_engine, add_model, add_out, load_model, positive
from workbench.cli.torque_log import report_torque_logs, torque_logs

STAGES = ("reading", "simulating", "registering", "comparing", "drawing")


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "compare",
        help="compare recordings with the simulation, or any two takes",
        description="Compares every take of a session with its simulation, or any two recordings, motions or rollouts with each "
        "other, and writes comparison.json and report.html: error of each joint and of the body's path, with the recording's "
        "noise, the simulation's numerical floor and the spread between contact models.",
    )
    parser.add_argument("a", metavar="SESSION|A", help="session.yaml or its folder; a recording, motion or rollout; or a log of "
                        "angles and torques without goals, weighed against --model")
    parser.add_argument("b", metavar="B", nargs="?", help="what to compare A with: a recording, motion or rollout")
    add_model(parser, "the session's own; of two files, the bundled puppy")
    parser.add_argument("--contact", choices=("point", "hydroelastic"), default="point",
                        help="foot-ground contact model (default: point)")
    parser.add_argument("--base", choices=("free", "fixed"),
                        help="base of A and B; a session specifies its own (default: free)")
    add_cycles(parser, 1)
    add_yes(parser)
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    add_engine(parser, "compiled rollouts for the finer steps of a session's numerical floor, where they agree with Drake")
    add_out(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Compares, writes, and prints the table."""
    from workbench.api.sessions import compare_session
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress, warn
    from workbench.compare.compare_files import compare_files
    from workbench.compare.session import load_session
    from workbench.simulation import SimulationConfig
    from workbench.view.report.comparison import write_comparison

    if torque_logs([args.a, args.b]):
        files = [file for file in (args.a, args.b) if file is not None]
        return report_torque_logs("compare", files, load_model(args.model, args.packages), args.out)
    config = SimulationConfig(contact=args.contact, engine="drake")
    warned: frozenset[str] = frozenset()
    with output_directory(args.out, need=16 << 20) as folder, Progress("compare", stages=STAGES) as progress:
        if args.b is None:
            session = load_session(args.a)
            if args.model != PUPPY:
                session = session.with_model(load_model(args.model, args.packages))
            warned = check_session("compare", session, args.yes)
            unused = [name for name in ("base", "cycles") if getattr(args, name) is not None]
            warn("compare", [f"--{name} has no effect: each take of {session.path} has its own" for name in unused])
            result = compare_session(session, config, progress=progress, jobs=args.jobs,
                                     finer_steps="drake" if args.engine == "drake" else "judged")
            comparison, written = result.comparison, result.save(folder, progress)
        else:
            model = load_model(args.model, args.packages)
            check_files("compare", (args.a, args.b), model, args.cycles, args.yes)
            comparison = compare_files(args.a, args.b, model, config, cycles=args.cycles, base=args.base or "free",
                                       progress=progress, n_jobs=args.jobs)
            written = write_comparison(comparison, model, folder, f"{args.a} and {args.b}", progress)
    print(comparison.table())
    say_left_out("compare", comparison.left_out, warned)
    print(f"wrote {args.out}: {', '.join(path.name for path in written)}")
    return 0
