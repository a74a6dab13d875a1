"""`workbench new-robot URDF`: the files of a session for a robot of your own."""

from __future__ import annotations

import argparse
from pathlib import Path

from workbench.cli.options import add_packages


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "new-robot",
        help="write session.yaml and servo.yaml for a robot of your own",
        description="Writes session.yaml and servo.yaml for a robot described by an SDF or URDF, with the constants that its "
        "servo's maker states, and lists its guesses and the facts that only you know. Existing files are not changed.",
    )
    parser.add_argument("description", metavar="URDF")
    parser.add_argument("--servo", required=True, metavar="TYPE", help="LX-16A, STS3215, XL-430 …; an unknown one lists all")
    parser.add_argument("--take", action="append", default=[], metavar="FILE", help="a recording of it; may be repeated")
    parser.add_argument("--base", choices=("free", "fixed"), help="whether the robot walked, or its base was held")
    add_packages(parser)
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder for both files; default: this one")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Writes and reports."""
    from workbench.api.new_robot import new_robot

    made = new_robot(args.description, args.servo, args.out, args.take, args.base, dict(args.packages))
    for title, lines in (("taken from the description", made.guessed), ("left for you", made.missing)):
        print(f"{title}:")
        for line in lines:
            print(f"  {line}")
    print(f"wrote {', '.join(map(str, made.files))}; next: workbench inspect {args.out / 'session.yaml'}")
    return 0
