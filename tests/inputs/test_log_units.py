"""Units, signs and zeros of servo logs that contradict the limits of a servo, or another channel of the same joint."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.inputs.corpus import swing
from workbench.recording import read_recording

COUNT = 360 / 4096
Columns = dict[str, np.ndarray]


def _two_joints() -> Columns:
    """A hip, and a knee that goes half as far about 5 deg, by another sensor."""
    time, goal, position = swing()
    knee = np.round((0.5 * position + 5) / 0.29326) * 0.29326
    return {"time": time, "goal.hip": goal, "position.hip": position, "goal.knee": 0.5 * goal + 5, "position.knee": knee}


def _told(folder: Path, columns: Columns) -> tuple[str, ...]:
    rows = np.column_stack(list(columns.values()))
    (folder / "log.csv").write_text("\n".join([",".join(columns), *(",".join(f"{x:.13g}" for x in row) for row in rows)]) + "\n")
    return read_recording(folder / "log.csv").problems


def _scaled(part: str, factor: float) -> Callable[[Columns], Columns]:
    return lambda c: {k: v * factor if part in k else v for k, v in c.items()}


def _with(name: str, value: Callable[[Columns], np.ndarray]) -> Callable[[Columns], Columns]:
    return lambda c: c | {name: value(c)}


def _slope(c: Columns) -> np.ndarray:
    return np.gradient(c["position.hip"], c["time"])


def test_two_sound_joints_in_any_order_have_nothing_to_tell(tmp_path: Path) -> None:
    sound = _two_joints() | {"velocity.hip": _slope(_two_joints()), "voltage": np.full(150, 11.1)}
    assert _told(tmp_path, sound) == ()
    assert _told(tmp_path, dict(reversed(sound.items()))) == ()


@pytest.mark.parametrize(("change", "joint", "said"), [
    (_scaled("hip", np.pi / 180), "hip", "is it in radians"),
    (_scaled("position.hip", np.pi / 180), "position.hip", "is it in radians"),
    (_scaled("goal.knee", np.pi / 180), "goal.knee", "is it in radians"),
    (_with("position.knee", lambda c: -c["position.knee"]), "position.knee", "the other sign"),
    (_with("position.hip", lambda c: c["position.hip"] + 150), "position.hip", "are their zeros the same"),
    (lambda c: {k: v if k == "time" else v / COUNT + 2048 for k, v in c.items()}, "position.hip", "counts"),
    (lambda c: {k: v if k == "time" else v * 1023 / 300 + 512 for k, v in c.items()}, "position.hip", "counts"),
    (_with("velocity.hip", lambda c: np.deg2rad(_slope(c))), "velocity.hip", "radians a second"),
    (_with("velocity.hip", lambda c: _slope(c) / 6), "velocity.hip", "turns a minute"),
    (_with("velocity.hip", lambda c: -_slope(c)), "velocity.hip", "the opposite sign"),
    (_with("voltage", lambda c: np.full(150, 111.0)), "voltage", "tenths of a volt"),
    (_with("voltage", lambda c: np.full(150, 7400.0)), "voltage", "millivolts"),
    (_with("duty.knee", lambda c: 885 * np.sin(c["time"])), "duty.knee", "counts"),
    (_scaled("time", 1e6), "time", "microseconds"),
    (_with("goal.knee", lambda c: np.roll(c["position.knee"], 1)), "goal.knee", "of 1 row(s) before"),
    (_with("goal.knee", lambda c: np.roll(c["position.knee"], -2)), "goal.knee", "of 2 row(s) later"),
])
def test_what_the_channels_say_of_each_other(tmp_path: Path, change: Callable[[Columns], Columns], joint: str, said: str) -> None:
    assert any(joint in line and said in line for line in _told(tmp_path, change(_two_joints())))


def test_a_sensor_that_stands_to_the_end(tmp_path: Path) -> None:
    columns = _two_joints()
    columns["position.knee"][100:] = columns["position.knee"][100]
    (line,) = _told(tmp_path, columns)
    assert "position.knee: no longer depends on goal.knee from 2.020 s" in line
    assert "sensor stood still" in line


def test_a_weak_servo_is_in_no_other_unit(tmp_path: Path) -> None:
    """It goes a third of the way, as an XL-330 at a low gain does, and stands where friction holds it."""
    columns = _two_joints()
    weak = np.round(0.3 * columns["position.hip"] / COUNT) * COUNT
    weak[120:] = weak[120]
    assert _told(tmp_path, columns | {"position.hip": weak}) == ()


@pytest.mark.parametrize("rate", [0.7, 1.5, 2.2])
def test_a_swing_of_any_pace_has_no_other_sign(tmp_path: Path, rate: float) -> None:
    time = np.arange(300) / 50
    goal = 20 * np.sin(2 * np.pi * rate * time)
    late = np.round(0.8 * 20 * np.sin(2 * np.pi * rate * (time - 0.08)) / COUNT) * COUNT
    assert _told(tmp_path, {"time": time, "goal.a": goal, "position.a": late}) == ()


def test_a_log_in_another_unit_loses_no_reading(tmp_path: Path) -> None:
    """Degrees taken as radians leap at each row; they are no readings astray."""
    time, goal, position = swing()
    rows = [f"{1_700_000_000_000_000 + round(t * 1e6)},{g:.6g},{p:.6g}" for t, g, p in zip(time, goal, position)]
    (tmp_path / "x.csv").write_text("\n".join(["__time,/c/reference/positions[0],/c/feedback/positions[0]", *rows]) + "\n")
    log = read_recording(tmp_path / "x.csv")
    assert "is it in degrees" in log.problems[0]
    assert not any("taken out" in line for line in log.problems)
    assert np.isfinite(log.channels["position.joint_1"]).all()
