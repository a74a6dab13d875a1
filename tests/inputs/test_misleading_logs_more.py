"""Servo logs that mislead, with faults that come and go, or that look like motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from workbench.recording import Recording, read_recording

COUNT = 360 / 4096
RATE = 50
Columns = dict[str, np.ndarray]


def _answer(time: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """A servo that is 20 ms late, 40 ms slow, in counts [deg]."""
    fine = np.arange(0, time[-1] + 0.002, 0.002)
    asked = goal[np.clip(np.searchsorted(time, fine - 0.02, side="right") - 1, 0, len(goal) - 1)]
    out, q, w = np.empty(len(fine)), float(goal[0]), 0.0
    for i, to in enumerate(asked):
        w += (np.clip(25 * (to - q), -300, 300) - w) * 0.002 / 0.03
        q += w * 0.002
        out[i] = q
    return np.asarray(np.round(np.interp(time, fine, out) / COUNT) * COUNT)


def _goals(kind: str, time: np.ndarray, phase: float, seed: int) -> np.ndarray:
    if kind == "steps":
        return np.asarray(np.random.default_rng(seed).uniform(-25, 25, 60)[(time / 0.6).astype(int)])
    return np.asarray(25 * np.sin(3.1 * time + phase) + 10 * np.sin(7.3 * time + 1 + 2 * phase))


def _columns(kind: str = "sines") -> Columns:
    time = np.arange(12 * RATE) / RATE
    out = {"time": time}
    for k, joint in enumerate(("hip", "knee")):
        out[f"goal.{joint}"] = _goals(kind, time, 1.3 * k, k)
        out[f"position.{joint}"] = _answer(time, out[f"goal.{joint}"])
    return out


_KEPT = {kind: _columns(kind) for kind in ("sines", "steps")}


def _read(folder: Path, columns: Columns) -> Recording:
    path = folder / "log.csv"
    rows = np.column_stack(list(columns.values()))
    path.write_text("\n".join([",".join(columns), *(",".join(f"{v:.7g}" for v in row) for row in rows)]) + "\n")
    return read_recording(path)


def _with(kind: str, change: Callable[[np.ndarray], None], name: str = "position.knee") -> Columns:
    columns = {n: v.copy() for n, v in _KEPT[kind].items()}
    change(columns[name])
    return columns


def _hangs(first: float, last: float) -> Callable[[np.ndarray], None]:
    def change(p: np.ndarray) -> None:
        a, b = round(first * RATE), round(last * RATE)
        p[a:b] = np.round((-18 + (p[a] + 18) * np.exp(-np.arange(b - a) / (0.15 * RATE))) / COUNT) * COUNT
    return change


def _kept(value: float, rows: int) -> Callable[[np.ndarray], None]:
    def change(p: np.ndarray) -> None:
        for at in (90, 210, 330, 450):
            p[at:at + rows] = value
    return change


@pytest.mark.parametrize("kind", ["sines", "steps"])
def test_a_sound_log_has_no_problems(tmp_path: Path, kind: str) -> None:
    assert _read(tmp_path, _KEPT[kind]).problems == ()


@pytest.mark.parametrize("kind", ["sines", "steps"])
def test_a_servo_that_lets_go_and_holds_again_is_left_out_meanwhile(tmp_path: Path, kind: str) -> None:
    log = _read(tmp_path, _with(kind, _hangs(5.0, 7.5)))
    assert any("position.knee: no longer depends on goal.knee from" in p and "follows again" in p for p in log.problems)
    gap = np.flatnonzero(np.isnan(log.channels["position.knee"]))
    assert 240 <= gap[0] <= 290
    assert 360 <= gap[-1] <= 400
    assert not np.isnan(log.channels["position.hip"]).any()


@pytest.mark.parametrize("value", [0.0, -1.0, -180.0])
def test_a_value_that_means_no_answer_for_several_rows_is_taken_out(tmp_path: Path, value: float) -> None:
    log = _read(tmp_path, _with("sines", _kept(value, 6)))
    assert any("position.knee:" in p and "taken out" in p for p in log.problems)
    assert np.isnan(log.channels["position.knee"]).sum() >= 12


@pytest.mark.parametrize(("change", "said"), [
    (lambda p: np.copyto(p, np.clip(p, -9, 9)), "a stop, or a sensor or register that is cut off"),
    (lambda p: np.copyto(p, -30 + np.round(0.4 * np.random.default_rng(1).normal(size=len(p))) * COUNT),
     "does not follow goal.knee"),
    (lambda p: np.copyto(p, p + 25), "from goal.knee throughout"),
])
def test_what_keeps_a_joint_from_its_goals_is_told(tmp_path: Path, change: Callable[[np.ndarray], None], said: str) -> None:
    assert any(p.startswith("position.knee: ") and said in p for p in _read(tmp_path, _with("sines", change)).problems)


def test_a_joint_exchanged_with_one_that_is_mounted_the_other_way(tmp_path: Path) -> None:
    kept = _KEPT["sines"]
    log = _read(tmp_path, kept | {"position.hip": -kept["position.knee"], "position.knee": -kept["position.hip"]})
    assert any("position.knee: follows goal.hip" in p for p in log.problems)


def test_a_column_that_stands_there_twice(tmp_path: Path) -> None:
    kept = _KEPT["sines"]
    log = _read(tmp_path, kept | {"position.hip": kept["position.knee"]})
    assert [p for p in log.problems if "position.hip: follows goal.knee" in p]
    assert not any(p.startswith("position.knee") for p in log.problems)


def test_relative_goals_of_all_joints_are_told_as_that(tmp_path: Path) -> None:
    kept = _KEPT["sines"]
    log = _read(tmp_path, {n: np.append(np.diff(v), 0) if n.startswith("goal") else v for n, v in kept.items()})
    assert [p.partition(":")[0] for p in log.problems] == ["goal.hip", "goal.knee"]


@pytest.mark.parametrize(("voltage", "said"), [
    (lambda n: np.zeros(n), "voltage: is 0 in every row"),
    (lambda n: np.where(np.arange(n) < n // 2, 11.9, 4.2), "voltage: falls from 11.9 V to 4.2 V"),
])
def test_a_supply_that_no_servo_runs_on(tmp_path: Path, voltage: Callable[[int], np.ndarray], said: str) -> None:
    kept = _KEPT["sines"]
    assert any(p.startswith(said) for p in _read(tmp_path, kept | {"voltage": voltage(len(kept["time"]))}).problems)


def test_times_in_minutes_are_told(tmp_path: Path) -> None:
    kept = _KEPT["sines"]
    assert any("minutes" in p for p in _read(tmp_path, kept | {"time": kept["time"] / 60}).problems)


def test_a_log_written_faster_than_the_bus_is_read(tmp_path: Path) -> None:
    def change(p: np.ndarray) -> None:
        p[:] = np.repeat(p[::4], 4)
    assert any("is new only in every 4th row" in p for p in _read(tmp_path, _with("sines", change)).problems)
