"""The AX-12A's control table (ROBOTIS e-manual) and its times (xevelabs' notes; Tira-Thompson's study)."""

from __future__ import annotations

from workbench.device.virtual.registers import Register, VirtualProfile


def _bit_rate(value: int) -> int:
    return 2_000_000 // (value + 1)


AX12A = VirtualProfile(
    name="AX-12A",
    size=50,
    bit_rate=_bit_rate,
    registers=(
        Register("model_number", 0, 2, 12, writable=False, eeprom=True),
        Register("firmware_version", 2, 1, 24, writable=False, eeprom=True),
        Register("id", 3, 1, 1, 0, 253, eeprom=True),
        Register("baud_rate", 4, 1, 1, 0, 254, eeprom=True),
        Register("return_delay_time", 5, 1, 250, 0, 254, eeprom=True),
        Register("cw_angle_limit", 6, 2, 0, 0, 1023, eeprom=True),
        Register("ccw_angle_limit", 8, 2, 1023, 0, 1023, eeprom=True),
        Register("temperature_limit", 11, 1, 70, 0, 150, eeprom=True),
        Register("min_voltage_limit", 12, 1, 60, 50, 250, eeprom=True),
        Register("max_voltage_limit", 13, 1, 140, 50, 250, eeprom=True),
        Register("max_torque", 14, 2, 1023, 0, 1023, eeprom=True),
        Register("status_return_level", 16, 1, 2, 0, 2, eeprom=True),
        Register("alarm_led", 17, 1, 36, 0, 127, eeprom=True),
        Register("alarm_shutdown", 18, 1, 36, 0, 127, eeprom=True),
        Register("torque_enable", 24, 1, 0, 0, 1),
        Register("led", 25, 1, 0, 0, 1),
        Register("cw_compliance_margin", 26, 1, 1, 0, 255),
        Register("ccw_compliance_margin", 27, 1, 1, 0, 255),
        Register("cw_compliance_slope", 28, 1, 32, 0, 254),
        Register("ccw_compliance_slope", 29, 1, 32, 0, 254),
        Register("goal_position", 30, 2, 512, 0, 1023),
        Register("moving_speed", 32, 2, 0, 0, 2047),
        Register("torque_limit", 34, 2, 1023, 0, 1023),
        Register("present_position", 36, 2, 512, writable=False),
        Register("present_speed", 38, 2, 0, writable=False),
        Register("present_load", 40, 2, 0, writable=False),
        Register("present_voltage", 42, 1, 111, writable=False),
        Register("present_temperature", 43, 1, 30, writable=False),
        Register("registered", 44, 1, 0, writable=False),
        Register("moving", 46, 1, 0, writable=False),
        Register("lock", 47, 1, 0, 0, 1),
        Register("punch", 48, 2, 32, 0, 1023),
    ),
)
