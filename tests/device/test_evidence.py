"""A session that names the registers of its servos: a knee with slope 64 is a finding before the first step."""

import pytest
import yaml

from tests.gap_sessions import session_content, write_session
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.identify.estimators.registers import read_off_registers
from workbench.robot.servo_registers import ServoReading, ServoRegisters, save_registers


def test_registers_are_read_off(tmp_path):
    """A register that no effect describes (punch) is reported by `servos`, but is not a finding."""
    write_session(tmp_path)
    nominal = {"cw_compliance_slope": 32, "ccw_compliance_slope": 32, "cw_compliance_margin": 1, "ccw_compliance_margin": 1}
    nominal |= {"punch": 32}
    readings = {j: ServoReading(i, "AX-12A", nominal | ({"punch": 40} if j == "one" else {}))
                for j, i in (("one", 1), ("two", 2), ("three", 3))}
    readings["two"] = ServoReading(2, "AX-12A", nominal | {"cw_compliance_margin": 2, "ccw_compliance_margin": 2})
    save_registers(ServoRegisters("AX-12A", "2026-11-27T12:00:00+00:00", readings), tmp_path / "registers.yaml")
    content = session_content() | {"registers": "registers.yaml"}
    (tmp_path / "session.yaml").write_text(yaml.safe_dump(content))
    (measured,) = read_off_registers(load_session(tmp_path), {})
    assert (measured.effect, measured.where) == ("dead_band", "two")
    assert measured.mean == pytest.approx(300 / 1023)
    assert "own register, without" in measured.seen


@pytest.mark.parametrize(("registers", "said"), [("nowhere.yaml", "registers: file not found"), (3, "registers: file not found")])
def test_a_session_whose_registers_are_missing(tmp_path, registers, said):
    write_session(tmp_path)
    (tmp_path / "session.yaml").write_text(yaml.safe_dump(session_content() | {"registers": registers}))
    with pytest.raises(InputError, match=said):
        load_session(tmp_path)


def test_a_session_without_registers_has_none(tmp_path):
    session = load_session(write_session(tmp_path))
    assert session.registers is None
    assert read_off_registers(session, {}) == ()
