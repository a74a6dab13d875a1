"""The campaign against the controller: every fault, at transactions all over each session, judged by a monitor from outside."""

from __future__ import annotations

import ctypes
import random
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.firmware.native import FIRMWARE, Sim, compile_core, walk
from tests.firmware.test_core_sections import sections
from tests.rude.controller import FAULTS, RULES, SESSIONS, Injection, complaint, core_monitor, injections
from tests.rude.core_port import CorePort
from workbench.device.bus import BusError
from workbench.device.controller.play import play_by_controller
from workbench.device.tables.table_file import TableFile, bounds_of
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.robot.servo_profile_file import servo_profile

TABLES = (walk(cycles=3, stops=True), sections(2, 4, 2, cycles=3))
WALK = load_motion(data_file("robotis_walk.csv")).as_table()
BOUNDS = bounds_of(WALK, puppy_model())


def whole_sessions() -> dict[int, int]:
    """Transactions of each session in which nothing goes wrong; nothing is to be complained of."""
    runs = {session: Injection(session, 0, 0).run(TABLES) for session in range(len(SESSIONS))}
    assert {s: complaint(r) for s, r in runs.items() if complaint(r)} == {}
    return {session: run.transactions for session, run in runs.items()}


def campaign(count: int, skip: int = 0, step: int = 1) -> list[str]:
    """Every `step`-th of so many injections, from `skip` on; the monitor's complaints."""
    lengths = whole_sessions()
    return [f"{i}: {c}" for i in injections(count, lengths, skip, step) if (c := complaint(i.run(TABLES)))]


def test_nine_hundred_faults_break_nothing() -> None:
    assert campaign(900) == []


