"""Control tables of other families (ROBOTIS e-manual, XL330-M288-T and XL430-W250-T; Feetech's STS memory table), for the same
virtual servo."""

from __future__ import annotations

import math
from dataclasses import replace

from workbench.device.virtual.protocol2 import Protocol2
from workbench.device.virtual.registers import Register, VirtualProfile

_XL330_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)
_STS_RATES = (1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400)

XL330 = VirtualProfile(
    name="XL330-M288-T",
    size=148,
    bit_rate=lambda value: _XL330_RATES[value],
    protocol=Protocol2(),
    counts=4096,
    span=2 * math.pi,
    centre=2048,
    speed_unit=0.229 * 2 * math.pi / 60,
    speed_sign=0,
    load_sign=0,
    full_torque=885,
    refresh=0.0,
    goal_enables=False,
    registers=(
        Register("model_number", 0, 2, 1200, writable=False, eeprom=True),
        Register("model_information", 2, 4, 0, writable=False, eeprom=True),
        Register("firmware_version", 6, 1, 46, writable=False, eeprom=True),
        Register("id", 7, 1, 1, 0, 252, eeprom=True),
        Register("baud_rate", 8, 1, 3, 0, 6, eeprom=True),
        Register("return_delay_time", 9, 1, 250, 0, 254, eeprom=True),
        Register("drive_mode", 10, 1, 0, 0, 13, eeprom=True),
        Register("operating_mode", 11, 1, 3, 0, 16, eeprom=True),
        Register("homing_offset", 20, 4, 0, 0, 1_044_479, eeprom=True),
        Register("temperature_limit", 31, 1, 70, 0, 100, eeprom=True),
        Register("max_voltage_limit", 32, 2, 70, 31, 70, eeprom=True),
        Register("min_voltage_limit", 34, 2, 35, 31, 70, eeprom=True),
        Register("max_torque", 36, 2, 885, 0, 885, eeprom=True),
        Register("current_limit", 38, 2, 1750, 0, 1750, eeprom=True),
        Register("velocity_limit", 44, 4, 445, 0, 2047, eeprom=True),
        Register("ccw_angle_limit", 48, 4, 4095, 0, 4095, eeprom=True),
        Register("cw_angle_limit", 52, 4, 0, 0, 4095, eeprom=True),
        Register("alarm_shutdown", 63, 1, 53, 0, 255, eeprom=True),
        Register("torque_enable", 64, 1, 0, 0, 1),
        Register("led", 65, 1, 0, 0, 1),
        Register("status_return_level", 68, 1, 2, 0, 2),
        Register("registered", 69, 1, 0, writable=False),
        Register("hardware_error", 70, 1, 0, writable=False),
        Register("position_d_gain", 80, 2, 0, 0, 16383),
        Register("position_i_gain", 82, 2, 0, 0, 16383),
        Register("position_p_gain", 84, 2, 400, 0, 16383),
        Register("bus_watchdog", 98, 1, 0, 0, 127),
        Register("torque_limit", 100, 2, 885, 0, 885),
        Register("goal_current", 102, 2, 1750, 0, 1750),
        Register("goal_velocity", 104, 4, 0, 0, 445),
        Register("profile_acceleration", 108, 4, 0, 0, 32767),
        Register("moving_speed", 112, 4, 0, 0, 32767),
        Register("goal_position", 116, 4, 2048, 0, 4095),
        Register("realtime_tick", 120, 2, 0, writable=False),
        Register("moving", 122, 1, 0, writable=False),
        Register("moving_status", 123, 1, 0, writable=False),
        Register("present_load", 124, 2, 0, writable=False),
        Register("present_current", 126, 2, 0, writable=False),
        Register("present_speed", 128, 4, 0, writable=False),
        Register("present_position", 132, 4, 2048, writable=False),
        Register("present_voltage", 144, 2, 50, writable=False),
        Register("present_temperature", 146, 1, 30, writable=False),
    ),
)

