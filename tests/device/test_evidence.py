"""A session that names the registers of its servos: a knee with slope 64 is a finding before the first step."""

import yaml

from tests.gap_sessions import record_arm, session_content, write_session
from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.registers import read_off_registers
from workbench.robot.servo_registers import ServoReading, ServoRegisters, save_registers


def test_a_register_is_a_finding(tmp_path):
    """The arm was recorded as its model has it but for the register of one joint, which the recording does not even show much."""
    record_arm(tmp_path, friction=0.06)
    content = session_content() | {"registers": "registers.yaml"}
    nominal = {"cw_compliance_slope": 32, "ccw_compliance_slope": 32, "cw_compliance_margin": 1, "ccw_compliance_margin": 1}
    nominal |= {"punch": 32}
    readings = {j: ServoReading(i, "AX-12A", nominal | ({"punch": 40} if j == "one" else {}))
                for j, i in (("one", 1), ("two", 2), ("three", 3))}
    readings["two"] = ServoReading(2, "AX-12A", nominal | {"cw_compliance_margin": 2, "ccw_compliance_margin": 2})
    save_registers(ServoRegisters("AX-12A", "2026-11-27T12:00:00+00:00", readings), tmp_path / "registers.yaml")
    (tmp_path / "session.yaml").write_text(yaml.safe_dump(content))
    session = load_session(tmp_path)
    assert [(m.effect, m.where) for m in read_off_registers(session)] == [("dead_band", "two")]
    (finding, *_) = diagnose_session(session, n_jobs=1).diagnosis.findings
    assert (finding.effect, finding.where) == ("dead_band", ("two",))
    assert finding.confidence > 0.95
    assert "register says so" in finding.evidence


def test_a_session_without_registers_has_none(tmp_path):
    session = load_session(write_session(tmp_path))
    assert session.registers is None
    assert read_off_registers(session) == ()
