"""Pulses on in1 and in2 on each board: every stop brakes, then releases; what is refused."""

from dataclasses import replace

import pytest

from diffbotctl.links import diffbot_frames as frames
from tests.sampling import by_day
from tests.support.board_bench import (
    BOOK,
    PICO,
    RADIO,
    UNO,
    BenchBoard,
    BoardBench,
    speed,
    trials_on,
)
from tests.support.trials import board, board_faults, wheel_loop

CODE = frames.DriverCode.PULSED_INPUTS
REFUSAL = frames.RefusalCode


def pulsed(settings):
    """The settings with pulses on pins that have PWM, also on an Uno."""
    left = replace(settings.left, enable=7, in1=5, in2=6)
    right = replace(settings.right, enable=8, in1=9, in2=10)
    return replace(settings, driver=CODE, left=left, right=right)


BOARDS = pytest.mark.parametrize(
    "settings",
    by_day(1, [pulsed(UNO), pulsed(BOOK), pulsed(PICO)]),
    ids=["uno", "mega2560", "pico"],
)


def driving(bench, target=5):
    bench.ready()
    bench.send(RADIO, speed(1, target, target))
    bench.wait(30)
    assert all(bench.duty)


def shares(bench):
    """Duty and shorted share of each motor, as of its last change."""
    last = {change.motor: (change.duty, change.shorted) for change in bench.changes}
    return [last[0], last[1]]


BRAKED, RELEASED = [(0.0, 1.0)] * 2, [(0.0, 0.0)] * 2


@BOARDS
def test_a_motion_ends_braked_and_its_rest_released(settings):
    with BoardBench(settings=settings) as bench:
        driving(bench)
        bench.send(RADIO, frames.StopFrame(2))
        bench.wait(20)
        assert shares(bench) == BRAKED
        bench.wait(320)
        assert shares(bench) == RELEASED


@BOARDS
def test_a_rolling_wheel_is_braked_until_it_stands(settings):
    with BoardBench(settings=settings) as bench:
        driving(bench)
        bench.turn(1.0)
        bench.send(RADIO, frames.StopFrame(2))
        bench.wait(900)
        assert shares(bench) == BRAKED
        bench.wait(450)
        assert shares(bench) == RELEASED


@BOARDS
def test_the_deadman_stop_brakes_and_releases(settings):
    with BoardBench(settings=settings) as bench:
        driving(bench)
        bench.wait(300)
        assert shares(bench) == BRAKED
        bench.wait(320)
        assert bench.state().mode == frames.ModeCode.EXPIRED
        assert shares(bench) == RELEASED


@BOARDS
def test_a_hung_program_and_a_reset_release(settings):
    with BoardBench(settings=settings) as bench:
        driving(bench)
        bench.emulator.hang()
        bench.wait(150)
        assert shares(bench) == RELEASED
        bench.wait(100)
        driving(bench)
        bench.emulator.reset()
        bench.wait(20)
        assert shares(bench) == RELEASED


@BOARDS
def test_a_stall_is_a_fault_that_stops(settings):
    with BoardBench(settings=settings) as bench:
        driving(bench)
        for number in range(30):
            bench.send(RADIO, speed(number, 5, 5))
            bench.wait(100)
        bench.wait(50)
        assert bench.state().mode == frames.ModeCode.FAULT
        assert shares(bench) == RELEASED


@BOARDS
def test_what_the_firmware_refuses(settings):
    """An input without PWM, or none. On a Pico pins 6 and 22 have one PWM output."""
    plain = {PICO.board: 22, UNO.board: 4}.get(settings.board, 24)
    without_pwm = replace(settings, left=replace(settings.left, in1=plain))
    code = REFUSAL.PIN_TWICE if settings.board is PICO.board else REFUSAL.PIN_PWM
    jumpers = replace(
        settings,
        left=replace(settings.left, enable=None),
        right=replace(settings.right, enable=None),
    )
    with BoardBench(settings=settings) as bench:
        bench.wait(30)
        bench.ask()
        no_input = replace(settings, left=replace(settings.left, in2=None))
        assert bench.configure(no_input).refusal == REFUSAL.PIN_MISSING
        assert bench.configure(without_pwm).refusal == code
        assert bench.configure(jumpers).refusal == REFUSAL.NONE


@pytest.mark.parametrize(
    "rows",
    [
        lambda: board.deadman(3, 9),
        lambda: board.restarts(3, 2),
        lambda: board_faults.storms(3, 4),
        lambda: wheel_loop.stalls(4, 2, emulated=True),
    ],
    ids=["deadman", "restarts", "storms", "stalls"],
)
def test_figures(rows):
    with trials_on(BenchBoard(pulsed(BOOK), "book_2wd")):
        for row in rows():
            assert row.met, row
