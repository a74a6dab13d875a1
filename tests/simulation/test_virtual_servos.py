"""Virtual AX-12A servos: what dynamixel-sdk finds on them, their times, their alarms, and two that talk at once."""

from __future__ import annotations

import dynamixel_sdk as sdk
import pytest

from workbench.device.virtual import (
    AX12A,
    MICROSECOND,
    MILLISECOND,
    SECOND,
    Clock,
    RampBody,
    ServoBus,
    VirtualPort,
    VirtualServo,
    bit_flips,
)
from workbench.device.virtual.protocol import packet
from workbench.robot import BUS_IDS, COUNT

IDS = sorted(BUS_IDS.values())


class Listener:
    """Hears all, with times."""

    def __init__(self) -> None:
        self.heard: list[tuple[int, int]] = []

    def hear(self, times, values, garbled, rate) -> None:
        self.heard += zip(times, values)


def chain(ids=IDS, body=None, **lines):
    bus = ServoBus(Clock(), **lines)
    body = body or RampBody()
    return bus, {ident: VirtualServo(bus, AX12A, ident, body) for ident in ids}


@pytest.fixture
def robot():
    bus, servos = chain()
    return bus, servos, VirtualPort(bus), sdk.PacketHandler(1.0)


def test_dynamixel_sdk_finds_pings_reads_and_writes(robot):
    _bus, _servos, port, handler = robot
    assert [handler.ping(port, i) for i in IDS] == [(12, 0, 0)] * 15
    assert handler.ping(port, 99)[1] == sdk.COMM_RX_TIMEOUT
    assert handler.write1ByteTxRx(port, 4, 29, 64) == (0, 0)
    assert handler.read1ByteTxRx(port, 4, 29) == (64, 0, 0)
    assert handler.write2ByteTxRx(port, 4, 36, 100) == (0, 8)  # read only: range error
    assert handler.write2ByteTxRx(port, 4, 30, 1024) == (0, 8)
    assert handler.write1ByteTxRx(port, 4, 10, 1) == (0, 8)  # no register there


