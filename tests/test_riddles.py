"""The thesis's riddles: what they measure with, on cases with known answers, and each page from end to end, quickly."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.common import run_study
from studies.riddles.__main__ import SUBJECTS, main
from studies.riddles.apart import Number, apart, growth, sigma
from studies.riddles.cameras import POSITION_NOISE, REST, ROTATION_NOISE, YAW, record
from studies.riddles.hypotheses import Hypothesis, Run, Setting, run_all, walk
from studies.riddles.loose_screws import loose
from studies.riddles.rounding import exact_dwells, rounding_errors, with_dwells
from studies.riddles.small import lateness, without_last
from studies.riddles.speed_order import misplaced_goals, sweep_motion
from workbench.compare.results import Channel
from workbench.motion import interpolate_motion
from workbench.recording.take import Take
from workbench.robot import BUS_IDS, EffectSpec, puppy_model

MODEL = puppy_model()
SECONDS = 1.2


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    """A tight robot, one with a loose mount, and one with backlash."""
    gap = Hypothesis("backlash", "", (EffectSpec("backlash", ("flm",), {"gap": 4.0}),))
    named = [Hypothesis("tight", ""), loose("flm", "x"), gap]
    return run_all(named, MODEL, Setting(SECONDS, walk()), lambda what, share: None)


def test_a_filmed_robot_is_registered_where_it_was_filmed(runs: dict[str, Run]) -> None:
    recorded = record(runs["tight"].take, MODEL, SECONDS, runs["tight"].take)
    assert len(recorded.recording.rigid_bodies) == 14
    assert recorded.measurement.starts_at == pytest.approx(REST, abs=1e-3)
    assert recorded.measurement.yaw == pytest.approx(YAW, abs=np.radians(0.1))
    rest = recorded.take.resting
    body = recorded.take.bodies["body"].p[rest]
    assert body.std(axis=0, ddof=1) == pytest.approx(POSITION_NOISE, rel=0.35)
    noise = recorded.take.q[rest].std(axis=0, ddof=1)  # of two bodies
    assert np.median(noise) == pytest.approx(np.sqrt(2) * ROTATION_NOISE, rel=0.2)


def test_a_robot_is_no_more_than_noise_from_itself(runs: dict[str, Run]) -> None:
    found = apart(runs["tight"], runs["tight"], MODEL, SECONDS)
    assert found.sigma(found.worst()) < 1.5  # noise is known from 58 frames
    assert sigma(found.off_axis[found.worst_off_axis()]) < 1.5


def test_a_loose_mount_shows_off_its_axis_and_backlash_does_not(runs: dict[str, Run]) -> None:
    is_loose, play = (apart(runs[n], runs["tight"], MODEL, SECONDS) for n in ("loose flm x", "backlash"))
    assert is_loose.worst_off_axis() == "flm"
    assert sigma(is_loose.off_axis["flm"]) > 4
    assert max(map(sigma, play.off_axis.values())) < 1.5
    assert play.worst() == "flm"
    assert play.sigma("flm") > 2


def test_sigma_takes_what_is_known() -> None:
    assert sigma(Channel(10.0, noise=3.0, floor=4.0)) == pytest.approx(2.0)
    assert sigma(Channel(13.0, noise=3.0, floor=4.0, spread=12.0)) == pytest.approx(1.0)
    assert Number(1.0, 3.0, 4.0).doubt == pytest.approx(5.0)
    assert Number(1.0).doubt == 0.0


def test_the_growth_of_a_lag_is_found() -> None:
    """Angles that come 30 ms late from the start and 5 ms a second more; one joint that stands still says nothing."""
    motion = walk()
    reference = interpolate_motion(motion, 28, 1e-3, "rest")
    joints = ("flb", "frm", "head")
    time = np.arange(-0.5, 12.0, 1 / 120)
    due = time - 0.03 - 0.005 * np.maximum(time, 0)
    asked = [np.interp(due, reference.time, reference.q[:, reference.column(j)]) for j in joints]
    q = np.where(due[:, None] > 0, np.column_stack(asked), 0)
    q += np.radians(0.17) * np.random.default_rng(3).standard_normal(q.shape)
    found = growth(Take("late", "known", time, joints, q, starts_at=0.0), reference, motion.duration)
    assert found.slope == pytest.approx(0.005, abs=1e-4)
    assert abs(found.slope - 0.005) < 4 * found.sigma + 1e-5
    assert found.at_start == pytest.approx(0.03, abs=1e-3)
    assert set(found.by_joint) == {"flb", "frm"}


def test_rounding_cancels_in_every_cycle() -> None:
    due, late = rounding_errors(walk(), 5)
    assert 1e3 * late[:5] == pytest.approx([0, -0.4, -0.6, -0.2, 0.0], abs=1e-6)
    assert late[::4] == pytest.approx(0, abs=1e-9)
    assert due[-1] == pytest.approx(5 * 0.468)


def test_dwells_are_replaced_in_every_cycle() -> None:
    motion = walk()
    exact = with_dwells(motion.commands(3), exact_dwells(motion))
    assert exact.times[:5] == pytest.approx([0, 0.1404, 0.2436, 0.3372, 0.468])
    assert exact.end == pytest.approx(3 * 0.468)


def test_misplaced_goals_go_by_bus_id() -> None:
    sent = walk().commands(1)
    wrong = misplaced_goals(sent)
    first, last = min(BUS_IDS, key=lambda j: BUS_IDS[j]), max(BUS_IDS, key=lambda j: BUS_IDS[j])  # tail and head
    assert wrong.goals[:, wrong.column(first)] == pytest.approx(sent.goals[:, sent.column("blb")])
    assert wrong.goals[:, wrong.column(last)] == pytest.approx(sent.goals[:, sent.column("tail")])
    assert np.array_equal(wrong.speeds, sent.speeds)


def test_the_sweep_has_a_whole_count_of_speed() -> None:
    table = sweep_motion(MODEL).as_table()
    assert table.speeds[-1].max() == 20
    assert np.degrees(np.abs(table.angles()[-1] - table.angles()[-2]).max()) == pytest.approx(120, abs=0.3)


def test_algorithm_3_1_read_literally_sends_one_pose_less() -> None:
    sent = walk().commands(2)
    short = without_last(sent)
    assert len(short.times) == 7
    assert short.poses[-1] == 2
    assert short.end == sent.times[7]


def test_the_first_pose_is_late_by_what_the_ramp_lacks() -> None:
    """A robot that follows its ramps to the letter."""
    motion = walk()
    sent = motion.commands(4)
    time = np.arange(-0.1, 1.8, 1 / 120)
    take = Take("ramps", "known", time, sent.joints, sent.reference(time), starts_at=0.0)
    ramp, first, later = lateness(take, motion)["flb"]
    assert ramp == pytest.approx(np.radians(73.24) - 0.14 * sent.speeds[0, sent.column("flb")], abs=np.radians(0.3))
    assert first == pytest.approx(ramp, abs=np.radians(1.0))
    assert later < np.radians(1.0)


def test_hypotheses_change_nothing_but_what_they_say() -> None:
    h = replace(loose("flt", "z"), servos={"supply_voltage": 8.0})
    robot = h.robot(MODEL)
    assert robot.effects[-1].where == ("flt",)
    assert robot.servo("flb").supply_voltage == 8.0
    assert Hypothesis("same", "").robot(MODEL).sha256 == MODEL.sha256


@pytest.mark.slow
@pytest.mark.parametrize("subject", list(SUBJECTS))
def test_a_riddle_from_end_to_end(subject: str, tmp_path: Path) -> None:
    assert main(["--out", str(tmp_path), "--quick", "--subject", subject]) == 0
    page = (tmp_path / subject / "index.html").read_text()
    for title in ("Hypotheses and rivals", "What the recording would show", "Which measurement decides"):
        assert title in page
    numbers = json.loads((tmp_path / subject / "numbers.json").read_text())
    assert numbers["model_sha256"] == MODEL.sha256
    assert ">nan" not in page
    assert "NaN" not in page
    assert any(path.stat().st_size > 10_000 for path in (tmp_path / subject).glob("*.png"))


def test_a_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert run_study("riddles", "Doc.", SUBJECTS["small"], ["--out", str(tmp_path / "file" / "deeper"), "--quick"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
