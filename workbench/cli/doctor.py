"""`workbench doctor`: checks this machine and suggests fixes."""

from __future__ import annotations

import argparse
import json


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "doctor",
        help="check this installation and suggest fixes",
        description="Checks versions, cores, memory, disk, the cache of compiled rollouts, Meshcat, the second engine and shell "
        "completion, and suggests how to install anything missing. Exits with 2 if something prevents the workbench from "
        "working.")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--compile", action="store_true",
                        help="compile the rollouts now (about a minute, once for each version), so that no later command waits")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Examines the installation and prints the result."""
    from workbench.api.doctor import compile_rollouts, examine
    from workbench.cli.defaults import defaults_file

    if args.compile:
        compile_rollouts()
    health = examine(defaults_file())
    print(json.dumps(health.as_dict(), indent=2) if args.json else health.as_text())
    return 0 if health.works else 2
