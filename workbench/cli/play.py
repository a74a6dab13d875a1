"""`workbench play MOTION`: a motion on the robot, from this computer."""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.bus_options import add_bus, make_virtual, open_bus
from workbench.cli.check import check_certificate_of
from workbench.cli.options import add_cycles, add_model, add_out, load_model, positive

if TYPE_CHECKING:
    from workbench.device.play import Played

CTRL_C = "Ctrl-C"


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "play",
        help="play a motion on the robot and log its joints",
        description="Checks all servos, ramps from where the robot is to neutral, plays the motion, ramps back and releases. "
        "Writes a joint log with the actual send times, and registers.yaml. Ctrl-C, heat, low voltage or a silent servo end it "
        "with a ramp to neutral; docs/robot-host.md says what else can happen.")
    parser.add_argument("motion", metavar="MOTION", nargs="?", help="pose table, FILE.mtn#page, or a bag with a JointTrajectory")
    add_bus(parser)
    add_model(parser)
    add_cycles(parser, 3)
    parser.add_argument("--slow", type=positive, default=1, metavar="N",
                        help="slow the motion down by a factor of N (default: 1)")
    parser.add_argument("--torque", type=_percent, default=100, metavar="PERCENT",
                        help="torque limit of the servos, in percent of the full one, at least 10 (default: 100)")
    parser.add_argument("--hold", action="store_true", help="keep torque on at the end")
    parser.add_argument("--force", action="store_true", help="play even if a limit is broken or the certificate is missing")
    parser.add_argument("--bag", action="store_true", help="also write the joint log as a ROS 2 bag (MCAP), NAME_bag")
    parser.add_argument("--finish", metavar="JOURNAL", help="recover the joint log from NAME.play after an interrupted run")
    add_out(parser, default="runs/play")
    parser.set_defaults(run=run)


def _percent(text: str) -> int:
    """10 to 100, for argparse: with less, no servo can lift its own leg."""
    value = positive(text)
    if not 10 <= value <= 100:
        raise argparse.ArgumentTypeError(f"expected 10 to 100 percent, got {text[:40]}")
    return value


def run(args: argparse.Namespace) -> int:
    """Plays and prints how it went; returns 2 if it was stopped, 130 if by Ctrl-C."""
    from workbench.cli.progress import Progress
    from workbench.device.bus.survey import survey
    from workbench.device.play import PlayOptions, finish_log, perform, preflight, reading_plan
    from workbench.device.stop import stop_on_signals
    from workbench.device.tables.limits import refuse_broken_limits
    from workbench.files import InputError
    from workbench.motion import load_motion
    from workbench.robot.servo_registers import save_registers
    from workbench.robot.servo_units import known_units

    if (args.motion is None) == (args.finish is None):
        raise InputError(None, "expected either MOTION or --finish JOURNAL")
    if args.finish is not None:
        journal = Path(args.finish)
        print(f"wrote {finish_log(journal, args.out / f'{journal.stem}.csv')}")
        return 0
    model = load_model(args.model, args.packages)
    motion = load_motion(args.motion, model)
    known_units(model, motion.joints)
    check_certificate_of("play", args.motion, motion, model, args.force)
    refuse_broken_limits(motion.as_table(), model, args.force)
    commands = motion.commands(motion.often(args.cycles, 3))
    commands, share = commands.slow_down(args.slow), args.torque / 100
    options = PlayOptions(hold=args.hold, torque=share, start_torque=min(share, PlayOptions().start_torque))
    log = args.out / f"{motion.name}.csv"
    virtual = make_virtual(args, model)
    with Progress("play") as progress, open_bus(args, model, virtual) as bus, stop_on_signals() as stop:
        found = survey(bus, model, ids=(), progress=progress)
        preflight(found)
        plan = reading_plan(bus, len(found.found), commands)
        if plan.warning:
            print(f"workbench play: warning: {plan.warning}", file=sys.stderr)
        registers = found.registers()
        save_registers(registers, args.out / "registers.yaml")
        played = perform(bus, found, virtual.controller(commands) if virtual else commands, log, lambda: stop.reason,
                         options, progress=progress)
        offset = time.time() - bus.now()
    if args.bag:
        _write_bag(log, played, offset)
    for departure in registers.departures(model):
        print(f"workbench play: warning: {departure}", file=sys.stderr)
    if bus.retries:
        print(f"workbench play: warning: {bus.retries.total()} answers had to be requested again", file=sys.stderr)
    return _tell(log, played)


def _write_bag(log: Path, played: Played, offset: float) -> None:
    """The joint log once more, as a bag. offset: of the time of day, less the bus's clock [s]."""
    from workbench.recording.formats.read import read_recording
    from workbench.recording.formats.rosbag_write import write_rosbag

    if played.log_problem or math.isnan(played.log_start):
        print("workbench play: warning: no bag, because the joint log is incomplete", file=sys.stderr)
        return
    print(f"wrote {write_rosbag(read_recording(log), log.with_name(log.stem + '_bag'), played.log_start + offset)}")


def _tell(log: Path, played: Played) -> int:
    """Prints why it was stopped, then the results; returns the exit code."""
    if played.stopped:
        print(f"workbench play: stopped: {played.stopped}", file=sys.stderr)
    if played.log_problem:
        print(f"workbench play: warning: no joint log: {played.log_problem}", file=sys.stderr)
    else:
        read = f"; each joint read {min(played.rates.values()):.0f} times a second or more" if played.rates else ""
        print(f"wrote {log}: {played.poses} poses, the worst {1000 * played.worst_late:.1f} ms late{read}")
    if played.repaired:
        print(f"workbench play: warning: {played.repaired} goals did not arrive and were sent again", file=sys.stderr)
    if played.missed:
        print(f"workbench play: problem: {played.missed} goals did not reach their servos in time; this was not the motion "
              "asked for", file=sys.stderr)
    print(f"torque is {'off' if played.released else 'on'}" if not played.unknown else
          f"workbench play: torque may still be on in {', '.join(played.unknown)}: no answer; switch the robot's power off",
          file=sys.stderr if played.unknown else sys.stdout)
    if played.stopped.startswith(CTRL_C):
        return 130
    return 2 if played.stopped or played.unknown or played.missed else 0
