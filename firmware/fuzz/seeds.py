"""Scripts for the robot's fuzzer, as a person would write them: what `fuzz_robot.c` reads, by name.

Each seed brings the core to a place that random bytes reach late or never: a table with an end, one out of reach,
a bridge that moves a
servo, an alarm in each state. The fuzzers begin from these and from the kept corpus.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

FRESH, RESET, NEUTRAL, PLAYING, LIMP, BRIDGED, BROKEN = range(7)
PC, ZIGBEE = 0, 1
PLAY, STOP, RELEASE = 1, 2, 3
BEGIN, DATA, END = 0x10, 0x11, 0x12
MUTE, TWIN, OVERLOAD, HEAT, VOLTS, BABBLE, GLITCH, REGISTER, MOVED, HELD, POWERED, FLIPS = range(12)
TABLE = (Path(__file__).resolve().parents[1] / "robotis_walk.table").read_bytes()
POSES = 16 + 12 * TABLE[5]
"""Where the first pose begins in the table."""


def run(ms: int) -> bytes:
    """Time passes."""
    steps, rest = divmod(ms, 1020)
    return bytes([11, 255]) * steps + bytes([11, rest // 4])


def raw(data: bytes, link: int = PC) -> bytes:
    """Bytes on a link, at its rate."""
    return bytes([1, len(data), *data, link])


def burst(data: bytes, link: int = PC, times: int = 1) -> bytes:
    """Bytes on a link, all at once."""
    return bytes([13, len(data), *data, link, 4 - times])


def frame(kind: int, payload: bytes = b"", link: int = PC) -> bytes:
    """A frame with a right sum."""
    return bytes([2, len(payload), *payload, link, kind])


def remote(button: int | None) -> bytes:
    """A word of the remote: one button (0: U, 4: 1), or none."""
    return bytes([4]) if button is None else bytes([3, button])


def start(down: bool) -> bytes:
    """The START button."""
    return bytes([5, down])


def press(ms: int = 60) -> bytes:
    """START down for so long."""
    return start(True) + run(ms) + start(False) + run(60)


def order(what: int) -> bytes:
    """PLAY, STOP or RELEASE."""
    return bytes([9, what])


def bridge(begin: bool = True) -> bytes:
    """BRIDGE or BRIDGE_END."""
    return bytes([10, not begin])


def fault(servo: int, what: int, value: int, register: int | None = None) -> bytes:
    """Something goes wrong with one servo."""
    return bytes([7, servo, value, what, *([] if register is None else [register])])


def packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """From the PC through the bridge."""
    return bytes([8, len(parameters), *parameters, servo, instruction])


def dynamixel(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """The same as it is on the wire."""
    body = bytes([servo, len(parameters) + 2, instruction, *parameters])
    return b"\xff\xff" + body + bytes([~sum(body) & 255])


def upload(changes: dict[int, int] | None = None, ramps: bool = False, link: int = PC, wrong_crc: bool = False) -> bytes:
    """The walk with some bytes changed."""
    changes = changes or {}
    edits = b"".join(struct.pack("<HB", at, value) for at, value in changes.items())
    return bytes([6, link, len(changes), (4 if ramps else 0) | wrong_crc]) + edits


def begun(size: int, crc: int, sequence: int = 1, link: int = PC) -> bytes:
    """BEGIN of an upload."""
    return frame(BEGIN, struct.pack("<IIBB", size, crc, sequence, 0), link)


def whole(table: bytes, crc: int | None = None) -> bytes:
    """Any small table, frame by frame."""
    said = zlib.crc32(table) if crc is None else crc
    return begun(len(table), said) + frame(DATA, b"\0\0" + table) + frame(END)


ONE_JOINT = (struct.pack("<4sBBHHHI", b"WBTB", 1, 1, 1, 0, 0, 40) + struct.pack("<BBHHHHH", 3, 0, 12, 400, 600, 50, 512)
             + struct.pack("<IHH", 100, 500, 5))
FAR = {POSES + 4: 88, POSES + 5: 2, POSES + 8: 88, POSES + 9: 2}
"""The first two joints' goals of the first pose: 600."""
WRITE, REG_WRITE, ACTION, RESET_ALL, SYNC_WRITE = 3, 4, 5, 6, 0x83


