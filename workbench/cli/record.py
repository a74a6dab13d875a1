"""`workbench record HOST`: a take from Motive, over the network."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from workbench.cli.options import add_out, port, seconds


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "record",
        help="record a take from Motive (NatNet 2.7 to 4.x)",
        description="Records the rigid bodies that Motive streams into a take (Motive CSV), with the times of mid-exposure, "
        "until Ctrl-C or --seconds. Also writes NAME.capture.json: frames lost, late, doubled and broken, and the server's "
        "clock. While recording, NAME.natnet holds the data received; after a crash --finish makes the take from it.")
    parser.add_argument("host", metavar="HOST", nargs="?", help="name or address of the computer that runs Motive")
    parser.add_argument("--name", type=_take_name, default="take", help="name of the take, here and in Motive (default: take)")
    parser.add_argument("--seconds", type=seconds, metavar="S", help="stop after S seconds (default: at Ctrl-C)")
    parser.add_argument("--interface", metavar="ADDRESS", help="this computer's address on that network (default: by the route)")
    parser.add_argument("--port", type=port, default=1510, metavar="N", help="Motive's command port (default: 1510)")
    parser.add_argument("--no-motive", action="store_true", help="do not also record the take on Motive's own disk")
    parser.add_argument("--bag", action="store_true", help="also write the take as a ROS 2 bag (MCAP), NAME_bag")
    parser.add_argument("--finish", metavar="JOURNAL", help="recover the take from NAME.natnet after an interrupted recording")
    add_out(parser, default="runs/record")
    parser.set_defaults(run=run)


def _take_name(text: str) -> str:
    """A name that a file and Motive's command can have, for argparse."""
    if text != Path(text).name or text in ("", ".", "..") or "," in text or not text.isprintable() or len(text.encode()) > 200:
        raise argparse.ArgumentTypeError(f"expected a name that a file can have, without a comma, got {text[:40]!r}")
    return text


def run(args: argparse.Namespace) -> int:
    """Records and prints what was received."""
    from workbench.cli.progress import Progress
    from workbench.device.capture import Recorder, UdpLink, finish, record_take
    from workbench.device.stop import stop_on_signals
    from workbench.files import InputError

    if (args.host is None) == (args.finish is None):
        raise InputError(None, "expected either HOST or --finish JOURNAL")
    with Progress("record") as progress:
        if args.finish is not None:
            journal = Path(args.finish)
            capture = finish(journal, args.out / f"{journal.stem}.csv", ended="the recording was cut short")
        else:
            link = UdpLink(args.host, args.interface, args.port)
            recorder = Recorder(link)
            with stop_on_signals() as stop:
                capture = record_take(recorder, args.out / f"{args.name}.csv", stop, args.seconds, not args.no_motive, progress)
            for other in sorted(link.others):
                print(f"workbench record: warning: {other} streams to the same multicast group; its frames were left out",
                      file=sys.stderr)
    for problem in capture.problems:
        print(f"workbench record: warning: {problem}", file=sys.stderr)
    if args.bag:
        _write_bag(capture.take)
    counts = capture.counts
    print(f"wrote {capture.take}: {counts.received} frames at {capture.rate:g} Hz, {counts.lost} lost, {counts.late} late, "
          f"{counts.doubled} doubled, {counts.broken} broken")
    return 0


def _write_bag(take: Path) -> None:
    """The take once more, as a bag; its time zero is the first frame's mid-exposure by this computer's clock."""
    import datetime
    import json

    from workbench.recording.formats.read import read_recording
    from workbench.recording.formats.rosbag_write import write_rosbag

    report = json.loads(take.with_suffix(".capture.json").read_text(encoding="utf-8"))
    began = datetime.datetime.fromisoformat(report["first_frame"]["utc"]).timestamp()
    print(f"wrote {write_rosbag(read_recording(take), take.with_name(take.stem + '_bag'), began)}")
