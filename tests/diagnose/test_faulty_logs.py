"""Sessions with a faulty log: the excluded readings are reported, and the hidden friction is named all the same."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command import main
from workbench.compare.logged import describe_logging, register_laws
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.files.resources import resource_dir
from workbench.files.yaml_file import read_yaml, yaml_text
from workbench.view.report.words import said_aside

COUNT = 360 / 4096
Rows = pd.DataFrame


def _lets_go(rows: Rows) -> None:
    """The wrist's servo lets go at 3.2 s; the joint falls to -12 deg."""
    position = rows["position.wrist"].to_numpy().copy()
    since = np.arange(len(position) - 320)
    position[320:] = np.round((-12 + (position[320] + 12) * np.exp(-since / 12)) / COUNT) * COUNT
    rows["position.wrist"] = position


def _zero_shifts(rows: Rows) -> None:
    rows.loc[220:, "position.shoulder"] += 80 * COUNT


def _repeats(rows: Rows) -> None:
    position = rows["position.elbow"].to_numpy().copy()
    for first, count in ((67, 5), (122, 6), (170, 4), (241, 7), (330, 5), (412, 6)):
        position[first:first + count] = position[first]
    rows["position.elbow"] = position


FAULTS = [(_lets_go, "position.wrist: no longer depends on goal.wrist from 3.2"),
          (_zero_shifts, "position.shoulder: its zero jumps"), (_repeats, "position.elbow: repeats the same reading")]


def _session(folder: Path, spoil: Callable[[Rows], None]) -> Path:
    shutil.copytree(resource_dir("data") / "tutorial_arm", folder / "arm")
    log = folder / "arm" / "takes" / "slow.csv"
    rows = pd.read_csv(log)
    spoil(rows)
    rows.to_csv(log, index=False, float_format="%.5f")
    return folder / "arm"


@pytest.mark.parametrize(("spoil", "said"), FAULTS)
def test_what_was_set_aside_is_part_of_the_provenance(tmp_path: Path, spoil: Callable[[Rows], None], said: str) -> None:
    takes = read_takes(load_session(_session(tmp_path, spoil)))[0]
    found = describe_logging(takes, register_laws(takes))
    assert list(found["set_aside"]) == ["slow"]
    (sentence,) = said_aside(found)
    assert sentence.startswith(f"Corrected or excluded in slow: {said}")
    written = tmp_path / "model.yaml"  # model.yaml has the provenance, too
    written.write_text(yaml_text(found), encoding="utf-8")
    assert read_yaml(written)["set_aside"] == found["set_aside"]


@pytest.mark.slow
@pytest.mark.parametrize(("spoil", "said"), FAULTS)
def test_a_diagnosis_names_the_hidden_friction_in_spite_of_a_faulty_log(tmp_path: Path, spoil: Callable[[Rows], None], said: str,
                                                                        capsys: pytest.CaptureFixture[str]) -> None:
    session, out = _session(tmp_path, spoil), tmp_path / "out"
    assert main(["diagnose", str(session), "--jobs", "1", "--out", str(out)]) == 0
    findings = json.loads((out / "findings.json").read_text())
    (friction,) = findings["findings"]
    assert (friction["effect"], friction["where"]) == ("coulomb_friction", ["elbow"])
    size = friction["parameters"]["torque"]
    assert size["low"] < 0.12 < size["high"]
    assert said in capsys.readouterr().out
    assert any(said in line for line in findings["provenance"]["set_aside"]["slow"])
    assert "Corrected or excluded in slow" in (out / "report.html").read_text()
