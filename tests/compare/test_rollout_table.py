"""A take as one table, written and read back."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.formats.rollout_table import is_rollout, load_rollout, save_rollout
from workbench.recording.take import Take

COMMANDS = Commands(
    times=np.array([0.0, 0.1404]), joints=("a", "b"),
    goals=np.array([[0.1, -0.2], [0.3, 1 / 3]]), speeds=np.array([[0.5, 0], [1, 2.0]]),
    enabled=np.array([[True, False], [True, True]]), end=0.25, poses=np.array([0, -1]))


def a_take(n: int = 50) -> Take:
    rng = np.random.default_rng(2)
    q = rng.normal(size=(n, 2))
    q[7, 1] = np.nan
    return Take(
        name="walk, fast", source="simulation", time=np.arange(n) * 1e-3 - 0.02, joints=("a", "b"), q=q, starts_at=0.0,
        v=rng.normal(size=(n, 2)), torque=rng.normal(size=(n, 2)), p_WB=rng.normal(size=(n, 3)), quat_WB=rng.normal(size=(n, 4)),
        contact={"a": rng.normal(size=(n, 3))}, commands=COMMANDS, problems=("mended 3 frames",))


def test_read_back_as_written(tmp_path):
    take = a_take()
    back = load_rollout(save_rollout(take, tmp_path / "new" / "rollout.csv"))
    assert (back.name, back.source, back.joints, back.base) == ("walk, fast", "simulation", ("a", "b"), "free")
    assert not back.zeroed
    assert (back.starts_at, back.problems) == (0.0, take.problems)
    for key in ("time", "q", "v", "torque", "p_WB", "quat_WB"):
        np.testing.assert_allclose(getattr(back, key), getattr(take, key), atol=1e-7)
    np.testing.assert_allclose(back.contact["a"], take.contact["a"], atol=1e-7)
    assert back.commands is not None
    for key in ("times", "goals", "speeds", "enabled", "poses"):
        np.testing.assert_allclose(getattr(back.commands, key), getattr(COMMANDS, key), rtol=1e-12)


def test_header_tells_the_format_and_degrees(tmp_path):
    lines = save_rollout(a_take(), tmp_path / "r.csv").read_text().splitlines()
    assert is_rollout(lines[0])
    assert not is_rollout("time,position.a")
    assert lines[3].startswith("time,position.a,position.b,velocity.a")
    assert float(lines[4].split(",")[1]) == pytest.approx(np.rad2deg(a_take().q[0, 0]), abs=1e-6)
    assert lines[4 + 7].split(",")[2] == ""


def test_what_a_take_lacks_stays_away(tmp_path):
    bare = Take(name="x", source="recording", time=np.arange(3.0), joints=("a",), q=np.zeros((3, 1)))
    back = load_rollout(save_rollout(bare, tmp_path / "r.csv"))
    assert np.isnan(back.starts_at)
    assert back.v is None
    assert back.p_WB is None
    assert back.commands is None
    assert not back.contact


@pytest.mark.parametrize(("damage", "words"), [
    (lambda t: t.replace("# workbench rollout", "# another"), "line 1"),
    (lambda t: t.replace("format 1", "format 9"), "expected format 1"),
    (lambda t: t.replace('"zeroed"', '"zero"'), "line 2"),
    (lambda t: t[: t.rindex(",")], "cells"),
    (lambda t: t.replace("\n-0.019,", "\n-0.03,"), "increasing"),
    (lambda t: t.replace("\n-0.019,", "\nsoon,"), "numbers"),
    (lambda t: t.replace("velocity.a", "velocity.c"), "velocity.a"),
    (lambda t: t.replace("position.", "angle."), "position.JOINT"),
    (lambda t: "", "line 1"),
])
def test_damage_is_named(tmp_path, damage, words):
    path = save_rollout(a_take(), tmp_path / "r.csv")
    path.write_text(damage(path.read_text()))
    with pytest.raises(InputError, match=words) as caught:
        load_rollout(path)
    assert str(path) in str(caught.value)
