"""`workbench inspect FILE`: identifies and checks a file."""

from __future__ import annotations

import argparse
import json
import sys

from workbench.cli.options import add_packages


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "inspect",
        help="identify and check a file",
        description="Recognises a file by its content and reports kind, version, units, rate, frames, assets or joints, share of "
        "gaps, and problems. FILE is a recording (Motive CSV, joint log, BAM log, SAGE), a motion table, a .mtn file, a rollout, "
        "a robot model (SDF, URDF or package://puppy/puppy.sdf), a session.yaml, model.yaml or servo.yaml, or a folder of "
        "firmware tables.",
    )
    parser.add_argument("file", metavar="FILE")
    add_packages(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Prints the inspection; returns 2 for a session that other verbs would refuse."""
    from workbench.inspect.recognise import inspect_file

    inspection = inspect_file(args.file, dict(args.packages))
    print(json.dumps(inspection.as_dict(), indent=2, allow_nan=False) if args.json else inspection.as_text())
    if inspection.unusable:
        print(f"workbench inspect: error: {args.file}: {inspection.unusable}", file=sys.stderr)
        return 2
    return 0
