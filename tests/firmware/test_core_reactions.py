"""The table of reactions in docs/robot.md: each row at random moments of a walk, in the native core."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.firmware.native import NONE, Sim, cell, walk

STILL, LIMP, PLAY, YIELD = 0, 1, 5, 7
SILENT, GARBLED, OVERLOAD, HOT, LOW, DEAD, BABBLE, HELD, BRIDGE = 10, 11, 13, 14, 15, 16, 17, 21, 22
BROWN_OUT, WATCHDOG, REMOTE = 5, 3, 7
DOCS = Path(__file__).parents[2] / "docs" / "robot.md"


@dataclass(frozen=True)
class Cell:
    """fault: number in firmware/tests/cells.h. reaction: continue, ramp, release, or still; ms: within; names: servo is named."""

    fault: int
    reaction: str
    reason: int
    ms: float = 0.0
    names: bool = False


CELLS = {
    "silent servo": Cell(1, "ramp", SILENT, 300, True),
    "two servos with one ID": Cell(2, "ramp", GARBLED, 300, True),
    "wrong model": Cell(3, "continue", REMOTE),
    "overload": Cell(4, "ramp", OVERLOAD, 300, True),
    "heat": Cell(5, "ramp", HOT, 2000, True),
    "low battery": Cell(6, "ramp", LOW, 2000),
    "dead supply": Cell(7, "release", DEAD, 300),
    "bad checksum": Cell(8, "continue", REMOTE),
    "babbling servo": Cell(9, "release", BABBLE, 300),
    "cut upload": Cell(10, "continue", REMOTE),
    "foreign upload": Cell(11, "continue", REMOTE),
    "upload that stops": Cell(12, "continue", REMOTE),
    "lost radio": Cell(13, "continue", REMOTE),
    "START held": Cell(14, "release", HELD, 1600),
    "remote button held": Cell(15, "continue", REMOTE),
    "PC link lost on a walk": Cell(16, "continue", REMOTE),
    "PC link gone in bridge mode": Cell(17, "ramp", BRIDGE, 1300),
    "brown-out": Cell(18, "still", BROWN_OUT),
    "hang": Cell(19, "still", WATCHDOG),
    "single odd readings": Cell(20, "continue", REMOTE),
}


def check(name: str, moments: int) -> None:
    """A row at so many moments; each seed is another moment, another servo, other starting angles."""
    row, table = CELLS[name], walk()
    sim = Sim(table)
    for seed in range(moments):
        run = cell(row.fault, seed, table, 5500, sim)
        where = f"{name}, seed {seed}: {[(f, getattr(run, f)) for f, _ in run._fields_[1:]]}"
        assert run.reason == row.reason, where
        if row.names:
            assert run.servo_named == run.servo_id, where
        if row.reaction == "continue":
            assert (run.state, run.ramp_us, run.off_us) == (PLAY, NONE, NONE), where
            assert run.poses >= 5500 // 140, where
        elif row.reaction == "still":
            assert (run.state, run.poses, run.ramp_us, run.off_us) == (STILL, 0, NONE, NONE), where
        elif row.reaction == "ramp":
            assert run.ramp_us <= min(row.ms * 1000, run.off_us), where
            assert (run.state, run.limp) == (LIMP, 15), where
        else:
            limp = 0 if name == "babbling servo" else 15  # nobody can hear while one babbles
            assert run.off_us <= row.ms * 1000, where
            assert (run.state, run.ramp_us, run.limp) == (LIMP, NONE, limp), where


@pytest.mark.parametrize("name", CELLS)
def test_reaction_at_random_moments(name: str) -> None:
    check(name, int(os.environ.get("MOMENTS", "100")))


@pytest.mark.slow
@pytest.mark.parametrize("name", CELLS)
def test_reaction_at_a_thousand_moments(name: str) -> None:
    check(name, 1000)


def test_every_row_of_the_docs_is_a_cell_here() -> None:
    lines = DOCS.read_text().split("| fault |")[1].split("\n\n")[0].splitlines()[2:]
    rows = {line.split("|")[1].strip(): line for line in lines}
    assert rows.keys() == CELLS.keys()
    for name, cell_ in CELLS.items():
        assert cell_.reaction in rows[name] or (cell_.reaction == "still" and "stands still" in rows[name])


def test_no_torque_where_a_servo_is_missing_wrong_hot_overloaded_or_double() -> None:
    table = walk()
    faults = (("mute", 1, SILENT), ("twin", 1, GARBLED), ("model", 99, 12), ("heat", 66, HOT), ("overload", 1, OVERLOAD))
    for what, value, reason in faults:
        for k in range(15):
            sim = Sim(table, seed=k)
            sim.set(what, value, k)
            sim.run(2300)
            assert (sim.get("state"), sim.get("reason")) == (LIMP, reason), what
            assert sim.get("servo_named") == sim.get("id", k)
            assert not any(sim.get("torque", j) for j in range(15))


def test_no_torque_on_a_low_battery_and_none_after_a_reset() -> None:
    sim = Sim(walk())
    sim.set("volts", 90)
    sim.run(500)
    assert (sim.get("state"), sim.get("reason")) == (LIMP, LOW)
    for cause in (2, 3, 4, 5):
        sim = Sim(walk(), cause=cause)
        sim.run(3000)
        assert (sim.get("state"), sim.get("reason")) == (STILL, cause)
        assert not any(sim.get("event_kind", k) in (1, 2) for k in range(sim.get("events")))
        sim.remote(1)
        sim.remote(0)
        sim.to_neutral()
