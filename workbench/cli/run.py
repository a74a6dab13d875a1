"""`workbench run MOTION`: play, record and compare in one command."""

from __future__ import annotations

import argparse
import sys

from workbench.cli.bus_options import VIRTUAL, add_bus, make_virtual, open_bus, open_pc_link
from workbench.cli.check import check_certificate_of
from workbench.cli.options import add_cycles, add_model, add_out, load_model, positive, seed


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "run",
        help="play a motion on the robot, record it, and compare it with the simulation",
        description="Checks all servos, plays the motion while the cameras record it, and compares the result with the "
        "simulation; with --diagnose it also finds the missing physics. The robot is emulated unless --port names a real one. "
        "The controller's program is never replaced. Writes a session: takes, joint log, registers, comparison.")
    parser.add_argument("motion", metavar="MOTION")
    add_bus(parser, default=VIRTUAL)
    add_model(parser)
    parser.add_argument("--upload", action="store_true", help="play from the CM-530's own program; --port is its PC link")
    parser.add_argument("--image", metavar="FILE", help="with --port virtual --upload: the program in the emulated CM-530")
    parser.add_argument("--motive", metavar="HOST",
                        help="computer that runs Motive (default: the joint log alone; emulated robot: emulated cameras)")
    parser.add_argument("--interface", metavar="ADDRESS", help="this computer's address on that network (default: by the route)")
    add_cycles(parser, 10)
    parser.add_argument("--seed", type=seed, default=0, metavar="N", help="random seed of the emulated cameras (default: 0)")
    parser.add_argument("--force", action="store_true", help="play even if a limit is broken or the certificate is missing")
    parser.add_argument("--diagnose", action="store_true", help="also search for missing physics")
    parser.add_argument("--jobs", type=positive, default=2, metavar="N", help="number of parallel simulations (default: 2)")
    add_out(parser, default="runs/run")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Plays, records, compares and prints the result."""
    from workbench.api.robot_run import run_by_controller, run_on_robot
    from workbench.cli.diagnose import diagnose_and_report
    from workbench.cli.progress import Progress
    from workbench.compare.compare_session import compare_session
    from workbench.compare.session import load_session
    from workbench.device.capture import Recorder, UdpLink
    from workbench.device.controller.play import NothingPlayedError
    from workbench.device.stop import stop_on_signals
    from workbench.device.tables.limits import refuse_broken_limits
    from workbench.motion import load_motion
    from workbench.robot.servo_units import known_units
    from workbench.view.report.comparison import write_comparison

    model = load_model(args.model, args.packages)
    motion = load_motion(args.motion, model)
    cycles = motion.often(args.cycles, 10)
    known_units(model, motion.joints)
    check_certificate_of("run", args.motion, motion, model, args.force)
    refuse_broken_limits(motion.as_table(), model, args.force)
    virtual = make_virtual(args, model)
    recorder = Recorder(UdpLink(args.motive, args.interface)) if args.motive else None
    with Progress("run") as progress:
        options = {"base": args.base, "virtual": virtual, "recorder": recorder, "seed": args.seed, "progress": progress}
        with stop_on_signals() as stop:
            if args.upload:
                with open_pc_link(args, virtual) as port:
                    try:
                        done = run_by_controller(port, model, motion, cycles, args.out, lambda: stop.reason, **options)
                    except NothingPlayedError as e:
                        print(f"workbench run: {e}", file=sys.stderr)
                        return 130 if stop.interrupted else 2
            else:
                with open_bus(args, model, virtual) as bus:
                    done = run_on_robot(bus, model, motion, cycles, args.out, lambda: stop.reason, **options)
        for warning in done.warnings:
            print(f"workbench run: warning: {warning}", file=sys.stderr)
        print(f"wrote {done.session}")
        if done.played.stopped:
            return 130 if stop.interrupted else 2
        if not done.done:
            return 2
        session = load_session(done.session)
        comparison = compare_session(session, progress=progress, n_jobs=args.jobs)
        write_comparison(comparison, session.model, args.out / "comparison", f"Session {session.path}", progress)
    print(comparison.table())
    print(f"wrote {args.out / 'comparison'}: comparison.json, report.html")
    if args.diagnose:
        return diagnose_and_report(args.out, args.out / "diagnosis", args.jobs)
    return 0
