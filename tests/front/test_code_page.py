"""docs/reading-the-code.md names files that are there, and for each question of its table a file that answers it."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs/reading-the-code.md").read_text(encoding="utf-8")
ROOM = Path(__file__).parents[2] / "workbench"
FILES = sorted(set(re.findall(r"`([\w/]+\.py)`", PAGE)))
FOLDERS = sorted(set(re.findall(r"`([\w/]+/)`", PAGE)) - {"workbench/"})
QUESTIONS = {
    "how is a walk cut into windows": ("identify/shooting.py", "def edges"),
    "where is a stop read off": ("identify/estimators/stops_and_mounts.py", "def stops"),
    "how do two names tie": ("identify/results/findings.py", "def tie"),
    "where is the numerical floor computed": ("identify/preparation.py", "floor = _apart"),
    "where does a new recording format go": ("recording/formats/", "FORMAT"),
    "where are rollouts remembered": ("identify/rollouts/memory.py", "def keep"),
    "where are the report's sentences made": ("view/report/words.py", "def in_words"),
    "who chooses the next experiment": ("experiment/design.py", "def design_experiment"),
    "what must a plug-in effect say": ("effects/base.py", "class Effect"),
    "where is the servo's torque-speed line": ("robot/torque_speed.py", "def no_load_speed"),
    "where do radians become counts": ("robot/servo_units.py", "class ServoUnits"),
    "where are InputError": ("files/errors.py", "class InputError"),
    "where is the prior of an effect's size": ("identify/evidence/hypothesis.py", "class Prior"),
    "where is it decided which search runs": ("identify/evidence/explain.py", "def is_by_logs"),
    "what limits a gait": ("gait/limits.py", "def binding"),
    "which random robots is a gait tested on": ("gait/ensemble.py", "class Ensemble"),
    "who may stop a motion": ("device/play/watch.py", "class Watch"),
    "where do plug-ins come in": ("files/plug_ins.py", "def with_plug_ins"),
    "where are readings set aside": ("recording/servo_log/faults.py", "def without_faults"),
    "how is a capture turned": ("recording/mocap/yaw.py", "def session_yaw"),
    "where do the constants of a servo come from": ("robot/servo_profile_file.py", "def with_family_law"),
    "how does an effect change the simulation": ("effects/apply.py", "def apply_to_commands"),
}


ROOMS = sorted(p.name for p in ROOM.iterdir() if (p / "__init__.py").is_file())


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_is_on_the_map(room):
    assert re.search(rf"`{room}/", PAGE), f"docs/reading-the-code.md names no file of workbench/{room}/"


def file_of(name: str) -> list[Path]:
    """A file that the page names from workbench/ on, or by its end alone."""
    return [ROOM / name] if (ROOM / name).exists() else [p for p in ROOM.rglob(Path(name).name) if str(p).endswith(f"/{name}")]


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_the_page_names_is_there(name):
    assert file_of(name)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder_that_the_page_names_is_there(name):
    assert (ROOM / name).is_dir() or (ROOM.parent / name).is_dir() or [p for p in ROOM.rglob(name.strip("/")) if p.is_dir()]


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_is_answered_by_a_file_that_does_it(question):
    name, does = QUESTIONS[question]
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| {question}")]
    assert f"`{name}`" in row
    files = [ROOM / name] if name.endswith(".py") else sorted((ROOM / name).glob("*.py"))
    assert any(does in p.read_text(encoding="utf-8") for p in files)
