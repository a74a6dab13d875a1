"""`workbench servos`: the servos on the bus, compared with the model."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.bus_options import VIRTUAL, add_bus, make_virtual, open_bus, open_servo_port
from workbench.cli.options import PUPPY, add_model, load_model

if TYPE_CHECKING:
    from workbench.device.bus import Bus
    from workbench.device.bus.survey import Survey
    from workbench.robot import RobotModel


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "servos",
        help="list the servos on the bus and, with --model, every register that differs from the model",
        description="Looks for a servo at every ID and reads all its registers. Shows each servo's state and, with --model, how "
        "it differs from the model. --out writes registers.yaml, which a session.yaml may cite as evidence. Without --wiggle "
        "nothing moves.")
    add_bus(parser)
    add_model(parser, "none, which lists the servos; for --write, --wiggle, --set-id and --out the bundled puppy", None)
    parser.add_argument("--write", action="store_true", help="set return delay and angle limits from the model, and verify them")
    parser.add_argument("--set-id", metavar="JOINT", help="give the one servo on the bus the ID of this joint")
    parser.add_argument("--wiggle", metavar="JOINT", help="move this joint, or `all` one after the other, by 3 deg and back, and "
                        "ask which one moved and which way: finds swapped IDs and signs")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for registers.yaml")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Surveys the bus, writes the requested files, and prints the servos found; 2 where something has to be fixed."""
    from workbench.cli.progress import Progress
    from workbench.device.bus.setup import set_id, set_up, wider_limits
    from workbench.device.bus.survey import survey
    from workbench.robot.servo_registers import save_registers

    if args.model is None and not (args.write or args.set_id or args.wiggle or args.out):
        return _list(args)
    model = load_model(args.model or PUPPY, args.packages)
    with Progress("servos") as progress, open_bus(args, model, make_virtual(args, model)) as bus:
        found = survey(bus, model, progress=progress)
        if args.set_id:
            print(set_id(bus, model, found, args.set_id))
            return 0
        if args.wiggle:
            return _wiggle(bus, model, found, args.wiggle)
        if args.write:
            for line in set_up(bus, model, found):
                print(line)
            found = survey(bus, model, found.found, progress=progress)
    _show(found)
    registers = found.registers()
    for departure in registers.departures(model):
        print(f"differs from the model: {departure}")
    for line in wider_limits(model, found):
        print(f"wider than the model: {line}; --write narrows it")
    if args.out is not None:
        path = save_registers(registers, args.out / "registers.yaml")
        print(f"wrote {path}; with `registers: {path.name}` in a session.yaml, `diagnose` starts from these registers")
    return _warn([found])


def _list(args: argparse.Namespace) -> int:
    """Lists every servo of every known family, without a model; returns 2 if something is wrong with one."""
    from workbench.cli.progress import Progress
    from workbench.device.bus.listing import list_servos

    virtual = make_virtual(args, load_model(PUPPY, args.packages)) if args.port == VIRTUAL else None
    with Progress("servos") as progress, open_servo_port(args, virtual) as port:
        surveys = list_servos(port, args.echo, progress)
    for found in surveys:
        _show(found)
    code = _warn(surveys)
    print("compare them with a robot: --model NAME")
    return code


def _warn(surveys: Sequence[Survey]) -> int:
    """Warns about a slow adapter and every problem; returns the exit code."""
    from workbench.device.bus.wire import slow_adapter

    slow = slow_adapter(max(found.latency for found in surveys))
    if slow:
        print(f"workbench servos: warning: {slow}", file=sys.stderr)
    problems = [problem for found in surveys for problem in found.problems()]
    for problem in problems:
        print(f"workbench servos: problem: {problem}", file=sys.stderr)
    return 2 if problems else 0


def _wiggle(bus: Bus, model: RobotModel, found: Survey, which: str) -> int:
    """Moves each joint a little and asks the user what moved; returns 2 if something is wrong."""
    from workbench.device.play.wiggle import Answers, wiggle
    from workbench.files import InputError
    from workbench.robot import bus_ids

    servos = {s.joint: s for s in found.found.values() if s.joint is not None}
    wanted = list(servos) if which == "all" else [which]
    if wanted[0] not in servos:
        raise InputError(None, f"joint '{wanted[0]}' is not on the bus; there are: {' '.join(servos)}")
    for problem in found.problems():
        raise InputError(None, f"{problem}; nothing was moved")
    answers = Answers()
    for joint in wanted:
        done = wiggle(bus, servos[joint])
        blocked = ": it moved too little; is something blocking it?" if done.blocked else ""
        print(f"servo {done.servo} ({joint}) went {math.degrees(done.went):+.1f} deg and back{blocked}; its torque is off")
        print(f"which joint moved? Enter: {joint}, in the positive direction; -: {joint}, the other way; else its name")
        line = sys.stdin.readline()
        if not line:
            raise InputError(None, "no answer; call it from a terminal")
        answers.take(joint, line, model.joints)
    findings = answers.findings(bus_ids(model))
    for finding in findings:
        print(f"workbench servos: problem: {finding}", file=sys.stderr)
    for key, values in answers.corrections(bus_ids(model), model.mountings).items() if findings else ():
        print(f"the robot section should say {key}: {{{', '.join(f'{joint}: {v}' for joint, v in values.items())}}}")
    return 2 if findings else 0


def _show(found: Survey) -> None:
    rows = found.found.values()
    joint, model = (max([8, *(len(text) + 2 for text in column)])
                    for column in ((s.joint or "-" for s in rows), (s.model for s in rows)))
    print(f"{len(found.found)} servos at {found.rate} bit/s ({found.profile.name})")
    print(f"{'ID':>3}  {'joint':<{joint}}{'model':<{model}}{'firmware':>8}{'deg':>8}{'V':>6}{'deg C':>6}  alarms")
    for s in found.found.values():
        firmware = s.registers.get("firmware_version", "")
        print(f"{s.id:>3}  {s.joint or '-':<{joint}}{s.model:<{model}}{firmware:>8}{math.degrees(s.angle):>8.1f}{s.voltage:>6.1f}"
              f"{s.temperature:>6}  {', '.join(s.alarms) or 'none'}")
