"""`workbench export MOTION`: firmware tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from workbench.cli.check import add_yes, check_certificate_of, check_model, check_motion
from workbench.cli.options import add_cycles, add_model, add_out, load_model


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "export",
        help="turn a motion into the robot's firmware tables",
        description="Turns a motion table into the firmware's pos.txt, speed.txt, timeDiff.txt, motion.h and motion.table. "
        "It is first played on the simulated robot: a motion that exceeds a servo's range, speed or torque, or that optimize "
        "wrote and whose certificate is missing, is refused unless --force is given.",
    )
    parser.add_argument("motion", metavar="MOTION")
    add_model(parser)
    add_cycles(parser, 3)
    parser.add_argument("--force", action="store_true", help="write the tables even if a limit is broken, with a warning")
    add_yes(parser)
    add_out(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Simulates, checks and writes."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.device import export
    from workbench.device.tables.firmware_tables import check_servos
    from workbench.files.reading import read_text, write_whole
    from workbench.gait.certificate import NAME, has_mark
    from workbench.motion import load_motion
    from workbench.simulation import Simulation, SimulationConfig
    from workbench.simulation.play import play_motion

    model = load_model(args.model, args.packages)
    motion = load_motion(args.motion, model)
    cycles = motion.often(args.cycles, 3)
    check_model("export", model)
    check_motion("export", motion, cycles, args.yes)
    check_servos(motion, model)  # refused before the simulation
    motion.as_table()
    check_certificate_of("export", args.motion, motion, model, args.force)
    base = "fixed" if model.kinematics.fixed_to_world else "free"
    with output_directory(args.out) as folder, Progress("export", stages=("simulating", "writing")) as progress:
        take = play_motion(Simulation(model, SimulationConfig(base=base)), motion, cycles,
                           progress=lambda done: progress("simulating", done))
        exported = export(motion, model, folder, take, args.force)
        certificate = Path(args.motion).with_name(NAME)
        if has_mark(args.motion) and certificate.is_file():  # for `flash`, which takes motion.table too
            write_whole(folder / NAME, read_text(certificate))
    for violation in exported.violations:
        print(f"workbench export: warning: {violation}", file=sys.stderr)
    print(f"wrote {args.out}: {', '.join(f.name for f in exported.files)}"
          + (f"; no motion.table: {exported.no_binary}" if exported.no_binary else ""))
    return 0
