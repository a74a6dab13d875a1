"""`workbench flash MOTION`: conversion, build, load and start, in one command."""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.check import check_certificate_of, check_table_of
from workbench.cli.options import add_model, load_model, positive

if TYPE_CHECKING:
    from workbench.device.controller.loader_profile import LoaderProfile
    from workbench.device.controller.program import Program
    from workbench.device.controller.serial_line import SerialLine


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "flash",
        help="build a motion into the controller's program, load and start it",
        description="Turns a motion (CSV, .mtn, or a binary .table) into a table, builds the CM-530's program with it, "
        "loads it through the controller's own boot loader and starts it. This replaces the program on the controller, "
        "after you confirm. Then the robot moves: it goes to neutral.",
    )
    parser.add_argument("motion", metavar="MOTION")
    add_model(parser)
    parser.add_argument("--port", metavar="PORT", help="serial port of the PC link (default: the only one there is)")
    how_long = parser.add_mutually_exclusive_group()
    how_long.add_argument("--cycles", type=positive, metavar="N",
                          help="stop in neutral after N cycles (default: the motion's own, or 10)")
    how_long.add_argument("--endless", action="store_true", help="repeat until stopped by hand")
    parser.add_argument("--force", action="store_true", help="continue even if a limit is broken, with a warning")
    parser.add_argument("--yes", action="store_true", help="replace the program in the controller without asking")
    parser.add_argument("--dry-run", action="store_true", help="do everything except open the port, and print what would be sent")
    parser.add_argument("--loader", metavar="FILE", help="texts of the loader (default: data/loaders/cm530.yaml)")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("runs/flash"),
                        help="folder for image, table and transcript (default: runs/flash)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Builds, asks, loads, and saves the transcript. Whoever says no finds the folder as it was."""
    from workbench.cli.output import output_directory
    from workbench.device.controller.loader import FACTORY, MOVES
    from workbench.device.controller.loader_profile import load_loader_profile

    profile = load_loader_profile(args.loader)
    with ExitStack() as opened:
        with output_directory(args.out) as folder:
            program = _build(args, profile, folder)
            print(FACTORY)
            print(MOVES)
            line = None if args.dry_run else opened.enter_context(closing(_agreed_line(args, profile.rate)))
        if line is not None:
            _load(line, profile, program, args.out)
            return 0
    print(f"dry run: would hold '{profile.key.decode()}' at {profile.rate} bit/s until the loader's prompt, send "
          f"{profile.load.decode()}, {len(program.image)} bytes{' and their sum' if profile.byte_sum else ''}, "
          f"{profile.keep.decode()} and {profile.start.decode()}, and wait for the program's word; no port was opened")
    return 0


def _build(args: argparse.Namespace, profile: LoaderProfile, folder: Path) -> Program:
    """Builds the program with the checked motion, and prints its key data and warnings."""
    from workbench.cli.progress import Progress
    from workbench.device.controller.program import build_program
    from workbench.motion import load_motion

    with Progress("flash") as progress:
        progress("building")
        model = load_model(args.model, args.packages)
        if Path(args.motion).suffix == ".table":
            check_table_of("flash", args.motion, model, args.force)
        else:
            check_certificate_of("flash", args.motion, load_motion(args.motion, model), model, args.force)
        program = build_program(args.motion, model, profile, folder, args.cycles, args.force, args.endless)
    for violation in program.violations:
        print(f"workbench flash: warning: {violation}", file=sys.stderr)
    table = program.table.table
    ends = f"ends after {program.table.cycles} cycles" if program.table.stops else "repeats until a person stops it"
    print(f"{args.out / 'cm530.bin'}: {len(program.image)} bytes, {len(table)} poses of {len(table.joints)} joints; it {ends}\n"
          f"SHA-256: {program.sha256}")
    if not profile.confirmed:
        print(f"workbench flash: warning: the texts in {profile.source} are not confirmed on a real controller, "
              "and those after LOAD are unpublished; it stops at the first that differs (see the transcript)", file=sys.stderr)
    return program


def _load(line: SerialLine, profile: LoaderProfile, program: Program, out: Path) -> None:
    """Loads and starts the program. The transcript is kept in `out`, whatever happens."""
    from workbench.cli.progress import Progress
    from workbench.device.controller.loader import LoadError, Loading, Transcript
    from workbench.files import InputError
    from workbench.files.reading import write_whole

    transcript = Transcript()
    kept = out / f"transcript-{time.strftime('%Y%m%d-%H%M%S')}.txt"
    try:
        with Progress("flash") as progress:
            state = Loading(line, profile, transcript, progress).run(program.image)
    except LoadError as e:
        raise InputError("flash", f"{e} (transcript: {kept})") from None
    finally:
        write_whole(kept, transcript.text)
    print(f"started: it is at {state.state.name.lower()}, woke from {state.woke_from}; transcript: {kept}")


def _agreed_line(args: argparse.Namespace, rate: int) -> SerialLine:
    """The controller's port, once the user agrees to replace the program; InputError where not."""
    from workbench.device.controller.serial_line import SerialLine, default_port
    from workbench.files import InputError

    if not args.yes and not _confirm():
        raise InputError("flash", "not loaded: say yes, or give --yes")
    line = SerialLine(args.port or default_port(), rate)
    line.lines_low()
    return line


def _confirm() -> bool:
    if not sys.stdin.isatty():
        return False
    return input("Replace the program in the controller? [yes/no] ").strip().lower() == "yes"
