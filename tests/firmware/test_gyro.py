"""A gyro on the I2C bus of the emulated boards: its turn, its faults, what goes on beside them."""

from dataclasses import replace
from random import Random

import pytest

from diffbotctl.emulator.process import (
    FIRST_GYRO,
    FIRST_SONAR,
    GYRO_ACCELERATION,
    GYRO_FAULT,
    GYRO_ONE_G,
    GYRO_RATE_UNIT,
)
from diffbotctl.emulator.process import GyroFault as Fault
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import pack
from diffbotctl.links.diffbot_settings import GyroInput, RangeInput
from diffbotctl.time import MILLISECOND as MS
from tests.sampling import by_day, each_once
from tests.support import firmware_parts
from tests.support.board_bench import BOOK, PICO, RADIO, UNO, BoardBench, speed

MPU6050, LSM6 = GyroInput(0x68), GyroInput(0x6A, is_lsm6=True)
SETTINGS = {
    name: replace(settings, telemetry=30, gyro=MPU6050)
    for name, settings in (
        ("mega2560", BOOK),
        ("uno", UNO),
        ("pico", replace(PICO, left=replace(PICO.left, enable=11))),  # 5 is the bus's clock
    )
}
BOARDS, CHIPS = tuple(SETTINGS), (MPU6050, LSM6)
ALL = pytest.mark.parametrize("board", by_day(1, BOARDS))
NOISE_SD = 0.05  # deg/s in readings at 100 Hz, of 0.005 deg/s/sqrt(Hz)
PERIOD = 10 * MS


