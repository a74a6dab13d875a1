"""A diagnosis from session to findings, on a small arm."""

import json

import pytest
import yaml

from tests.gap_sessions import SERVO, record_arm, session_content, write_session
from workbench.cli.main import main
from workbench.cli.memory import rollout_memory
from workbench.compare.session import load_session
from workbench.effects.registry import known_effects
from workbench.files import InputError
from workbench.identify.diagnosis import diagnose_session
from workbench.robot import load_model


def test_a_quiet_robot_has_no_gap_and_a_damaged_take_is_named_and_left_out(tmp_path):
    record_arm(tmp_path)
    content = session_content()
    content["takes"].append(content["takes"][0] | {"name": "torn", "recording": "takes/torn.csv"})
    (tmp_path / "takes/torn.csv").write_text("Format Version,1.23\nnothing else\n")
    told = diagnose_session(load_session(write_session(tmp_path, content)), n_jobs=1)
    assert told.diagnosis.verdict == "no_gap"
    assert told.diagnosis.findings == ()
    assert told.diagnosis.model.effects == ()
    assert [name for name, _ in told.diagnosis.left_out] == ["torn"]


def test_what_is_too_slight_for_a_name_and_does_not_show_on_unseen_stretches_is_no_gap_but_booked(tmp_path):
    record_arm(tmp_path, friction=0.084)
    said = diagnose_session(load_session(tmp_path / "session.yaml"), n_jobs=1).diagnosis
    assert [(g.where, g.take) for g in said.gap] == [(("three",), "wave")]
    assert said.findings == said.unexplained == ()
    assert said.verdict == "no_gap"


def with_friction_by_its_files(folder, friction):
    """Writes the arm's servo.yaml, in which all joints have this Coulomb friction [N m]."""
    (folder / "servo.yaml").write_text(SERVO.replace("coulomb_friction: 0.06", f"coulomb_friction: {friction}"))


def test_a_nominal_friction_that_is_too_large_is_named_as_less_friction(tmp_path):
    with_friction_by_its_files(tmp_path, 0.16)
    record_arm(tmp_path, friction=0.06)
    said = diagnose_session(load_session(tmp_path / "session.yaml"), n_jobs=1).diagnosis
    (finding,) = said.findings
    assert (finding.effect, finding.where) == ("coulomb_friction", ("three",))
    assert finding.parameters["torque"].value == pytest.approx(-0.1, abs=0.015)
    assert finding.parameters["torque"].low < -0.1 < finding.parameters["torque"].high
    assert "less dry friction" in finding.evidence
    said.save(tmp_path / "out")
    assert load_model(tmp_path / "out" / "model.yaml").effects == said.model.effects


def test_a_robot_with_its_large_nominal_friction_has_no_gap(tmp_path):
    with_friction_by_its_files(tmp_path, 0.16)
    record_arm(tmp_path, friction=0.16)
    said = diagnose_session(load_session(tmp_path / "session.yaml"), n_jobs=1).diagnosis
    assert (said.verdict, said.findings) == ("no_gap", ())


def test_a_take_too_short_to_conclude_from_says_so(tmp_path):
    path = record_arm(tmp_path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:7 + 150]))  # about a second after the first command
    with pytest.raises(InputError, match="nothing can be concluded"):
        diagnose_session(load_session(tmp_path / "session.yaml"), n_jobs=1)


def test_what_is_known_not_to_be_there_is_not_looked_for(tmp_path):
    record_arm(tmp_path, friction=0.14)
    session = load_session(tmp_path / "session.yaml")
    told = diagnose_session(session, n_jobs=1, without=sorted(set(known_effects()) - {"viscous_friction", "dropped_command"}))
    assert {f.effect for f in told.diagnosis.findings} <= {"viscous_friction"}
    assert told.diagnosis.verdict != "explained"
    assert "coulomb_friction" in told.diagnosis.to_json()["provenance"]["without"]
    with pytest.raises(InputError, match="'rust' is not known"):
        diagnose_session(session, without=["rust"])


def killed(out, session):
    """The memory of a run that was killed after its first rollout."""
    try:
        with rollout_memory(out, session) as folder:
            (folder / "known.npy").write_bytes(b"1")
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        return folder


def test_what_was_worked_out_stays_while_a_run_is_not_done(tmp_path):
    write_session(tmp_path)
    session = load_session(tmp_path / "session.yaml")
    folder = killed(tmp_path / "out", session)
    with rollout_memory(tmp_path / "out", session) as again:
        assert again == folder
        assert (again / "known.npy").exists()
    assert not folder.exists()
    content = yaml.safe_load((tmp_path / "session.yaml").read_text())
    content["takes"][0]["cycles"] = 1
    killed(tmp_path / "out", session)
    elsewhere = killed(tmp_path / "out2", session)
    with rollout_memory(tmp_path / "out", load_session(write_session(tmp_path, content))) as other:
        assert other != folder
        assert folder.exists()
    assert not folder.exists()  # what another version had worked out is of no use any more
    assert elsewhere.exists()


@pytest.mark.slow
def test_a_worn_joint_is_named_placed_and_sized_and_its_rivals_told(tmp_path):
    record_arm(tmp_path, friction=0.14)
    assert main(["diagnose", str(tmp_path / "session.yaml"), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    found = json.loads((tmp_path / "out/findings.json").read_text())
    assert found["verdict"] == "explained"
    assert found["gap"][0]["where"] == ["three"]
    finding, = found["findings"]
    named = [finding["effect"], *(a["effect"] for a in finding["alternatives"])]
    assert "coulomb_friction" in named
    assert finding["where"] == ["three"]
    assert finding["validation"]["after"] < 0.5 * finding["validation"]["before"]
    name, size = {"coulomb_friction": ("torque", 0.08), "dead_band": ("margin", 0.54)}[finding["effect"]]  # one take leaves a tie
    assert finding["parameters"][name]["low"] < size < finding["parameters"][name]["high"]
    rejected = {r["effect"] for r in found["rejected"] if r["where"] == ["three"]}
    assert {"stribeck_friction", "viscous_friction", "servo_gain", "command_delay", "backlash"} <= rejected
    assert finding["effect"] not in rejected
    assert load_model(tmp_path / "out/model.yaml").effects[0].where == ("three",)
    assert (tmp_path / "out/report.html").stat().st_size > 100_000
