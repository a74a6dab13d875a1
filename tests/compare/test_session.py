"""The session file: valid and invalid content, and the messages for the latter."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from tests.gap_sessions import MOTION, session_content, write_session
from tests.shared_data import practice
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.robot import BUS_IDS, RIGID_BODIES

MISSING = object()


def changed(**paths: object) -> dict:
    """The good session with values set at places such as `robot__base`."""
    content = copy.deepcopy(session_content())
    for place, value in paths.items():
        at: object = content
        *way, last = [int(k) if k.isdigit() else k for k in place.split("__")]
        for key in way:
            at = at[key] if isinstance(key, int) else at.setdefault(key, {})  # type: ignore[index, attr-defined]
        if value is MISSING:
            del at[last]  # type: ignore[attr-defined]
        else:
            at[last] = value  # type: ignore[index]
    return content


def test_reads_what_the_contract_says(tmp_path):
    (tmp_path / "start.csv").write_text("")
    content = changed(
        ground={"friction": 0.6, "stiffness": 1.0e5, "dissipation": 20}, takes__0__starts_at=0.41,
        takes__0__servos={"proportional_gain": 0.288}, takes__0__use="fit",
        predict=[{"name": "wave", "motion": "motions/wave.csv", "cycles": 8, "start": "start.csv", "starts_at": 0.3156,
                  "frames": 615, "base": "fixed"},
                 {"name": "gain", "commands": "takes/wave.csv", "servos": {"proportional_gain": 2.3}, "base": "fixed"}])
    session = load_session(write_session(tmp_path, content))
    take = session.takes[0]
    assert (take.name, take.cycles, take.base, take.starts_at, take.use) == ("wave", 2, "fixed", 0.41, "fit")
    assert session.model_of(take).servo("one").proportional_gain == 0.288
    assert session.model_of(take).servo("one").compliance_slope is None
    assert session.model.servo("one").viscous_friction == 0.01  # written 1e-2
    assert session.model.ground.stiffness == 1e5
    assert session.model.joints == ("one", "three", "two")
    commands = take.commands(session.model)
    assert commands is not None
    assert len(commands.times) == 6
    assert session.predict[0].frames == 615
    assert session.predict[1].commands == tmp_path / "takes/wave.csv"


@pytest.mark.parametrize(("written", "value"), [
    ("1e5", 1e5), ("1.0e5", 1e5), ("1E+5", 1e5), (".5e6", 5e5), ("100_000", None), (".inf", np.inf)])
def test_numbers_as_people_write_them(tmp_path, written, value):
    text = write_session(tmp_path).read_text() + f"ground: {{stiffness: {written}}}\n"
    path = write_session(tmp_path, text)
    if value is None:
        with pytest.raises(InputError, match=r"ground\.stiffness: expected a number"):
            load_session(path)
    else:
        assert load_session(path).model.ground.stiffness == value


def test_words_stay_words(tmp_path):
    text = write_session(tmp_path).read_text().replace("name: wave", "name: on")
    assert load_session(write_session(tmp_path, text)).takes[0].name == "on"


def test_defaults_are_the_puppy_and_the_thesis_names(tmp_path):
    path = write_session(tmp_path, {"format": 1, "takes": [{"name": "a", "recording": "takes/wave.csv"}]})
    session = load_session(path)
    assert session.model.description == "package://puppy/puppy.sdf"
    assert session.model.base == "body_link"
    assert dict(session.model.rigid_bodies) == dict(RIGID_BODIES)
    assert dict(session.model.bus_ids) == dict(BUS_IDS)
    assert session.takes[0].base == "free"
    assert session.takes[0].commands(session.model) is None


def test_a_folder_stands_for_the_session_in_it(tmp_path):
    path = write_session(tmp_path)
    assert load_session(tmp_path).path == path
    path.unlink()
    with pytest.raises(InputError, match=r"no session\.yaml"):
        load_session(tmp_path)


def test_base_left_out_follows_the_model(tmp_path):
    content = changed(takes__0__base=MISSING, robot__base=MISSING)
    session = load_session(write_session(tmp_path, content))
    assert session.takes[0].base == "fixed"
    assert session.model.base == "trunk"


@pytest.mark.parametrize(("content", "words"), [
    (changed(format=2), ["format", "expected 1"]),
    (changed(colour="red"), ["colour", "unknown key", "unknown key; expected one of robot, ground, takes"]),
    (changed(robot__sevos="servo.yaml"), ["robot.sevos", "unknown key"]),
    (changed(ground__grip=1), ["ground.grip", "unknown key"]),
    (changed(takes__0__cycle=2), ["takes[0].cycle", "unknown key"]),
    (changed(takes__0__servos={"gain": 2}), ["takes[0].servos", "unknown key 'gain'"]),
    (changed(takes__0__recording="takes/none.csv"), ["takes[0].recording", "file not found", "none.csv"]),
    (changed(takes__0__recording=MISSING), ["takes[0].recording", "is missing"]),
    (changed(takes__0__name=MISSING), ["takes[0].name", "is missing"]),
    (changed(takes__0__name="../up"), ["takes[0].name", "'../up'"]),
    (changed(takes__0__cycles="two"), ["takes[0].cycles", "whole number", "'two'"]),
    (changed(takes__0__cycles=0), ["takes[0].cycles", "at least 1"]),
    (changed(takes__0__starts_at="soon"), ["takes[0].starts_at", "number"]),
    (changed(takes__0__base="hung"), ["takes[0].base", "free or fixed", "'hung'"]),
    (changed(takes__0__base="free"), ["takes[0].base", "cannot float"]),
    (changed(takes__0__use="test"), ["takes[0].use", "fit or validate"]),
    (changed(takes=[*session_content()["takes"], *session_content()["takes"]]), ["takes[1].name", "duplicate name 'wave'"]),
    (changed(takes={"name": "wave"}), ["takes", "expected a list"]),
    (changed(takes=[]), ["takes", "at least one"]),
    (changed(robot__model="none.sdf"), ["robot.model", "file not found"]),
    (changed(robot__base="torso"), ["robot.base", "no link 'torso'", "trunk"]),
    (changed(robot__servos={"four": "servo.yaml"}), ["robot.servos.four", "no joint 'four'"]),
    (changed(robot__servos={"one": "other.yaml"}), ["robot.servos.one", "file not found"]),
    (changed(robot__rigid_bodies__Hat="hat"), ["robot.rigid_bodies.Hat", "no link 'hat'"]),
    (changed(robot__rigid_bodies__Hat="upper"), ["robot.rigid_bodies", "'upper'"]),
    (changed(robot__bus_ids__four=4), ["robot.bus_ids.four", "no joint 'four'"]),
    (changed(robot__bus_ids__two=1), ["robot.bus_ids.", "bus ID"]),
    (changed(robot__bus_ids__two=254), ["robot.bus_ids.two", "from 0 to 253"]),
    (changed(robot__bus_ids__two=253, robot__servos={"model": "XL-330"}), ["robot.bus_ids.two", "at most 252", "protocol 2"]),
    (changed(ground__friction=-1), ["ground.friction", "non-negative"]),
    (changed(predict=[{"name": "p", "base": "fixed"}]), ["predict[0].motion", "either motion"]),
    (changed(predict=[{"name": "p", "motion": "motions/wave.csv", "base": "fixed"}]), ["predict[0].start", "is missing"]),
    ("format: 1\nformat: 1\n", ["duplicate key 'format'"]),
    ("format: 1\n  robot: [", ["not valid YAML"]),
    ("- 1\n", ["expected a mapping"]),
])
def test_refuses_in_one_line_with_file_and_place(tmp_path, content, words):
    path = write_session(tmp_path, content)
    with pytest.raises(InputError) as caught:
        load_session(path)
    message = str(caught.value)
    assert message.startswith(str(path)), message
    assert "\n" not in message
    for word in words:
        assert word in message


def test_refuses_a_motion_of_another_robot_or_out_of_range(tmp_path):
    path = write_session(tmp_path)
    (tmp_path / "motions/wave.csv").write_text(MOTION.replace("three", "four"))
    with pytest.raises(InputError, match=r"wave\.csv.*four"):
        load_session(path)
    (tmp_path / "motions/wave.csv").write_text(MOTION.replace("0.3,25,-15,30", "0.3,25,-15,170"))
    with pytest.raises(InputError, match=r"wave\.csv.*two"):
        load_session(path)


def test_base_that_hangs_on_a_joint_cannot_float(tmp_path):
    content = changed(robot__base="upper", takes__0__base="free")
    with pytest.raises(InputError, match=r"takes\[0\]\.base.*'upper' hangs on joint 'one'"):
        load_session(write_session(tmp_path, content, fixed=False))


@pytest.mark.parametrize("name", ["p0_nothing_hidden", "p4_late_firmware", "p7_two_at_once"])
def test_practice_sessions_load(name):
    session = load_session(practice(name))
    assert [t.name for t in session.takes] == ["stand", "sway", "walk"]
    assert [t.base for t in session.takes] == ["fixed", "free", "free"]
    assert session.model.ground.friction == 0.6
    assert [p.name for p in session.predict] == ["hidden_walk", "hidden_stand"]