class GyroBench(BoardBench):
    """A board with a gyro that turns as the bench does."""

    def __init__(self, settings, axis=2):
        super().__init__(settings=settings)
        self.axis, self.noise, self.gravity = axis, Random(1), 0

    def weigh(self, gravity):
        """From now on this acts along the axis, in 1/16384 g."""
        self.gravity = gravity

    def turn_at(self, rate, ms, fault=Fault.NONE):
        """Turn at `rate` deg/s; the frames with turns meanwhile."""
        self.received.clear()
        for _ in range(ms * MS // PERIOD):
            noisy = rate + self.noise.gauss(0.0, NOISE_SD)
            inputs = {
                FIRST_GYRO + self.axis: round(noisy / GYRO_RATE_UNIT),
                GYRO_ACCELERATION + self.axis: self.gravity,
                GYRO_FAULT: fault,
            }
            self.run(self.now + PERIOD, inputs)
        return [each for each in self.received if isinstance(each.frame, frames.InertialFrame)]

    def start(self):
        self.turn_at(0.0, 30)
        self.ready()
        self.turn_at(0.0, 500)


@each_once(board=BOARDS, gyro=CHIPS, axis=(0, 1, 2), is_reversed=(False, True))
def test_gravity_along_the_axis_is_that_of_the_settings(board, gyro, axis, is_reversed):
    """Up or down as stated, also askew by 50 deg: trusted. The other way, or across: refused."""
    gyro = gyro._replace(axis=axis, is_reversed=is_reversed, is_upward_checked=True)
    up = -GYRO_ONE_G if is_reversed else GYRO_ONE_G
    with GyroBench(replace(SETTINGS[board], gyro=gyro), axis) as bench:
        for gravity in (up, round(0.65 * up)):
            bench.weigh(gravity)
            bench.turn_at(0.0, 30)
            bench.ready()
            bench.turn_at(0.0, 500)
            assert not any(each.frame.turn_fault for each in bench.turn_at(0.0, 1000))
        for gravity in (-up, round(0.4 * up), 0):
            bench.weigh(gravity)
            bench.turn_at(0.0, 500)
            assert all(each.frame.turn_fault for each in bench.turn_at(0.0, 1500))
            assert last_flags(bench) & frames.FLAG_GYRO_GRAVITY


@ALL
def test_gravity_of_an_axis_that_is_not_checked_does_not_matter(board):
    with GyroBench(SETTINGS[board]) as bench:
        bench.weigh(-GYRO_ONE_G)
        bench.start()
        assert not any(each.frame.turn_fault for each in bench.turn_at(0.0, 1000))


@ALL
def test_a_bump_is_no_wrong_direction(board):
    """0.2 s without weight, as in a fall of 20 cm, and longer than any bump of a floor."""
    gyro = MPU6050._replace(is_upward_checked=True)
    with GyroBench(replace(SETTINGS[board], gyro=gyro)) as bench:
        bench.weigh(GYRO_ONE_G)
        bench.start()
        for gravity in (0, GYRO_ONE_G, -GYRO_ONE_G, GYRO_ONE_G):
            bench.weigh(gravity)
            assert not any(each.frame.turn_fault for each in bench.turn_at(0.0, 200))


def degrees(before, after, gyro=MPU6050):
    units = (after.turn - before.turn + 0x8000) % 0x10000 - 0x8000
    return gyro.true_turn * units * frames.TURN_NANODEGREES * 1e-9


def last_flags(bench):
    return next(
        each.frame.value
        for each in reversed(bench.received)
        if isinstance(each.frame, frames.StatusFrame) and each.frame.item == frames.ItemCode.FLAGS
    )


@each_once(board=BOARDS, gyro=CHIPS, axis=(0, 1, 2))
def test_the_turn_is_a_running_sum(board, gyro, axis):
    """270 deg at 180 deg/s, from the frames before and after alone: those between may be lost."""
    settings = replace(SETTINGS[board], gyro=gyro._replace(axis=axis))
    with GyroBench(settings, axis) as bench:
        bench.start()
        before = bench.inertial()
        bench.turn_at(180.0, 1500)
        bench.turn_at(0.0, 100)
        after = bench.inertial()
    assert degrees(before, after, gyro) == pytest.approx(270.0, abs=0.2)
    assert after.turn_fault == 0


@ALL
def test_an_lsm6_at_its_second_address_turns_backwards_too(board):
    with GyroBench(replace(SETTINGS[board], gyro=LSM6._replace(address=0x6B))) as bench:
        bench.start()
        before = bench.inertial()
        bench.turn_at(-400.0, 500)
        bench.turn_at(0.0, 100)
        assert degrees(before, bench.inertial(), LSM6) == pytest.approx(-200.0, abs=0.2)


@each_once(board=BOARDS, gyro=(MPU6050._replace(address=0x6A), LSM6._replace(address=0x68)))
def test_another_chip_at_the_address_counts_as_none(board, gyro):
    """Its registers do not keep the full scale."""
    with GyroBench(replace(SETTINGS[board], gyro=gyro)) as bench:
        bench.turn_at(0.0, 30)
        bench.ready()
        assert all(each.frame.turn_fault for each in bench.turn_at(0.0, 1000))


FAULTS = {
    Fault.SILENT: frames.FLAG_GYRO_SILENT,
    Fault.BUS_HELD: frames.FLAG_GYRO_BUS,
    Fault.STUCK: frames.FLAG_GYRO_STUCK,
}


@each_once(board=BOARDS, gyro=CHIPS, fault=tuple(FAULTS))
def test_a_failure_under_way_is_reported_within_half_a_second(board, gyro, fault):
    flag = FAULTS[fault]
    """And over: the gyro is trusted again after 300 ms without a fault."""
    with GyroBench(replace(SETTINGS[board], gyro=gyro)) as bench:
        bench.start()
        began = bench.now
        received = bench.turn_at(20.0, 700, fault)
        noticed = next(each.time for each in received if each.frame.turn_fault)
        assert noticed - began < 500 * MS
        assert last_flags(bench) & flag
        assert not bench.turn_at(20.0, 600)[-1].frame.turn_fault


@each_once(board=BOARDS, fault=(Fault.SILENT, Fault.BUS_HELD))
def test_a_gyro_that_is_dead_at_the_start_is_never_trusted(board, fault):
    with GyroBench(SETTINGS[board]) as bench:
        bench.turn_at(0.0, 30, fault)
        bench.ready()
        received = bench.turn_at(0.0, 1000, fault)
    assert len(received) >= 29  # telemetry goes on
    assert all(each.frame.turn_fault for each in received)


@each_once(board=BOARDS, gyro=((MPU6050, 520.0), (LSM6, 580.0)))
def test_a_turn_beyond_the_full_scale_is_reported(board, gyro):
    gyro, beyond = gyro
    """An LSM6 measures up to 573 deg/s before its numbers end."""
    with GyroBench(replace(SETTINGS[board], gyro=gyro)) as bench:
        bench.start()
        assert not bench.turn_at(480.0, 300)[-1].frame.turn_fault
        assert bench.turn_at(beyond, 300)[-1].frame.turn_fault
        assert last_flags(bench) & frames.FLAG_GYRO_RANGE


@each_once(board=BOARDS, gyro=CHIPS)
def test_a_gyro_that_lost_its_settings_gets_them_again(board, gyro):
    """After a dip of its supply an MPU6500 measures at twice the rate, an LSM6 not at all."""
    with GyroBench(replace(SETTINGS[board], gyro=gyro)) as bench:
        bench.start()
        before = bench.inertial()
        bench.turn_at(90.0, 1000)
        bench.turn_at(90.0, 1000, Fault.SUPPLY_DIP)
        bench.turn_at(0.0, 100, Fault.SUPPLY_DIP)
        assert degrees(before, bench.inertial(), gyro) == pytest.approx(180.0, abs=2.0)


@ALL
def test_a_gyro_that_waits_in_a_reading_is_clocked_out_of_it(board):
    """A board that restarts in the middle of a reading leaves its gyro holding the data line."""
    with GyroBench(SETTINGS[board]) as bench:
        bench.turn_at(0.0, 30, Fault.BUS_IN_READING)
        bench.ready()
        assert not bench.turn_at(0.0, 700, Fault.BUS_IN_READING)[-1].frame.turn_fault


@ALL
def test_a_bus_that_is_held_stops_nothing_else(board):
    """Commands, dead-man timeout and the time of the main loop."""
    with GyroBench(SETTINGS[board]) as bench:
        bench.start()
        bench.turn_at(0.0, 500, Fault.BUS_HELD)
        bench.claim()
        bench.send(RADIO, speed(1, 3.0, 3.0))
        bench.turn_at(0.0, 100, Fault.BUS_HELD)
        assert bench.duty[0] > 0.0 and bench.duty[1] > 0.0
        bench.turn_at(0.0, 1000, Fault.BUS_HELD)
        assert bench.inertial().mode == frames.ModeCode.EXPIRED
        assert bench.duty == [0.0, 0.0]
        bench.turn_at(0.0, 1500, Fault.BUS_HELD)
        loops = [
            each.frame.value
            for each in bench.received
            if isinstance(each.frame, frames.StatusFrame)
            and each.frame.item == frames.ItemCode.LOOP
        ]
        assert loops and max(loops) < 2000


@ALL
def test_30_frames_a_second_at_9600_baud_beside_two_distance_sensors(board):
    """A Sharp in the state, and an HC-SR04."""
    echo, trigger = {"mega2560": (50, 24), "uno": (12, 4), "pico": (12, 13)}[board]
    pins = RangeInput("side", echo, trigger)
    settings = replace(SETTINGS[board], further_ranges=(pins,))
    with GyroBench(settings) as bench:
        bench.run(30 * MS, {FIRST_SONAR: 5_000, 0: 1000})
        bench.ready()
        bench.turn_at(0.0, 500)
        received = bench.turn_at(0.0, 2000)
        ranges = [each for each in bench.received if isinstance(each.frame, frames.RangeFrame)]
    assert len(received) >= 60
    assert not any(each.frame.dropped for each in received)
    assert len(ranges) >= 38


@pytest.mark.parametrize(
    ("board", "other", "refusal", "field"),
    [
        ("mega2560", {"button": 20}, "PIN_TWICE", "gyro_address"),
        ("mega2560", {"button": 21}, "PIN_TWICE", "gyro_address"),
        ("uno", {"button": 18}, "PIN_TWICE", "gyro_address"),
        ("uno", {"battery_channel": 5}, "PIN_TWICE", "gyro_address"),
        ("mega2560", {"gyro": GyroInput(0x68, 6)}, "RANGE", "gyro_address"),
        ("mega2560", {"gyro": GyroInput(0x6A, 3, is_lsm6=True)}, "RANGE", "gyro_address"),
        ("uno", {"gyro": GyroInput(0x68, is_upward_checked=True)}, "NONE", "baud"),
        ("mega2560", {}, "NONE", "baud"),
        ("uno", {}, "NONE", "baud"),
    ],
)
def test_pins_of_the_bus_belong_to_the_gyro(board, other, refusal, field):
    frame = replace(SETTINGS[board], **other).frame()
    chip = "mega2560" if board == "mega2560" else "atmega328p"
    (line,) = firmware_parts.run("settings", lines=[pack(frame).hex()], board=chip)
    code, index = map(int, line.split())
    assert frames.RefusalCode(code) is frames.RefusalCode[refusal]
    assert frames.SettingsFrame._fields[index] == field
