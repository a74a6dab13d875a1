"""`workbench demo`: compares, diagnoses and optimises on bundled data."""

from __future__ import annotations

import argparse

from workbench.cli.options import add_out


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "demo",
        help="simulate, compare, diagnose and find a gait on bundled data, with a report to open at the end",
        description="Plays the ROBOTIS walk with the servo law and with ideal joints, in point and in hydroelastic contact, "
        "compares it with a bundled synthetic recording, finds the physics missing from the model of an arm, writes the "
        "walk as firmware tables, searches for a new gait, and puts all of it into one report. A few minutes.",
    )
    add_out(parser, default="runs/demo")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs it, and prints the table and the report's path."""
    from workbench.api.demo.page import run_demo
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress

    with output_directory(args.out) as folder, Progress("demo") as progress:
        demo = run_demo(folder, progress)
    print(demo.table)
    print(f"\nagainst the bundled synthetic recording: {demo.finding}")
    print(f"diagnosis of the bundled arm: {demo.diagnosed}")
    print(f"\nwrote {args.out}: open {args.out / demo.page.name}")
    return 0