SENT = "    bool sent = r->state == STATE_PLAY"
PLANTED = {
    "a stop that starts": ("commands.c", SENT, "    if (r->state == STATE_LIMP) enter(r, STATE_CHECK, reason, 0xFF);\n" + SENT),
    "START held does nothing where it stands still": ("reactions.c", "still || reason == REASON_HELD))", "still))"),
    "no judgement after a reset": ("reactions.c", "if (!torque_on(r) && r->state != STATE_STILL) return;",
                                   "if (!torque_on(r)) return;"),
    "torque off is sent once": ("commands.c", "if (!known) r->send_release = true;", "(void)known;"),
    "speed 0 goes out": ("motion.c", "    if (speed) return (uint16_t)speed;", "    return (uint16_t)speed;"),
    "the first ramp at full force": ("robot.c", "        r->gentle = true;", "        r->gentle = false;"),
    "a silent servo is not found": ("reactions.c", "        if (silent) react", "        if (silent && s->missed > 200u) react"),
    "a check continues after a release": ("commands.c", "        enter(r, STATE_LIMP, REASON_LINK, 0xFF);",
                                        "        if (torque_on(r)) enter(r, STATE_LIMP, REASON_LINK, 0xFF);"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTED)
def test_the_campaign_finds_a_planted_fault(name: str, tmp_path: Path) -> None:
    file, was, instead = PLANTED[name]
    shutil.copytree(FIRMWARE, tmp_path / "firmware", ignore=shutil.ignore_patterns("corpus*"))
    text = (tmp_path / "firmware" / "core" / file).read_text()
    assert text.count(was) == 1
    (tmp_path / "firmware" / "core" / file).write_text(text.replace(was, instead))
    library = ctypes.CDLL(str(compile_core(source=tmp_path / "firmware")))
    lengths = whole_sessions()
    assert any(complaint(i.run(TABLES, library)) for i in injections(3000, lengths))


def test_every_fault_and_session_is_among_them() -> None:
    lengths = whole_sessions()
    chosen = list(injections(500, lengths))
    assert {(i.session, FAULTS[i.fault]) for i in chosen} == {(s, f) for s in lengths for f in FAULTS[1:]}
    assert all(1 <= i.k <= lengths[i.session] for i in injections(20_000, lengths))


@pytest.mark.parametrize(("injection", "once_said"), [
    (Injection(1, FAULTS.index("packet lost"), 3040, 3434, 2), "torque off was told too seldom on a bad line"),
    (Injection(3, FAULTS.index("packet flipped"), 800, 21080, 2), "torque off met every other packet, which was spoiled"),
    (Injection(4, FAULTS.index("late boot"), 743, 2064), "the bridge began while a servo had not heard that torque is off"),
    (Injection(1, FAULTS.index("late boot"), 814, 489), "a servo that started later kept its torque after a release"),
    (Injection(3, FAULTS.index("late boot"), 1623, 979), "rounds of many silent servos took too long"),
    (Injection(0, FAULTS.index("supply dip"), 1150, 642), "restarted servos got torque from the next pose"),
])
def test_what_the_campaign_once_found(injection: Injection, once_said: str) -> None:
    assert complaint(injection.run(TABLES)) == "", once_said


@pytest.mark.parametrize("rule", range(1, len(RULES)))
def test_the_monitor_sees_what_breaks_each_rule(rule: int) -> None:
    """A healthy robot in its hands, and one thing that is not."""
    monitor = core_monitor(joints=2)
    for ms in range(300):
        monitor.joints(torque=False)
        monitor.look(ms)
    monitor.joints(torque=True, speed=40, limit=1023 if rule == 6 else 512, goal=512)
    monitor.look(300, go=True)
    if rule in (1, 2):
        for ms in range(301, 400):
            if rule == 1:
                monitor.joints(torque=ms < 310 or ms > 380)
            monitor.look(ms, release=ms == 301)
    elif rule == 3:
        for ms in range(301, 400):
            monitor.joints(goal=512 if ms < 360 else 600)
            monitor.look(ms, stop=ms == 301)
    elif rule in (4, 5):
        monitor.joints(**({"goal": 950} if rule == 4 else {"speed": 0}))
        monitor.look(301)
    elif rule == 7:
        for ms in range(301, 3300):
            monitor.joints(goal=600, hot=ms > 2600)
            monitor.look(ms)
    assert monitor.rule == rule


@dataclass
class Trouble:
    """A fault in a session of the host at `at` ms: see `make`."""

    kind: str
    at: int
    servo: int


KINDS = ("nothing", "mute", "hot", "overload", "twin", "babble", "START held", "remote 1", "remote 6", "link cut", "watchdog",
         "flips", "Ctrl-C", "Ctrl-C, twice", "supply")


def make(trouble: Trouble, sim: Sim, port: CorePort) -> None:
    """It happens."""
    if trouble.kind in ("mute", "overload", "twin"):
        sim.set(trouble.kind, 1, trouble.servo)
    elif trouble.kind == "hot":
        sim.set("heat", 70, trouble.servo)
    elif trouble.kind == "babble":
        sim.set("babble", 1)
    elif trouble.kind == "START held":
        sim.set("start", 1)
    elif trouble.kind in ("remote 1", "remote 6"):
        low, high = (16, 0) if trouble.kind == "remote 1" else (0, 2)
        sim.put(bytes([0xFF, 0x55, low, low ^ 255, high, high ^ 255]) * 2, 1)
    elif trouble.kind == "link cut":
        port.unplugged = True
    elif trouble.kind == "watchdog":
        sim.lib.sim_reset(sim.p, sim.table, len(sim.table), 3)
    elif trouble.kind == "flips":
        port.flips = 0.002
    elif trouble.kind == "supply":
        sim.set("volts", 60)


def host_session(trouble: Trouble, folder: Path) -> str:
    """The host's verb against the core with trouble; "" or the complaint about its end."""
    sim = Sim(walk(), seed=trouble.at)
    done: list[int] = []
    plays: list[int] = []
    asked: list[bool] = []  # whether a person wants torque: a button pressed while the robot is limp

    def each_ms() -> None:
        if not done and port.ms >= trouble.at:
            done.append(port.ms)
            asked.append(trouble.kind in ("START held", "remote 1") and not any(sim.get("torque", j) for j in range(15)))
            make(trouble, sim, port)
        if sim.get("state") == 5:
            plays.append(port.ms)

    port = CorePort(sim, each_ms, seed=trouble.at)

    def stop() -> str:
        if not trouble.kind.startswith("Ctrl-C") or port.ms < trouble.at:
            return ""
        return trouble.kind if port.ms > trouble.at + 150 else "Ctrl-C"

    port.run(200)
    try:
        run = play_by_controller(port, TableFile(WALK, BOUNDS, 2, True), 0.936, folder / "log.csv", servo_profile("AX-12A"), stop)
        said, well = run.stopped, not run.stopped
    except BusError as e:
        said, well = str(e), False
    if well and len(plays) < 900:
        return f"said well, but played {len(plays)} ms"
    before = len(plays)
    sim.set("babble", 0)
    sim.set("start", 0)
    port.run(400)
    torque = sum(sim.get("torque", j) for j in range(15))
    if torque and "not confirmed" not in said and not any(asked):
        return f"said {said!r}, and {torque} servos have torque"
    if len(plays) > before and "not confirmed" not in said:
        return f"said {said!r}, and it plays on"
    return "" if said or well else "ended without a word"


def host_sessions(count: int, seed: int, folder: Path) -> tuple[int, list[str]]:
    """Sessions of the host with trouble of each kind in turn; their number, and complaints about their ends."""
    rng = random.Random(seed)
    troubles = [Trouble(KINDS[n % len(KINDS)], rng.randrange(150, 5200), rng.randrange(15)) for n in range(count)]
    return count, [f"{t}: {c}" for t in troubles if (c := host_session(t, folder))]


@pytest.mark.parametrize("kind", ["START held", "remote 1"])
def test_a_person_may_ask_for_torque_once_the_host_has_let_go(kind: str, tmp_path: Path) -> None:
    assert host_session(Trouble(kind, 4900, 5), tmp_path) == ""


def test_the_host_says_well_only_where_all_was_done_and_leaves_no_torque(tmp_path: Path) -> None:
    assert host_sessions(3 * len(KINDS), 5, tmp_path)[1] == []
