"""`workbench diagnose SESSION`: which physics the model left out."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from workbench.cli.check import add_yes, check_session, say_left_out
from workbench.cli.options import add_engine, add_out, folder, positive

if TYPE_CHECKING:
    from workbench.identify.results.findings import Finding
    from workbench.identify.results.servo_law import UnknownTorque


STAGES = ("reading", "simulating", "looking again", "numbers", "rolling out whole", "rolling out the fitted", "drawing")
"""A search goes back and forth between its stages; the last one begun is shown."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "diagnose",
        help="find the physics that a session's model left out",
        description="Locates where recordings and model differ, tries every known effect where it could act, fits the likely "
        "ones, keeps those that lower the error on held-out data, and writes findings.json, model.yaml, nominal.yaml, "
        "predictions and report.html. An interrupted run continues when it is called again.",
    )
    parser.add_argument("session", metavar="SESSION", help="session.yaml, or its folder")
    add_yes(parser)
    add_out(parser)
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    parser.add_argument("--memory", metavar="DIR", type=folder, help="directory for cached rollouts, shared by diagnoses of "
                        "the same takes (default: next to --out, deleted on success)")
    parser.add_argument("--thorough", action="store_true",
                        help="search to the end, however long it takes (default: stop at a limit of work, and report it)")
    parser.add_argument("--without", metavar="EFFECT", action="append", default=[],
                        help="exclude this effect (a name from section 7 of docs/formats.md) from the search, because you know "
                        "it is absent; repeatable")
    parser.add_argument("--model", metavar="FILE", dest="previous",
                        help="model.yaml of an earlier diagnosis of this robot, taken as nominal with its uncertainties: "
                        "findings are the changes since then")
    add_engine(parser, "compiled rollouts, judged by Drake")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Diagnoses, predicts and writes."""
    options = {"thorough": args.thorough, "memory": args.memory, "without": tuple(args.without), "yes": args.yes,
               "previous": args.previous, "engine": args.engine}
    return diagnose_and_report(args.session, args.out, args.jobs, **options)


def diagnose_and_report(path: str | Path, out: Path, jobs: int, *, thorough: bool = False, memory: Path | None = None,
                        without: tuple[str, ...] = (), yes: bool = False, previous: str | None = None,
                        engine: Literal["auto", "drake"] = "auto") -> int:
    """Diagnoses the session at `path`, writes the results into `out` and prints the verdict; returns the exit code.

    The other arguments are the options of the verb `diagnose`."""
    from workbench.api.sessions import DiagnoseOptions, diagnose
    from workbench.cli.memory import rollout_memory
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.compare.session import load_session
    from workbench.view.report.words import hidden_effects, said_aside, suspect_constants

    session, before = load_session(path), None if previous is None else Path(previous)
    warned = check_session("diagnose", session, yes)
    with (output_directory(out, need=16 << 20) as folder, Progress("diagnose", stages=STAGES) as progress,
          rollout_memory(out, session, memory) as kept):
        result = diagnose(session, DiagnoseOptions(jobs, thorough, kept, without, before, engine), progress=progress)
        paths = result.save(folder, progress, jobs)
    diagnosis = result.diagnosis
    say_left_out("diagnose", diagnosis.left_out, warned)
    if diagnosis.stopped:
        print("workbench diagnose: the search stopped at its limit of work; --thorough searches to the end", file=sys.stderr)
    for sentence in suspect_constants(diagnosis.recalibrated):
        print(f"workbench diagnose: warning: {sentence}", file=sys.stderr)
    print(f"verdict: {diagnosis.verdict}")
    for tied in diagnosis.tied:
        print(f"  {tied.in_words()}")
    for finding in diagnosis.findings:
        print(f"  {finding_line(finding)}")
    for unknown in diagnosis.unknown_torques:
        print(f"  {unknown_line(unknown)}")
    for sentence in said_aside(diagnosis.provenance):
        print(f"  {sentence.rstrip('.')}")
    for sentence in hidden_effects(diagnosis.provenance.get("cannot_show", {})):
        print(f"  {sentence.replace('**', '').rstrip('.')}")
    print(f"wrote {out}: {', '.join(p.name for p in paths if p.parent == folder)}")
    return 0


def unknown_line(unknown: UnknownTorque) -> str:
    """One line for the terminal: a torque that no effect describes, its probability, and the reduction of the error."""
    error = unknown.validation
    return f"{unknown.evidence} (confidence {unknown.confidence:.2f}; error on unseen stretches " \
           f"{error.before:.2f} -> {error.after:.2f} {error.unit})"


def finding_line(finding: Finding) -> str:
    """One line for the terminal: the finding, its probability, and the reduction of the error on held-out stretches."""
    from workbench.view.report.words import this_or

    tie, error = finding.tie, finding.validation
    other = f" {this_or(tie)}, which these recordings cannot separate" if tie else ""
    if finding.of_tie is not None:
        other = f", as one of several explanations of the ratio of gravity to torque, together {finding.of_tie:.2f}"
    family = "" if finding.family is None else f", {finding.family.name} {finding.family.confidence:.2f}"
    return f"{finding.evidence} (confidence {finding.together:.2f}{other}{family}; error on unseen stretches " \
           f"{error.before:.2f} -> {error.after:.2f} {error.unit})"