def tables() -> list[bytes]:
    """Uploads that are taken, dropped, ramped to, refused."""
    one = ONE_JOINT + struct.pack("<I", zlib.crc32(ONE_JOINT))
    ends = upload({8: 1, 10: 1})
    scripts = [
        [NEUTRAL, ends, run(20), order(PLAY), run(3000)], [PLAYING, ends, run(3000)], [PLAYING, upload({8: 1}), run(20)],
        [PLAYING, upload({8: 1, 10: 2}), run(3000)],
        [PLAYING, upload(FAR), run(900), order(STOP), run(2000)],
        [PLAYING, upload(FAR, ramps=True), run(600), run(3000)],
        [PLAYING, upload(FAR, ramps=True), run(500), order(STOP), run(900)],
        [PLAYING, upload({POSES + 6: 0, POSES + 7: 0}), run(900), upload(), run(900), upload(), run(900)],
        [PLAYING, upload({POSES + 6: 255, POSES + 7: 3}), run(900), upload(link=ZIGBEE), run(900)],
        [NEUTRAL, whole(one), run(50)], [NEUTRAL, whole(ONE_JOINT + b"1234"), run(50)], [NEUTRAL, whole(one, 7), run(50)],
        [PLAYING, upload({POSES + 6: 0}, wrong_crc=True), run(900)],
        [NEUTRAL, frame(BEGIN, b"123"), begun(460, 1), frame(DATA, b"\0\0"), frame(DATA, b"\1\0x"), run(2100), frame(END)],
        [NEUTRAL, begun(460, 1, link=ZIGBEE), begun(460, 1), begun(5000, 1, link=ZIGBEE), frame(DATA, b"\0\0abc"), run(50)],
        [PLAYING, upload(), run(20), begun(460, 1, 1), begun(460, 1, 200), begun(460, 1, 128), begun(460, 1, 2),
         frame(DATA, b"\0\0abc"), frame(DATA, b"\0\0abc"), frame(END), frame(END, b"", ZIGBEE), run(20)],
        [PLAYING, upload(), burst(b"\xa5\x5a\x10\x01\x0a", PC), run(20)],
        [PLAYING, upload(), run(20), upload({POSES: 10, POSES + 1: 0}), run(900), begun(460, 1, 0)],
        [NEUTRAL, bytes([12, 40, 130]), run(10)], [PLAYING, upload(), run(900), bytes([12, 100, 200]), run(900)],
    ]
    for at, value in ((5, 14), (16, 200), (18, 13), (20, 0), (22, 255), (24, 255), (26, 1), (6, 3), (0, 1), (4, 2), (8, 3),
    (12, 1),
                      (POSES, 1), (POSES + 64, 1), (POSES + 5, 3), (POSES + 3 * 64 + 5, 3), (POSES + 7, 4)):
        scripts.append([PLAYING, upload({at: value}), run(600)])
    wider = {20: TABLE[20] - 1, 22: TABLE[22] + 1 & 255, 24: TABLE[24] + 1 & 255, 26: TABLE[26] - 1 & 255}
    scripts += [[PLAYING, upload({at: value}), run(100)] for at, value in wider.items()]
    return [bytes([script[0]]) + b"".join(script[1:]) for script in scripts]


def people() -> list[bytes]:
    """Buttons, remote, frames."""
    words = [remote(0), remote(None)]
    scripts = [
        [NEUTRAL, *words, run(400), remote(4), remote(None), run(900)],
        [NEUTRAL, remote(0), run(1100), remote(0), run(20), remote(0), run(99)],
        [NEUTRAL, press(), run(300), press(), run(900)], [NEUTRAL, start(True), bytes([0, 5]), start(False), run(100)],
        [RESET, start(True), run(100), start(False), bytes([0, 3]), start(True), run(2000), start(False), press(1600)],
        [PLAYING, start(True), run(1600), start(False), run(400), press()],
        [FRESH, order(STOP), run(200), order(STOP), run(900), order(RELEASE)],
        [LIMP, order(STOP), run(900)], [RESET, order(PLAY), run(2000), order(PLAY)], [LIMP, start(True), run(2000)],
        [BROKEN, order(PLAY), order(RELEASE), order(STOP), bridge(), upload(), press(), *words, frame(0), run(300)],
        [NEUTRAL, raw(b"\xff\x55\xff\x55\x01\xfe\x00\xff", ZIGBEE), raw(b"\xff\x55\x01\x01\xff\x55\x01\xfe\x00\xff", ZIGBEE),
        run(50)],
        [PLAYING, burst(b"\xa5\x5a\x01\x00\x00" * 40, times=3), run(20), burst(bytes(255), ZIGBEE, 4), run(90)],
        [NEUTRAL, raw(b"\xa5\xa5\x5a\x11\x01\xff" + bytes(20)), raw(b"\xa5\x5a\x11\x01\x00\x01\x02"), raw(b"\xa5x"),
        frame(0x99), frame(1)],
    ]
    scripts += [[state, order(what), run(200), order(PLAY), run(200)] for state in range(7) for what in (PLAY, STOP, RELEASE)]
    return [bytes([script[0]]) + b"".join(script[1:]) for script in scripts]


