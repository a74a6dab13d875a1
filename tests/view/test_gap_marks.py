"""The ledger on the robot in 3D: marks whose colour and size say where and when a recording leaves a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.view.test_scene import film
from tests.view_takes import small_robot, swing
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.view.figures.heat import colours, gradient, shares
from workbench.view.scene.marks import PATH, TILT, Errors
from workbench.view.scene.replay import write_replay

GREY = (0xD9 / 255, 0xD9 / 255, 0xDD / 255)


@pytest.fixture
def model(tmp_path: Path) -> RobotModel:
    return small_robot(tmp_path)


@pytest.fixture
def recorded(model: RobotModel) -> Take:
    seen = swing(model).resampled(np.arange(-0.3, 1.19, 0.01))
    return replace(seen, name="walk", source="capture.csv", contact={}, commands=None)


def errors(take: Take, shown: bool = True) -> Errors:
    """flm is 20 times off across its axis after 0.6 s, flb never seen, the body's path 5 times off throughout, its tilt not."""
    channels = (*take.joints, "flm~z", "forward", "pitch")
    residual = np.full((len(take), len(channels)), 0.5)
    residual[take.time > 0.6, channels.index("flm~z")] = -20.0
    residual[:, channels.index("flb")] = np.nan
    residual[:, channels.index("forward")] = 5.0
    residual[take.time < 0] = np.nan
    return Errors("off the nominal model", take.time, channels, residual, shown)


def test_a_place_has_the_worst_of_its_channels(recorded: Take) -> None:
    places = errors(recorded).by_place(recorded.joints)
    assert set(places) == {*recorded.joints, PATH, TILT}
    assert places["flm"][3] == pytest.approx(0.5)
    assert places["flm"][9] == pytest.approx(20)
    assert np.isnan(places["flb"]).all()
    np.testing.assert_allclose(places[PATH], 5.0)
    np.testing.assert_allclose(places[TILT], 0.5)


def test_the_scale_is_the_maps() -> None:
    ratio = np.array([0.1, 1.3, 6.0, 30.0, 900.0, np.nan])
    np.testing.assert_allclose(shares(ratio)[[0, 1, 3, 4, 5]], [0, 0, 1, 1, 0])
    light = colours(ratio).sum(axis=1)
    assert light[0] == light[1] > light[2] > light[3] == light[4]
    np.testing.assert_allclose(colours(ratio)[-1], GREY)
    assert gradient().startswith("linear-gradient(90deg,#f4f7f5")


def test_marks_grow_dark_where_and_when_the_recording_leaves_the_model(model: RobotModel, recorded: Take, tmp_path: Path) -> None:
    seen = [errors(recorded), errors(recorded, shown=False)]
    plain = write_replay(tmp_path / "plain.html", model, swing(model), recorded)
    written = write_replay(tmp_path / "r.html", model, swing(model), recorded, errors=seen)
    html = written.path.read_text()
    keys = film(html)
    flm = "/recorded/body_link/flm_link/error0/<object>"

    def at(path: str, what: str, time: float) -> np.ndarray:
        frames, values = keys[path][what]
        return np.array([np.interp((time + 0.3) * written.rate, frames, v) for v in values.T])

    dark, pale, before = (at(flm, "material.emissive", t) for t in (1.0, 0.4, -0.2))
    assert dark.sum() < 0.5 * pale.sum()
    assert dark[0] > 2 * dark[2]  # brown
    assert np.ptp(before) < 0.05  # grey: nobody judged it before the first command
    assert at(flm, "scale", 1.0)[0] > 2 * at(flm, "scale", 0.4)[0]
    quiet = keys["/recorded/body_link/frm_link/error0/<object>"]
    assert np.ptp(quiet["scale"][1]) < 0.1
    assert at("/recorded/path", "position", 1.0)[0] == pytest.approx(0.1, abs=0.01)
    assert at("/recorded/path/error0/<object>", "material.emissive", 0.8)[0] > at(
        "/recorded/path/error0/<object>", "material.emissive", 0.8)[2]
    assert html.count("≥ 30× noise") == 1
    assert html.count('type="checkbox" checked data-paths="recorded/body_link') == 1
    assert html.count('type="checkbox" data-paths="recorded/body_link') == 1
    assert written.size - plain.size < 60_000


def test_a_robot_on_a_stand_has_no_marks_of_its_body(model: RobotModel, recorded: Take, tmp_path: Path) -> None:
    held = replace(recorded, base="fixed", p_WB=None, quat_WB=None)
    only = errors(held)
    only = replace(only, channels=only.channels[:-2], residual=only.residual[:, :-2])
    html = write_replay(tmp_path / "r.html", model, swing(model), held, errors=[only]).path.read_text()
    assert "recorded/path" not in html
    assert "/recorded/body_link/flm_link/error0" in html