def test_sync_write_moves_the_joints_and_the_positions_are_right_to_a_count(robot):
    bus, servos, port, handler = robot
    group = sdk.GroupSyncWrite(port, handler, 30, 4)
    for i in IDS:
        assert group.addParam(i, [(400 + i) & 255, (400 + i) >> 8, 200, 0])
    assert group.txPacket() == 0
    bus.clock.advance(SECOND // 10)
    speed = 200 * 0.111 * 6 / 300 * 1023  # counts a second
    sent = servos[4].written[0][0]
    expected = 512 - speed * (bus.clock.now - sent) / SECOND
    assert abs(handler.read2ByteTxRx(port, 4, 36)[0] - expected) <= 1
    assert handler.read1ByteTxRx(port, 4, 46)[0] == 1
    bus.clock.advance(2 * SECOND)
    assert [handler.read2ByteTxRx(port, i, 36)[0] for i in IDS] == [400 + i for i in IDS]
    assert handler.read1ByteTxRx(port, 4, 46)[0] == 0


def test_the_answer_comes_after_the_return_delay_and_never_inside_the_motor_interrupt():
    delays = []
    for rdt in (250, 0):
        bus, servos = chain([1])
        servos[1]["return_delay_time"] = rdt
        ear = Listener()
        bus.join(ear)
        for k in range(200):
            start = bus.clock.now + k * 77 * MICROSECOND + MILLISECOND
            end = bus.talk(bus, packet(1, 1), 1_000_000, start)
            ear.heard.clear()
            bus.clock.advance(end + 2 * MILLISECOND)
            first = ear.heard[6][0] - 720
            delays.append((rdt, (first - end) / MICROSECOND))
            for time, _ in ear.heard[6:]:
                assert (time - 720 - servos[1]._phase) % MILLISECOND >= 130 * MICROSECOND
    slow = [d for rdt, d in delays if rdt]
    fast = [d for rdt, d in delays if not rdt]
    assert 517 < min(slow) < 525 < max(slow) <= 500 + 20 + 131
    assert 17 < min(fast) < 25 < max(fast) <= 20 + 131


def test_eeprom_writes_make_it_deaf_and_power_off_forgets_only_ram(robot):
    bus, servos, port, handler = robot
    assert handler.write2ByteTxRx(port, 7, 6, 100) == (0, 0)
    assert handler.ping(port, 7)[1] == sdk.COMM_RX_TIMEOUT  # two bytes of 6 ms
    bus.clock.advance(bus.clock.now + 20 * MILLISECOND)
    assert handler.ping(port, 7)[1] == 0
    handler.write1ByteTxRx(port, 7, 25, 1)
    servos[7].power(False)
    assert handler.ping(port, 7)[1] == sdk.COMM_RX_TIMEOUT
    servos[7].power(True)
    bus.clock.advance(bus.clock.now + SECOND)  # it boots
    assert handler.read1ByteTxRx(port, 7, 25)[0] == 0
    assert handler.read2ByteTxRx(port, 7, 6)[0] == 100
    assert handler.write2ByteTxRx(port, 7, 30, 99) == (0, 2)  # outside the angle limits


def test_lock_keeps_the_eeprom_until_power_off(robot):
    bus, servos, port, handler = robot
    assert handler.write1ByteTxRx(port, 5, 47, 1) == (0, 0)
    assert handler.write1ByteTxRx(port, 5, 3, 9) == (0, 8)
    assert handler.write1ByteTxRx(port, 5, 47, 0) == (0, 8)
    servos[5].power(False)
    servos[5].power(True)
    bus.clock.advance(bus.clock.now + SECOND)  # it boots
    assert handler.write1ByteTxRx(port, 5, 3, 99) == (0, 0)
    assert servos[5].ident == 99


def test_overload_heat_and_voltage_are_told_and_take_the_torque(robot):
    bus, servos, port, handler = robot
    handler.write2ByteTxRx(port, 4, 30, 600)
    servos[4].overload = True
    assert handler.read2ByteTxRx(port, 4, 34) == (0, 0, 32)
    where = handler.read2ByteTxRx(port, 4, 36)[0]
    bus.clock.advance(bus.clock.now + SECOND)
    assert handler.read2ByteTxRx(port, 4, 36)[0] == where  # limp
    servos[5].temperature = 71.0
    assert handler.ping(port, 5)[2] == 4
    bus.supply = 5.5
    assert handler.ping(port, 6)[2] == 1
    assert handler.read1ByteTxRx(port, 6, 42)[0] == 55


def test_speed_and_load_are_new_seven_times_a_second(robot):
    bus, _servos, port, handler = robot
    handler.write4ByteTxRx(port, 4, 30, 900 | 100 << 16)
    seen = []
    for _ in range(300):
        seen.append((bus.clock.now, handler.read2ByteTxRx(port, 4, 38)[0], handler.read2ByteTxRx(port, 4, 36)[0]))
        bus.clock.advance(bus.clock.now + 5 * MILLISECOND)
    assert len({position for _, _, position in seen}) > 200
    starts = [t for (t, v, _), (_, w, _) in zip(seen[1:], seen) if v != w]
    assert len(starts) <= 3
    assert seen[-1][1] == 0
    assert 100 in {speed for _, speed, _ in seen}


def test_two_servos_with_one_id_garble_each_other():
    bus = ServoBus(Clock())
    body = RampBody({1: 0.0, 2: 100 * COUNT})
    VirtualServo(bus, AX12A, 7, body, joint=1)
    VirtualServo(bus, AX12A, 7, body, joint=2, seed=1)
    port, handler = VirtualPort(bus), sdk.PacketHandler(1.0)
    results = {handler.readTxRx(port, 7, 36, 8)[1] for _ in range(20)}
    assert sdk.COMM_SUCCESS not in results
    assert bus.collisions


def test_a_servo_at_another_bit_rate_hears_nothing(robot):
    _bus, servos, port, handler = robot
    servos[9]["baud_rate"] = 34
    assert handler.ping(port, 9)[1] == sdk.COMM_RX_TIMEOUT
    port.setBaudRate(57600)
    assert handler.ping(port, 9) == (12, 0, 0)
    assert handler.ping(port, 8)[1] == sdk.COMM_RX_TIMEOUT


def test_flipped_bits_are_refused_by_the_checksum_or_seen_by_the_sdk():
    bus, _servos = chain(to_servos=bit_flips(0.02, 1), from_servos=bit_flips(0.02, 2))
    port, handler = VirtualPort(bus), sdk.PacketHandler(1.0)
    results = [handler.readTxRx(port, 4, 36, 2) for _ in range(400)]
    assert all(value == [0, 2] for value, code, error in results if code == 0 and error == 0)
    assert 0.5 < sum(code == 0 for _, code, _ in results) / 400 < 0.95


def test_echo_and_unplugging_behave_as_the_sdk_meets_them(robot):
    bus, _servos, _, handler = robot
    echoing = VirtualPort(bus, echo=True)
    assert handler.write2ByteTxRx(echoing, 4, 30, 600)[1] == 3  # its own instruction byte, taken for an error
    port = VirtualPort(bus)
    port.unplugged = True
    import termios
    with pytest.raises(termios.error):
        handler.ping(port, 4)


def test_a_seed_repeats_every_byte():
    def trace():
        bus, _ = chain(from_servos=bit_flips(0.01, 3))
        ear = Listener()
        bus.join(ear)
        port, handler = VirtualPort(bus), sdk.PacketHandler(1.0)
        for k in range(30):
            handler.readTxRx(port, IDS[k % 15], 24, 26)
        return ear.heard

    assert trace() == trace()