def bridged() -> list[bytes]:
    """Packets from the PC."""
    goal = bytes([30, 88, 2, 50, 0])
    all_of_it = [
        packet(254, RESET_ALL), packet(254, WRITE, b"\3\x09"), packet(254, REG_WRITE, b"\4\1"), packet(254, WRITE),
        packet(254, WRITE, goal),
        packet(254, 1), packet(9, 1), packet(9, ACTION), packet(9, REG_WRITE, goal), packet(9, WRITE, b"\x05\0"),
        packet(9, WRITE, b"\x30\0"),
        packet(9, 2, b"\0\x32"), packet(9, 2, b"\0\xff"), packet(9, 2, b"\0"), packet(254, SYNC_WRITE, bytes([30, 2, 9, 0, 2])),
        packet(254, SYNC_WRITE, bytes([5, 1, 9, 0])), packet(9, 9), packet(9, WRITE, b"\x1c\x40"),
    ]
    ends = [run(1100), bridge(False), order(RELEASE), start(True) + run(1600), remote(0) + run(900)]
    scripts = [[BRIDGED, one, run(20), ends[k % len(ends)], run(900)] for k, one in enumerate(all_of_it)]
    scripts += [[BRIDGED, packet(9, WRITE, goal), run(30), end, run(2000), run(2000)] for end in ends]
    scripts += [
        [BRIDGED, burst(dynamixel(9, 1) + dynamixel(9, 1)), run(20), raw(b"\xff\xff\xff\x09\x02\x01\x00"),
        raw(b"\xff\xff\x09\xf0"), raw(b"\xffz")],
        [BRIDGED, raw(b"\xff\xff\x09\x01"), packet(9, 1), raw(b"\xff\xff\x09\xa0" + bytes(180)), run(20)],
        [BRIDGED, packet(9, WRITE, goal), start(True), *[packet(9, 1), run(400)] * 5],
        [PLAYING, bridge(False), order(0), run(20)],
        [BRIDGED, raw(dynamixel(9, 1)[:-1] + b"\0"), frame(4, b"", ZIGBEE), frame(1, b"", ZIGBEE), run(20)],
        [NEUTRAL, bridge(), order(RELEASE), bridge(), run(20), frame(0x20, b"", ZIGBEE), packet(9, 1), run(1200)],
    ]
    return [bytes([script[0]]) + b"".join(script[1:]) for script in scripts]


def faults() -> list[bytes]:
    """Faults, in each state."""
    one_servo = [(MUTE, 1), (TWIN, 1), (OVERLOAD, 1), (HEAT, 66), (HEAT, 80), (HELD, 1), (POWERED, 0), (MOVED, 150)]
    scripts = [[state, fault(4, what, value), run(900), order(STOP), run(1000), run(3000)]
               for what, value in one_servo for state in (FRESH, PLAYING, NEUTRAL)]
    registers = [(0, 13), (6, 200), (8, 0), (9, 1), (11, 20), (24, 0), (26, 3), (28, 64), (30, 1), (31, 0), (32, 1), (34, 0),
    (48, 40)]
    for register, value in registers:
        changed = fault(6, REGISTER, value, register)
        scripts += [[PLAYING, changed, run(60), changed, run(800)], [LIMP, changed, order(PLAY), run(900)]]
    for volts in (50, 90):
        scripts += [[state, fault(0, VOLTS, volts), order(PLAY), run(1500), run(900)] for state in (FRESH, PLAYING, LIMP)]
    scripts += [
        [PLAYING, *(fault(k, MUTE, 1) for k in range(15)), run(500)], [LIMP, *(fault(k, MUTE, 1) for k in range(15)), run(900)],
        [PLAYING, fault(0, BABBLE, 1), run(500)], [LIMP, fault(0, BABBLE, 1), run(500)],
        [NEUTRAL, fault(0, FLIPS, 250), run(2000)],
        [PLAYING, fault(2, HELD, 1), fault(3, MUTE, 1), run(600), run(4000)],
        [PLAYING, fault(2, HELD, 1), order(STOP), run(4500)],
        [FRESH, bytes([0, 40]), fault(3, MOVED, 140), run(30), fault(5, MOVED, 140), run(900)],
        [LIMP, fault(6, REGISTER, 0, 34), fault(6, REGISTER, 0, 35), order(PLAY), run(900)],
        [PLAYING, fault(6, REGISTER, 20, 11), fault(6, HEAT, 40), run(900)],
        [LIMP, fault(6, REGISTER, 20, 11), order(PLAY), run(900)],
        [PLAYING, *(fault(0, GLITCH, k) + run(200) for k in range(1, 6))],
        [LIMP, fault(6, REGISTER, 1, 24), run(200)],
    ]
    scripts += [[PLAYING, bytes([0, at]), fault(6, REGISTER, 1, 32), bytes([0, 9]), fault(9, REGISTER, 1, 32),
    run(300)] for at in range(60, 200, 7)]
    return [bytes([script[0]]) + b"".join(script[1:]) for script in scripts]


def seeds() -> list[bytes]:
    """All of them."""
    return tables() + people() + bridged() + faults()