_OTHER_XL430 = {
    r.name: r for r in (
        Register("model_number", 0, 2, 1060, writable=False, eeprom=True), Register("baud_rate", 8, 1, 3, 0, 7, eeprom=True),
        Register("temperature_limit", 31, 1, 72, 0, 100, eeprom=True),
        Register("max_voltage_limit", 32, 2, 160, 60, 160, eeprom=True),
        Register("min_voltage_limit", 34, 2, 60, 60, 160, eeprom=True),
        Register("velocity_limit", 44, 4, 265, 0, 1023, eeprom=True),
        Register("alarm_shutdown", 63, 1, 52, 0, 255, eeprom=True),
        Register("position_p_gain", 84, 2, 800, 0, 16383), Register("goal_velocity", 104, 4, 0, 0, 265),
        Register("present_voltage", 144, 2, 120, writable=False))}
_XL430_RATES = (*_XL330_RATES, 4_500_000)
XL430 = replace(
    XL330, name="XL430-W250-T", bit_rate=lambda value: _XL430_RATES[value],
    registers=tuple(_OTHER_XL430.get(r.name, r) for r in XL330.registers
                    if r.name not in ("current_limit", "goal_current", "present_current")))  # it measures no current

STS3215 = VirtualProfile(
    name="STS3215",
    size=71,
    bit_rate=lambda value: _STS_RATES[value],
    counts=4096,
    span=2 * math.pi,
    centre=2048,
    speed_unit=2 * math.pi / 4096,
    speed_sign=0x8000,
    full_torque=1000,
    refresh=0.0,
    eeprom_lock=1,
    registers=(
        Register("firmware_version", 0, 1, 3, writable=False, eeprom=True),
        Register("model_number", 3, 2, 777, writable=False, eeprom=True),
        Register("id", 5, 1, 1, 0, 253, eeprom=True),
        Register("baud_rate", 6, 1, 0, 0, 7, eeprom=True),
        Register("return_delay_time", 7, 1, 250, 0, 254, eeprom=True),
        Register("status_return_level", 8, 1, 2, 0, 2, eeprom=True),
        Register("cw_angle_limit", 9, 2, 0, 0, 4095, eeprom=True),
        Register("ccw_angle_limit", 11, 2, 4095, 0, 4095, eeprom=True),
        Register("temperature_limit", 13, 1, 70, 0, 100, eeprom=True),
        Register("max_voltage_limit", 14, 1, 80, 0, 254, eeprom=True),
        Register("min_voltage_limit", 15, 1, 40, 0, 254, eeprom=True),
        Register("max_torque", 16, 2, 1000, 0, 1000, eeprom=True),
        Register("alarm_shutdown", 19, 1, 36, 0, 254, eeprom=True),
        Register("position_p_gain", 21, 1, 32, 0, 254, eeprom=True),
        Register("position_d_gain", 22, 1, 32, 0, 254, eeprom=True),
        Register("position_i_gain", 23, 1, 0, 0, 254, eeprom=True),
        Register("punch", 24, 2, 16, 0, 1000, eeprom=True),
        Register("cw_dead_zone", 26, 1, 1, 0, 32, eeprom=True),
        Register("ccw_dead_zone", 27, 1, 1, 0, 32, eeprom=True),
        Register("homing_offset", 31, 2, 0, 0, 4095, eeprom=True),
        Register("operating_mode", 33, 1, 0, 0, 3, eeprom=True),
        Register("torque_enable", 40, 1, 0, 0, 128),
        Register("acceleration", 41, 1, 0, 0, 254),
        Register("goal_position", 42, 2, 2048, 0, 4095),
        Register("goal_time", 44, 2, 0, 0, 1000),
        Register("moving_speed", 46, 2, 0, 0, 3400),
        Register("torque_limit", 48, 2, 1000, 0, 1000),
        Register("lock", 55, 1, 1, 0, 1),
        Register("present_position", 56, 2, 2048, writable=False),
        Register("present_speed", 58, 2, 0, writable=False),
        Register("present_load", 60, 2, 0, writable=False),
        Register("present_voltage", 62, 1, 74, writable=False),
        Register("present_temperature", 63, 1, 30, writable=False),
        Register("hardware_error", 65, 1, 0, writable=False),
        Register("moving", 66, 1, 0, writable=False),
        Register("present_current", 69, 2, 0, writable=False),
    ),
)
