"""Whatever stands in a file, it is read or refused in one line; nothing else is raised, and nothing hangs."""

from __future__ import annotations

import time
import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.inputs.corpus import beside, corpus
from tests.inputs.mutate import mutated
from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.inspect.problems import recording_problems
from workbench.inspect.recognise import inspect_file
from workbench.motion import load_motion, load_mtn
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.formats.read import read_recording
from workbench.recording.formats.rollout_table import load_rollout
from workbench.robot import RobotModel, load_model, load_servo_constants

NAMES = ("motive.csv", "log.csv", "bam.json", "ros.csv", "programmes.npz", "plain.npz", "episode.parquet", "poses.csv",
         "page.mtn", "servo.yaml", "rollout.csv", "pos.txt", "state_motor.csv", "comparison.json", "session.yaml")
INSPECTED = ("pos.txt", "state_motor.csv", "comparison.json", "session.yaml")
MODELS = ("robot.urdf", "robot.sdf", "model.yaml")
LONGEST = 10.0


def use(path: Path) -> None:
    """Reads a file with the reader that its kind has."""
    suffix = path.suffix
    if path.name in INSPECTED:
        inspect_file(path)
    elif suffix == ".mtn":
        file = load_mtn(path)
        for page in file.used[:2]:
            load_motion(f"{path}#{page.number}").as_table()
    elif path.name.startswith("servo"):
        load_servo_constants(path)
    elif path.name.startswith("model"):
        read_yaml(path)
        load_model(path)
    elif suffix in (".urdf", ".sdf"):
        model = RobotModel(str(path))
        assert model.kinematics.root
        assert isinstance(model.problems, tuple)
    else:
        kind = "recording" if suffix in (".npz", ".json", ".parquet") else file_kind(path)
        if kind == "motion":
            load_motion(path).as_table()
        elif kind == "rollout":
            load_rollout(path)
        else:
            recording_problems(path, read_recording(path))


def survives(folder: Path, name: str, seed: int) -> str:
    """What a damaged file is refused with, empty where it is read. Fails with the seed where it is neither; `folder` holds what
    `beside` writes."""
    path = folder / name
    path.write_bytes(mutated(corpus(folder)[name], seed))
    began, line = time.monotonic(), ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            use(path)
    except InputError as e:
        line = str(e)
    except Exception as e:
        raise AssertionError(f"{name}, seed {seed}: {type(e).__name__}: {e}") from e
    assert "\n" not in line, (name, seed)
    assert len(line) < 1500, (name, seed)
    assert time.monotonic() - began < LONGEST, (name, seed)
    return line


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    beside(folder)
    return folder


@pytest.mark.parametrize("name", [*NAMES, *MODELS])
def test_a_sound_file_is_read(folder: Path, name: str) -> None:
    path = folder / name
    path.write_bytes(corpus(folder)[name])
    use(path)


@settings(max_examples=400, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck), database=None)
@given(name=st.sampled_from(NAMES), seed=st.integers(0, 10**9))
def test_damaged_files_are_read_or_refused(folder: Path, name: str, seed: int) -> None:
    survives(folder, name, seed)


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck), database=None)
@given(name=st.sampled_from(MODELS), seed=st.integers(0, 10**9))
def test_damaged_robots_are_read_or_refused(folder: Path, name: str, seed: int) -> None:
    survives(folder, name, seed)


@pytest.mark.slow
def test_ten_minutes_of_damage(folder: Path) -> None:
    """New seeds at each run: what fails names its own."""
    began, seed = time.time(), int(time.time()) * 1000
    while time.time() - began < 600:
        for name in [*NAMES * 5, *MODELS]:
            seed += 1
            survives(folder, name, seed)
