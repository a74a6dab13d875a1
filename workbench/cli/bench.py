"""`workbench bench`: the speeds that the documentation states, measured side by side."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the speeds stated in the documentation",
        description="Prints each figure with its target as JSON, all measured alternately in one run: the station with the "
        "full servo law against a bare Drake plant with PD control at the same step, and against MuJoCo at the same joint "
        "error; the fast servo and larger steps; the Motive reader against pandas; 64 rollouts on two processes against one; a "
        "fit against MuJoCo's system identification; where a diagnosis spends its time. Takes minutes, and needs a quiet "
        "machine.",
    )
    parser.add_argument("--quick", action="store_true", help="smoke test of a few seconds; the figures are meaningless")
    parser.add_argument("--out", metavar="FILE", type=Path, help="also write the JSON to FILE")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measures, prints and writes."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.files import InputError

    try:
        benchmarks = import_module("benchmarks.run")  # imported by name: it is in the repository but not in the installed package
    except ModuleNotFoundError as e:
        if e.name != "benchmarks":
            raise
        raise InputError(None, "the benchmarks are not part of the installed package; run `workbench bench` from a clone of "
                               "the repository") from None
    if args.out is not None and args.out.is_dir():
        raise InputError(args.out, "expected a file to write, found a directory")
    with ExitStack() as stack:
        folder = None if args.out is None else stack.enter_context(output_directory(args.out.parent))
        text = json.dumps(benchmarks.run_bench(args.quick, stack.enter_context(Progress("bench"))), indent=2)
        if folder is not None:
            (folder / args.out.name).write_text(text + "\n", encoding="utf-8")
    print(text)
    return 0
