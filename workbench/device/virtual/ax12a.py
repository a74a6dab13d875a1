"""The AX-12A: what its registers hold and take (ROBOTIS e-manual), and its times (xevelabs' notes; Tira-Thompson's study)."""

from __future__ import annotations

from workbench.device.virtual.registers import Kept, emulate

_KEPT = {
    "model_number": Kept(12),
    "firmware_version": Kept(24),
    "id": Kept(1, (0, 253)),
    "baud_rate": Kept(1, (0, 254)),
    "return_delay_time": Kept(250, (0, 254)),
    "cw_angle_limit": Kept(0, (0, 1023)),
    "ccw_angle_limit": Kept(1023, (0, 1023)),
    "temperature_limit": Kept(70, (0, 150)),
    "min_voltage_limit": Kept(60, (50, 250)),
    "max_voltage_limit": Kept(140, (50, 250)),
    "max_torque": Kept(1023, (0, 1023)),
    "status_return_level": Kept(2, (0, 2)),
    "alarm_led": Kept(36, (0, 127), at=(17, 1)),
    "alarm_shutdown": Kept(36, (0, 127)),
    "torque_enable": Kept(0, (0, 1)),
    "led": Kept(0, (0, 1)),
    "cw_compliance_margin": Kept(1, (0, 255)),
    "ccw_compliance_margin": Kept(1, (0, 255)),
    "cw_compliance_slope": Kept(32, (0, 254)),
    "ccw_compliance_slope": Kept(32, (0, 254)),
    "goal_position": Kept(512, (0, 1023)),
    "moving_speed": Kept(0, (0, 2047)),
    "torque_limit": Kept(1023, (0, 1023)),
    "present_position": Kept(512),
    "present_speed": Kept(),
    "present_load": Kept(),
    "present_voltage": Kept(111),
    "present_temperature": Kept(30),
    "registered": Kept(at=(44, 1)),
    "moving": Kept(at=(46, 1)),
    "lock": Kept(0, (0, 1)),
    "punch": Kept(32, (0, 1023)),
}


def _bit_rate(value: int) -> int:
    """Any value makes one; the data file names those in use."""
    return 2_000_000 // (value + 1)


AX12A = emulate("ax12a", "AX-12A", 50, _KEPT, bit_rate=_bit_rate)
