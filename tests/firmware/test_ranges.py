"""Distance sensors that the board measures in turn, on the emulated boards."""

from dataclasses import replace

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.emulator.process import FIRST_SONAR, SONAR_ENDLESS, SONAR_SILENT
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import pack
from diffbotctl.links.diffbot_settings import RangeInput
from diffbotctl.time import MILLISECOND as MS
from tests.support import firmware_parts
from tests.support.board_bench import BOOK, PICO, UNO, BoardBench

PINS = {
    "mega2560": (BOOK, [(24, 50), (25, 51), (26, 11), (27, 12)]),
    "uno": (UNO, [(4, 12), (13, 11), (17, 15), (16, 18)]),
    "pico": (PICO, [(11, 12), (13, 14), (15, 16), (17, 18)]),
}
NOTHING_US = 60_000
ALL = pytest.mark.parametrize("board", PINS)


def settings_of(board, sonars, **others):
    settings, pins = PINS[board]
    inputs = tuple(
        RangeInput(str(index), echo, trigger) for index, (trigger, echo) in enumerate(pins[:sonars])
    )
    return replace(settings, telemetry=30, further_ranges=inputs, **others)


def measured(settings, inputs, ms=1000):
    """Range frames of the board in a second; `inputs` as the emulator takes them."""
    with BoardBench(settings=settings) as bench:
        bench.run(30 * MS, inputs)
        bench.ready()
        bench.wait(300)
        bench.received.clear()
        bench.wait(ms)
        received = [each.frame for each in bench.received]
    return (
        [frame for frame in received if isinstance(frame, frames.RangeFrame)],
        [frame for frame in received if isinstance(frame, frames.StateFrame)],
    )


@ALL
def test_echoes_are_measured_to_20_us(board):
    """3.4 mm. Telemetry at 30 Hz has room beside it on a line of 9600 baud."""
    for width in (120, 5_000, 23_000):
        ranges, states = measured(settings_of(board, 1), {FIRST_SONAR: width})
        assert 19 <= len(ranges) <= 20
        assert len(states) >= 29
        for each in ranges:
            assert each.value * 4 == pytest.approx(width, abs=20)


@ALL
def test_four_sensors_in_turn_do_not_receive_each_other(board):
    """In the rig a burst ends the echo of every sensor that listens."""
    widths = [23_000, 1_000, 12_000, 400]
    inputs = {FIRST_SONAR + index: width for index, width in enumerate(widths)}
    ranges, _ = measured(settings_of(board, 4), inputs)
    order = [each.sensor for each in ranges]
    assert order == [(order[0] + index) % 4 for index in range(len(order))]
    for each in ranges:
        assert each.value * 4 == pytest.approx(widths[each.sensor], abs=20)


@ALL
def test_no_target(board):
    ranges, _ = measured(settings_of(board, 1), {FIRST_SONAR: NOTHING_US})
    assert {each.value for each in ranges} == {frames.RANGE_NOTHING}
    assert len(ranges) >= 18


@ALL
@pytest.mark.parametrize(
    ("width", "value"),
    [(SONAR_SILENT, frames.RANGE_SILENT), (SONAR_ENDLESS, frames.RANGE_ENDLESS)],
)
def test_a_faulty_sensor_is_reported_and_the_other_goes_on(board, width, value):
    """An echo that never ends is never taken for a free way, not even at first."""
    ranges, states = measured(settings_of(board, 2), {FIRST_SONAR: width, FIRST_SONAR + 1: 5_000})
    faulty = {each.value for each in ranges if each.sensor == 0}
    good = [each.value * 4 for each in ranges if each.sensor == 1]
    assert faulty == {value}
    assert len(good) >= 9 and all(each == pytest.approx(5_000, abs=20) for each in good)
    assert len(states) >= 29


def test_an_endless_echo_gives_no_distance_from_the_start():
    settings = settings_of("mega2560", 1)
    with BoardBench(settings=settings) as bench:
        bench.run(30 * MS, {FIRST_SONAR: SONAR_ENDLESS})
        bench.ready()
        bench.wait(1500)
        values = {
            each.frame.value for each in bench.received if isinstance(each.frame, frames.RangeFrame)
        }
    assert values == {frames.RANGE_ENDLESS}


@ALL
def test_analog_sensors_beside_the_first(board):
    """Two more Sharp sensors and an HC-SR04."""
    settings = settings_of(board, 1)
    inputs = (*settings.further_ranges, RangeInput("a", 1), RangeInput("b", 2))
    millivolts = {0: 1000, 1: 2000, 2: 500, FIRST_SONAR: 5_000}
    ranges, states = measured(replace(settings, further_ranges=inputs), millivolts)
    values = {each.sensor: each.value for each in ranges}
    assert values[0] * 4 == pytest.approx(5_000, abs=20)
    assert (values[1] - 1) * 5 / frames.ANALOG_ONE == pytest.approx(2.0, abs=0.01)
    assert (values[2] - 1) * 5 / frames.ANALOG_ONE == pytest.approx(0.5, abs=0.01)
    assert states[-1].range * 5 / frames.ANALOG_ONE == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("chip", "board"), [("mega2560", "mega2560"), ("atmega328p", "nano")])
def test_the_pins_for_an_echo_are_those_of_the_check(chip, board):
    """The firmware's table and the one that `check` uses, pin by pin."""
    pins = BOARDS[board]
    settings = replace(BOOK if chip == "mega2560" else UNO, button=None, range_channel=None)
    names = [*pins.digital, *pins.analog]
    lines = [
        pack(
            replace(
                settings, further_ranges=(RangeInput("", pins.number(name), _other(name)),)
            ).frame()
        ).hex()
        for name in names
    ]
    answers = firmware_parts.run("settings", lines=lines, board=chip)
    refusals = [frames.RefusalCode(int(line.split()[0])) for line in answers]
    serial = {pin for uart in pins.links["diffbot"] for pin in pins.uarts[uart]}
    for name, refusal in zip(names, refusals, strict=True):
        suits = refusal in (frames.RefusalCode.NONE, frames.RefusalCode.PIN_TWICE)
        assert suits == (name in pins.changes) or refusal == frames.RefusalCode.PIN_TWICE, name
        assert not (suits and name in serial), name


def _other(name):
    """A pin for the trigger that nothing else uses."""
    return 11 if name != "11" else 12


@pytest.mark.parametrize(
    ("inputs", "refusal", "field"),
    [
        ([RangeInput("", 50, 50)], "PIN_TWICE", "input_1"),
        ([RangeInput("", 2, 24)], "PIN_INTERRUPT", "input_1"),
        ([RangeInput("", 50, 24), RangeInput("", 51, 24)], "PIN_TWICE", "trigger_2"),
        ([RangeInput("", 0)], "PIN_TWICE", "input_1"),  # A0 is the first sensor's
        ([RangeInput("", 16)], "PIN_ANALOG", "input_1"),
        ([RangeInput("", 50, 19)], "PIN_LINK", "trigger_1"),
    ],
)
def test_settings_that_the_board_refuses(inputs, refusal, field):
    frame = replace(BOOK, further_ranges=tuple(inputs)).frame()
    (line,) = firmware_parts.run("settings", lines=[pack(frame).hex()])
    code, index = map(int, line.split())
    assert frames.RefusalCode(code) is frames.RefusalCode[refusal]
    assert frames.SettingsFrame._fields[index] == field
