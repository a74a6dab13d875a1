"""Arguments of the verbs that talk to servos, and the bus that they select."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from workbench.cli.options import load_model

if TYPE_CHECKING:
    from workbench.device.bus import Bus
    from workbench.robot import RobotModel
    from workbench.simulation.virtual_robot import VirtualRobot

VIRTUAL = "virtual"
SLOWEST, FASTEST = 1200, 10_500_000
"""Bit rates of any servo's bus: hobby servos have from 9600 on, DYNAMIXEL Pro and Y up to 10.5 million [bit/s]."""


def add_bus(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--port, --rate, --echo, --bridge, --robot, --base. default: of --port; None: the only USB adapter."""
    default_port = default or "the only USB adapter"
    parser.add_argument("--port", metavar="PORT", default=default,
                        help=f"serial port of the U2D2, USB2Dynamixel or CM-530 bridge, or `{VIRTUAL}` (default: {default_port})")
    parser.add_argument("--rate", type=_bit_rate, default=1_000_000, metavar="BIT/S",
                        help="baud rate of the servo bus (default: 1000000)")
    parser.add_argument("--echo", action="store_true", help="the adapter echoes its own transmissions")
    parser.add_argument("--bridge", action="store_true", help="the port is the PC link of a CM-530 with the workbench's program")
    parser.add_argument("--robot", metavar="FILE",
                        help=f"with --port {VIRTUAL}: ground-truth model of the emulated robot: a model.yaml "
                             "with effects (default: the model)")
    parser.add_argument("--base", choices=("free", "fixed"), default="free",
                        help="free: standing on its feet; fixed: held (default: free)")


def _bit_rate(text: str) -> int:
    """A rate that serial adapters have, for argparse."""
    from workbench.files.numerals import whole_of

    value = whole_of(text)
    if value is None or not SLOWEST <= value <= FASTEST:
        raise argparse.ArgumentTypeError(f"expected a whole number from {SLOWEST} to {FASTEST} bit/s, got {text[:40]}")
    return value


def make_virtual(args: argparse.Namespace, model: RobotModel) -> VirtualRobot | None:
    """The emulated robot of `--port virtual`, else None."""
    if args.port != VIRTUAL:
        return None
    from workbench.simulation.virtual_robot import VirtualRobot

    real = load_model(args.robot, args.packages) if args.robot else model
    base = "fixed" if model.kinematics.fixed_to_world else args.base
    return VirtualRobot(real, base, args.rate)


@contextmanager
def open_bus(args: argparse.Namespace, model: RobotModel, virtual: VirtualRobot | None) -> Iterator[Bus]:
    """The bus, whose port is closed at the end; BusError in one line if there is none."""
    from workbench.device.bus import Bus
    from workbench.device.bus.survey import family_of
    from workbench.robot import bus_ids

    profile = family_of(model)
    joints = {i: joint for joint, i in bus_ids(model).items()}
    with open_servo_port(args, virtual) as port:
        yield Bus(port, profile, joints, strip_echo=args.echo)


@contextmanager
def open_servo_port(args: argparse.Namespace, virtual: VirtualRobot | None) -> Iterator[Any]:
    """The port that leads to the servos, through the CM-530 with --bridge; closed at the end."""
    from workbench.device.bus import open_port
    from workbench.device.bus.bridge import RATE, enter_bridge, leave_bridge

    with _closing(virtual.port if virtual is not None
                  else open_port(_port_name(args), RATE if args.bridge else args.rate)) as port:
        if args.bridge:
            enter_bridge(port)
        yield port
        if args.bridge:
            leave_bridge(port)


@contextmanager
def _closing(port: Any) -> Iterator[Any]:
    """The port, closed at the end even if the adapter was pulled."""
    from workbench.device.bus.ports import GONE

    try:
        yield port
    finally:
        with suppress(*GONE):
            port.closePort()


def _port_name(args: argparse.Namespace) -> str:
    from workbench.device.bus import BusError, serial_ports

    if args.port is not None:
        return str(args.port)
    ports = serial_ports(usb=True)
    if len(ports) != 1:
        raise BusError(f"{len(ports)} USB adapters with a serial port{': ' if ports else ''}{', '.join(ports)}; say which "
                       f"with --port, of {', '.join(serial_ports()) or 'none'}")
    return ports[0]


@contextmanager
def open_pc_link(args: argparse.Namespace, virtual: VirtualRobot | None) -> Iterator[object]:
    """The CM-530's PC link: a serial port, or that of an emulated one that runs --image."""
    from workbench.device.bus import open_port
    from workbench.device.bus.bridge import RATE
    from workbench.files import InputError
    from workbench.files.reading import read_bytes

    if virtual is None:
        with _closing(open_port(_port_name(args), RATE)) as port:
            yield port
        return
    if args.image is None:
        raise InputError(None, "the emulated robot needs --image, the program of its CM-530 (`make firmware`)")
    if find_spec("unicorn") is None:
        raise InputError("--image", "the emulated CM-530 needs the package unicorn: pip install 'drake-workbench[emulator]'")
    image = read_bytes(args.image)
    from workbench.device.virtual.cm530 import Board, BoardError, check_image
    from workbench.device.virtual.cm530.port import PcLinkPort

    try:
        check_image(image)
        board = Board(image, virtual.clock, virtual.bus)
        board.power_on()
        yield PcLinkPort(board)
    except BoardError as e:
        raise InputError(args.image, f"not a program that the CM-530 runs: {e}") from None
