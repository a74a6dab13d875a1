import base64
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.view_takes import capture, small_robot, swing
from workbench.files import InputError
from workbench.robot import RobotModel, puppy_model
from workbench.view.playback import play
from workbench.view.scene.keyframes import kept_keys
from workbench.view.scene.replay import ANGLE_TOLERANCE, MAX_FRAMES, POSITION_TOLERANCE, Scene, write_replay
from workbench.view.shapes import robot_shapes


@pytest.fixture
def model(tmp_path: Path) -> RobotModel:
    return small_robot(tmp_path)


def film(html: str) -> dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Key frames and values of the animation in the page: path -> track -> (frames, values)."""
    msgpack = pytest.importorskip("msgpack", reason="needs msgpack to look into a meshcat page")
    payloads = [msgpack.unpackb(base64.b64decode(p)) for p in re.findall(r'base64,([A-Za-z0-9+/=]+)"\)\n', html)]
    (animation,) = [p for p in payloads if p["type"] == "set_animation"]
    out: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {}
    for part in animation["animations"]:
        tracks = {t["name"]: t["keys"] for t in part["clip"]["tracks"]}
        out[part["path"]] = {n.strip("."): (np.array([k["time"] for k in keys]), np.array([k["value"] for k in keys]))
                             for n, keys in tracks.items()}
    return out


def test_the_film_shows_both_robots_where_they_were(model: RobotModel, tmp_path: Path) -> None:
    take = swing(model)
    seen = capture(swing(model, delay=0.05))
    written = write_replay(tmp_path / "replay.html", model, take, seen, title="A <walk>")
    html = written.path.read_text()
    keys = film(html)
    time = -0.25 + np.arange(written.frames) / written.rate
    played = play(take, model, time)
    ghost = play(seen, model, time, like=(take, played))
    for prefix, robot in (("simulated", played), ("recorded", ghost)):
        frames, p = keys[f"/{prefix}/body_link"]["position"]
        between = np.column_stack([np.interp(np.arange(written.frames), frames, c) for c in p.T])
        assert np.abs(between - robot.base_p).max() <= 1.01 * POSITION_TOLERANCE
        frames, quat = keys[f"/{prefix}/body_link/flm_link"]["quaternion"]
        angle = 2 * np.arctan2(quat[:, 1], quat[:, 3])  # xyzw, about y
        shown = np.interp(np.arange(written.frames), frames, np.unwrap(angle))
        assert np.abs(shown - robot.q[:, model.joints.index("flm")]).max() < 2 * ANGLE_TOLERANCE
    assert "A &lt;walk&gt;" in html
    assert "measured" in html


def test_the_camera_stands_back_from_what_is_high_or_reaches_far(model: RobotModel) -> None:
    low = play(swing(model), model, np.linspace(0.0, 0.5, 6))
    high = replace(low, base_p=low.base_p + np.array([0.0, 0.0, 1.0]))
    link = model.kinematics.links[-1]
    far = replace(low, links=dict(low.links) | {link: (low.links[link][0] + [0.0, 2.0, 0.0], low.links[link][1])})
    near, up, wide = (Scene(model, robot_shapes(model), [p], 30.0) for p in (low, high, far))
    assert near.tall < 0.5
    assert up.tall == pytest.approx(near.tall + 1.0, abs=0.1)
    assert up.reach > near.reach + 1.0
    assert wide.reach > 1.9


def test_arrows_are_as_long_as_the_forces(model: RobotModel, tmp_path: Path) -> None:
    take = swing(model)
    steady = {f: np.tile([0.0, 3.0, 4.0], (len(take), 1)) for f in ("flb", "frb")}
    html = write_replay(tmp_path / "r.html", model, replace(take, contact=steady)).path.read_text()
    keys = film(html)
    (centimetres,) = re.findall(r"10 N is (\d+) cm", html)
    length = keys["/forces/flb"]["scale"][1][:, 2]
    np.testing.assert_allclose(length, 5 / 10 * float(centimetres) / 100, rtol=0.05)
    quat = keys["/forces/flb"]["quaternion"][1]
    np.testing.assert_allclose(Rotation.from_quat(quat).apply([0, 0, 1]), np.tile([0, 0.6, 0.8], (len(quat), 1)), atol=1e-9)


def test_same_takes_same_bytes_below_three_megabytes(model: RobotModel, tmp_path: Path) -> None:
    take = swing(model, duration=6.0)
    first, second = (write_replay(tmp_path / n, model, take, capture(take)) for n in ("a.html", "b.html"))
    assert first.path.read_bytes() == second.path.read_bytes()
    assert first.size < 3_000_000


def test_the_puppys_meshes_are_in_the_page_once(tmp_path: Path) -> None:
    model = puppy_model()
    if not model.path.is_file():
        pytest.skip("the puppy's model is not built")
    t = np.arange(-0.1, 0.5, 0.01)
    take = replace(swing(small_robot(tmp_path)), time=t, joints=model.joints, q=np.zeros((len(t), 15)), v=None,
                   torque=None, contact={}, commands=None, p_WB=np.tile([0, 0, 0.19], (len(t), 1)),
                   quat_WB=np.tile([1.0, 0, 0, 0], (len(t), 1)))
    alone = write_replay(tmp_path / "one.html", model, take)
    both = write_replay(tmp_path / "two.html", model, take, replace(take, source="capture.csv"))
    assert both.size < 3_000_000
    assert both.size - alone.size < 100_000
    html = both.path.read_text()
    assert html.count('"/simulated/body_link/') == html.count('"/recorded/body_link/') > 50


def test_long_takes_get_fewer_frames(model: RobotModel, tmp_path: Path) -> None:
    written = write_replay(tmp_path / "r.html", model, swing(model, duration=60.0))
    assert written.frames <= MAX_FRAMES + 1
    assert written.size < 3_600_000


def test_a_page_asks_nothing_from_the_network(model: RobotModel, tmp_path: Path) -> None:
    html = write_replay(tmp_path / "r.html", model, swing(model)).path.read_text()
    assert not re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)\s*=", html)
    assert set(re.findall(r'fetch\("(\w+):', html)) == {"data"}


def test_what_cannot_be_written_leaves_nothing(model: RobotModel, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_replay(tmp_path / "file" / "r.html", model, swing(model))


def test_kept_keys_bound_the_error() -> None:
    rng = np.random.default_rng(0)
    values = np.cumsum(rng.normal(size=(300, 3)), axis=0)
    keys = kept_keys(values)
    between = np.column_stack([np.interp(np.arange(300), keys, c) for c in values[keys].T])
    assert np.abs(between - values).max() <= 1
    assert len(keys) < 250
    assert list(kept_keys(np.zeros((50, 2)))) == [0, 49]
