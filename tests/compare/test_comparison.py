"""Sessions and files compared end to end: an arm on a stand, made worse in one joint, seen through a made-up capture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.gap_sessions import STARTS_AT, record_arm, session_content, write_session
from tests.shared_data import practice
from workbench.compare.compare_files import compare_files, file_kind
from workbench.compare.compare_session import compare_session
from workbench.compare.comparison import compare_takes
from workbench.compare.results import Comparison
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.recording.formats.rollout_table import save_rollout
from workbench.recording.take import Take
from workbench.simulation import Simulation, SimulationConfig

WORN = 0.35  # N m of Coulomb friction in joint three, nominal 0.06


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    record_arm(folder, friction=WORN)
    record_arm(folder, "healthy", seed=1)
    return folder


def session_of(folder: Path, name: str, **takes: str) -> Path:
    """A session of the takes NAME=recording."""
    content = session_content()
    take = content["takes"][0]
    content["takes"] = [{**take, "name": n, "recording": f"takes/{r}.csv"} for n, r in takes.items()]
    path = write_session(folder, content)
    return path.rename(folder / name)


@pytest.fixture(scope="module")
def compared(folder) -> Comparison:
    said: list[tuple[str, float | None]] = []
    (folder / "takes/cut.csv").write_text((folder / "takes/wave.csv").read_text()[:-40])
    path = session_of(folder, "worn.yaml", wave="wave", cut="cut", healthy="healthy")
    comparison = compare_session(load_session(path), progress=lambda what, done=None: said.append((what, done)), n_jobs=1)
    assert ("simulating", 1.0) in said
    return comparison


def test_start_is_found_between_frames(compared):
    for take in compared.takes:
        assert take.starts_at == pytest.approx(STARTS_AT, abs=1.5e-3)


def test_the_worn_joint_leads_and_the_others_lie_at_the_noise(compared):
    wave, healthy = compared.takes
    assert wave.joints_by_error()[0] == "three"
    assert compared.joints_by_error()[0] == "three"
    assert wave.joints["three"].over_noise > 3
    for channel in (wave.joints["one"], wave.joints["two"], *healthy.joints.values()):
        assert channel.error < 1.3 * channel.noise
        assert channel.noise == pytest.approx(np.deg2rad(0.17), rel=0.25)
        assert channel.floor < 0.3 * channel.noise


def test_a_body_on_a_stand_stays(compared):
    body = compared.takes[0].body
    assert body is not None
    assert body.error < 1.5 * body.noise
    assert body.noise == pytest.approx(np.sqrt(3) * 1e-4, rel=0.3)


def test_a_damaged_take_is_named_and_left_out(compared):
    assert [t.name for t in compared.takes] == ["wave", "healthy"]
    ((name, why),) = compared.left_out
    assert name == "cut"
    assert "cut.csv" in why


def test_json_as_the_contract_says(compared, tmp_path):
    content = json.loads(compared.save(tmp_path / "new" / "comparison.json").read_text())
    assert content["format"] == 1
    take = content["takes"][0]
    assert take["name"] == "wave"
    assert take["starts_at"] == pytest.approx(STARTS_AT, abs=1.5e-3)
    three = take["joints"]["three"]
    assert {"error", "noise", "floor", "unit"} <= set(three)
    assert three["unit"] == "deg"
    assert three["error"] == pytest.approx(np.rad2deg(compared.takes[0].joints["three"].error), rel=1e-6)
    assert take["body"]["unit"] == "m"
    assert {"recorded", "simulated"} <= set(take["distance"])
    assert take["heading"]["unit"] == "deg"
    assert content["joints_by_error"][0] == "three"
    assert content["left_out"][0]["name"] == "cut"
    assert len(content["provenance"]["model_sha256"]) == 64
    assert next(iter(take["joints"])) == "three"


def test_table_names_each_take_and_joint(compared):
    table = compared.table()
    assert "wave: first command at 0.41" in table
    assert table.index("three") < table.index("two")


def test_nothing_left_is_an_error_in_one_line(folder):
    with pytest.raises(InputError, match=r"cut.*cut\.csv") as caught:
        compare_session(load_session(session_of(folder, "cut.yaml", cut="cut")))
    assert "\n" not in str(caught.value)


def test_an_asset_without_a_link_is_refused(folder):
    path = session_of(folder, "unlinked.yaml", wave="wave")
    path.write_text(path.read_text().replace("    Middle: middle\n", ""))
    with pytest.raises(InputError, match=r"wave\.csv.*Middle"):
        compare_session(load_session(path))


def test_only_markers_cannot_be_compared(folder):
    lines = (folder / "takes/wave.csv").read_text().splitlines()
    head = [",".join(line.split(",")[:2]) for line in lines[2:]]
    (folder / "takes/markers.csv").write_text("\n".join([*lines[:2], *head]) + "\n")
    with pytest.raises(InputError, match=r"markers: .*markers\.csv: .*expected"):
        compare_session(load_session(session_of(folder, "markers.yaml", markers="markers")))


def arm_run(folder: Path, start: float = 0.0) -> Take:
    session = load_session(session_of(folder, "run.yaml", wave="wave"))
    commands = session.takes[0].commands(session.model)
    take = Simulation(session.model, SimulationConfig(base="fixed")).run(commands, None, 0.3, name="run")
    return replace(take, time=take.time + start, starts_at=start)


def test_takes_on_other_clocks_are_laid_over_each_other(folder):
    model = load_session(session_of(folder, "run.yaml", wave="wave")).model
    a, b = arm_run(folder), arm_run(folder, 2.00037)
    thinned = replace(b, time=b.time[::7], q=b.q[::7], v=None, torque=None, p_WB=None, quat_WB=None)
    same = compare_takes(thinned, a, model)
    assert all(c.error < 1e-4 for c in same.joints.values())
    late = compare_takes(replace(thinned, starts_at=b.starts_at - 0.02), a, model)
    assert late.joints["one"].lag == pytest.approx(0.02, abs=2e-4)
    assert late.joints["one"].correlation < 0.99999
    assert np.isnan(late.joints["one"].floor)
    assert late.body is None


def test_takes_of_different_robots_are_refused(folder):
    a = arm_run(folder)
    with pytest.raises(InputError, match="no joint in common"):
        compare_takes(a, replace(a, joints=("x", "y", "z")), load_session(folder / "run.yaml").model)


@pytest.fixture(scope="module")
def pair_files(folder) -> dict[str, Path]:
    return {"motion": folder / "motions/wave.csv", "rollout": save_rollout(arm_run(folder), folder / "run.csv"),
            "recording": folder / "takes/wave.csv", "other_recording": folder / "takes/healthy.csv"}


def test_kinds_are_told_by_content(pair_files, tmp_path):
    for name, path in pair_files.items():
        assert file_kind(path) == name.removeprefix("other_")
    (tmp_path / "log.csv").write_text("time,goal.one,position.one\n0,0,0\n")
    assert file_kind(tmp_path / "log.csv") == "recording"
    (tmp_path / "bare.csv").write_text("0,1,2\n")
    assert file_kind(tmp_path / "bare.csv") == "motion"
    with pytest.raises(InputError, match="cannot be read"):
        file_kind(tmp_path / "none.csv")


@pytest.mark.parametrize(("a", "b", "error", "floor"), [
    ("motion", "motion", 0.0, True), ("rollout", "motion", 1e-4, True), ("rollout", "rollout", 1e-9, False),
    ("recording", "motion", 0.0035, True), ("motion", "recording", 0.0035, True), ("recording", "rollout", 0.0035, False),
    ("recording", "other_recording", 0.005, False)])
def test_any_two_files(folder, pair_files, a, b, error, floor):
    model = load_session(session_of(folder, "run.yaml", wave="wave")).model
    result = compare_files(pair_files[a], pair_files[b], model, cycles=2, base="fixed", n_jobs=1).takes[0]
    assert result.joints["one"].error <= error
    assert np.isfinite(result.joints["one"].floor) == floor
    if "recording" in (a, b):
        assert result.joints_by_error()[0] == "three"
        assert result.recorded.source == "recording"


@pytest.fixture(scope="module")
def spoilt(pair_files, tmp_path_factory) -> Path:
    """Files that cannot be compared: tables of one row, of none, of another robot and without a position; takes that are short,
    and of a robot that stands still."""
    folder = tmp_path_factory.mktemp("spoilt")
    table, take = (pair_files[kind].read_text().splitlines() for kind in ("rollout", "recording"))
    head, rows = table[:4], table[4:]
    start = next(k for k, line in enumerate(take) if line.startswith("Frame")) + 1
    still = take[start].split(",", 2)[2]
    for name, lines in {
            "one": [*head, rows[0]], "none": head, "short": take[:start + 5],
            "other": [*head[:3], head[3].replace("position.", "position.x"), *rows],
            "blank": [*head, *(f"{row.split(',')[0]}{',' * row.count(',')}" for row in rows)],
            "still": [*take[:start], *(f"{k},{k / 100:.3f},{still}" for k in range(100))]}.items():
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize(("name", "said"), [
    ("one", "holds 1 frame"), ("none", "line 5: is missing; expected a row for each frame"), ("short", "holds 5 frame"),
    ("other", "no joint in common with the model"), ("blank", "no joint has a position"),
    ("still", "yaw: no tracked joint turns")])
def test_what_cannot_be_compared_is_refused_before_anything_is_simulated(folder, pair_files, spoilt, name, said):
    def simulated(what: str, done: float | None = None) -> None:
        pytest.fail(f"{what}, before its input was checked")

    model, bad = load_session(session_of(folder, "run.yaml", wave="wave")).model, spoilt / f"{name}.csv"
    for a, b in ((bad, pair_files["motion"]), (pair_files["motion"], bad)):
        with pytest.raises(InputError, match=f"{name}.csv: {said}"):
            compare_files(a, b, model, cycles=2, progress=simulated, base="fixed", n_jobs=1)


@pytest.mark.slow
def test_practice_session_without_hidden_physics():
    """Issue 2: joint errors within 1.3 times the noise on the stand, within 2 times walking."""
    comparison = compare_session(load_session(practice("p0_nothing_hidden")))
    assert [t.name for t in comparison.takes] == ["stand", "sway", "walk"]
    for take in comparison.takes:
        for channel in take.joints.values():
            assert channel.error < (1.3 if take.recorded.base == "fixed" else 2.0) * channel.noise
    walk = comparison.takes[2]
    assert walk.distance is not None
    assert walk.distance.simulated == pytest.approx(walk.distance.recorded, rel=0.05)
    assert set(walk.recorded_phases) == {"blb", "brb", "flb", "frb"}


@pytest.mark.slow
def test_practice_session_with_backlash():
    comparison = compare_session(load_session(practice("p1_backlash")))
    assert comparison.joints_by_error()[0] == "flm"
    assert all(t.joints_by_error()[0] == "flm" for t in comparison.takes if t.name in ("stand", "walk"))
