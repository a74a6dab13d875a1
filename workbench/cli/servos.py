"""`workbench servos`: the servos on the bus, compared with the model."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.cli.bus_options import add_bus, make_virtual, open_bus
from workbench.cli.options import add_model, load_model

if TYPE_CHECKING:
    from workbench.device.bus.survey import Survey


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "servos",
        help="list the servos on the bus and every register that differs from the model",
        description="Looks for a servo at every ID, and reads all registers of each. Shows who answers, in what state, and what "
        "differs from the model; with --out writes registers.yaml, which a session.yaml may name as evidence. Moves nothing.")
    add_bus(parser)
    add_model(parser)
    parser.add_argument("--write", action="store_true", help="set return delay and angle limits as the model has them; read back")
    parser.add_argument("--set-id", metavar="JOINT", help="give the one servo on the bus the ID of this joint")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder for registers.yaml")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Surveys, writes what is asked for, and says what there is; 2 where something has to be fixed."""
    from workbench.cli.progress import Progress
    from workbench.device.bus.setup import set_id, set_up, wider_limits
    from workbench.device.bus.survey import survey
    from workbench.device.bus.wire import slow_adapter
    from workbench.robot.servo_registers import save_registers

    model = load_model(args.model, args.packages)
    with Progress("servos") as progress, open_bus(args, model, make_virtual(args, model)) as bus:
        found = survey(bus, model, progress=progress)
        if args.set_id:
            print(set_id(bus, model, found, args.set_id))
            return 0
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
        print(f"wrote {path}; beside a session.yaml that says `registers: {path.name}`, `diagnose` begins with what differs")
    if slow_adapter(found.latency):
        print(f"workbench servos: warning: {slow_adapter(found.latency)}", file=sys.stderr)
    for problem in found.problems():
        print(f"workbench servos: problem: {problem}", file=sys.stderr)
    return 2 if found.problems() else 0


def _show(found: Survey) -> None:
    import math

    print(f"{len(found.found)} servos at {found.rate} bit/s")
    print(f"{'ID':>3}  {'joint':<8}{'model':<16}{'firmware':>8}{'deg':>8}{'V':>6}{'deg C':>6}  alarms")
    for s in found.found.values():
        firmware = s.registers.get("firmware_version", "")
        print(f"{s.id:>3}  {s.joint or '-':<8}{s.model:<16}{firmware:>8}{math.degrees(s.angle):>8.1f}{s.voltage:>6.1f}"
              f"{s.temperature:>6}  {', '.join(s.alarms) or 'none'}")
