"""`workbench predict SESSION --model M.yaml`: predicts takes that the model was not fitted to."""

from __future__ import annotations

import argparse

from workbench.cli.check import add_yes, check_session, say_left_out
from workbench.cli.options import add_out, add_packages, load_model, positive


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "predict",
        help="predict the takes that a session lists",
        description="Plays each entry of the session's `predict` on a fitted model and writes NAME.csv: a Motive CSV as the "
        "cameras of the entry's start file would see it, or for `commands` a joint log with their times.",
    )
    parser.add_argument("session", metavar="SESSION", help="session.yaml, or its folder")
    parser.add_argument("--model", metavar="M.yaml", help="fitted model (default: the session's own, with nothing added)")
    parser.add_argument("--contact", choices=("point", "hydroelastic"), default="point",
                        help="foot-ground contact model (default: point)")
    add_packages(parser)
    add_yes(parser)
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    add_out(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Simulates and writes."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.compare.prediction import predict_session
    from workbench.compare.session import load_session
    from workbench.simulation import SimulationConfig

    session = load_session(args.session)
    model = session.model if args.model is None else load_model(args.model, args.packages)
    warned = check_session("predict", session, args.yes)
    with output_directory(args.out) as folder, Progress("predict", stages=("finding", "simulating")) as progress:
        config = SimulationConfig(contact=args.contact, engine="drake")
        predicted = predict_session(session, model, folder, progress, config=config, n_jobs=args.jobs)
    say_left_out("predict", predicted.left_out, warned)
    print(f"wrote {args.out}: {', '.join(path.name for path in predicted.paths)}")
    return 0
