"""The host's tables about our firmware agree with the firmware."""

import re
from pathlib import Path

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.checks.pins import pins_for, serial_pins
from diffbotctl.config.robot import BoardSection, EncoderSection, LinkSection, SpeedLoopSection
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links import link_protocol
from diffbotctl.links.diffbot_codec import WIRE_BYTES
from diffbotctl.links.diffbot_settings import BAUDS
from tests.support import firmware_parts

FIRMWARE = Path(__file__).parents[2] / "firmware"
# Timers of three PWM outputs each, in the order of the firmware's numbers.
TIMERS = {"mega2560": (0, 2, 3, 4, 5), "atmega328p": (0, 1)}
NOTHING, LINK = 15, 14  # of board.h
TABLE = "diffbotctl/parts/boards.yaml"
BUDGET = "diffbotctl/links/link_protocol.py"
ROBOT = "diffbotctl/config/robot.py"


@pytest.fixture(params=["mega2560", "nano"])
def pins(request):
    """The host's table of a board."""
    return BOARDS[request.param]


@pytest.fixture
def table(pins):
    """(PWM output, interrupt) of each pin in the firmware's table."""
    lines = firmware_parts.run("pins", board=pins.chip.lower())
    return [tuple(map(int, line.split())) for line in lines]


def differ(what, host, firmware, place):
    return (
        f"{what}: {host} in the host's table, {firmware} in the firmware. A robot file would pass "
        f"the check and be refused by the board, or the reverse: correct {place}"
    )


def test_the_board_has_the_pins_of_the_host_s_table(pins, table):
    host = len(pins.digital) + len(pins.analog)
    assert host == len(table), differ("pins", host, len(table), TABLE)
    source = (FIRMWARE / f"board_{pins.chip.lower()}.c").read_text()
    for name, expected in (
        ("board_first_analog", pins.first_analog),
        ("board_analogs", len(pins.analog)),
    ):
        actual = int(re.search(rf"{name} = (\d+);", source)[1])
        assert expected == actual, differ(name, expected, actual, TABLE)
    assert source.count("ANALOG_ONLY") == len(pins.analog_only)


def test_pins_with_pwm_and_their_timers(pins, table):
    expected = {int(pin): pins.pwm[pin] for pin in pins_for(pins, "pwm", "diffbot")}
    timers = TIMERS[pins.chip.lower()]
    actual = {number: timers[pwm // 3] for number, (pwm, _) in enumerate(table) if pwm != NOTHING}
    assert expected == actual, differ("timers of PWM pins", expected, actual, TABLE)


def test_pins_with_interrupts(pins, table):
    serial = serial_pins(pins, pins.links["diffbot"][-1], "diffbot")
    expected = {int(pin) for pin in pins.interrupts if pin not in serial}
    actual = {number for number, (_, line) in enumerate(table) if line < LINK}
    assert expected == actual, differ("pins with interrupts", expected, actual, TABLE)


def test_pins_of_the_serial_links(pins, table):
    for uart in pins.links["diffbot"]:
        expected = {int(pin) for pin in serial_pins(pins, uart, "diffbot")}
        actual = {number for number, (_, line) in enumerate(table) if line == LINK}
        assert expected == actual, differ("pins of serial links", expected, actual, TABLE)


@pytest.mark.parametrize(
    ("name", "expected", "frame"),
    [
        ("EDGE_FRAME_BYTES", link_protocol.EDGE_FRAME_BYTES, frames.StateFrame),
        ("COUNT_FRAME_BYTES", link_protocol.COUNT_FRAME_BYTES, frames.CountsFrame),
    ],
)
def test_bytes_of_a_frame(name, expected, frame):
    actual = WIRE_BYTES[frame]
    assert expected == actual, (
        f"{name}: the link budget uses {expected} bytes a frame, protocol.yaml gives "
        f"{actual}. A telemetry rate would pass that the line cannot carry: correct {BUDGET}"
    )


def test_the_line_s_real_baud_rate():
    """The budget and the firmware have the same clock divider."""
    source = (FIRMWARE / "avr.c").read_text()
    dividers = [int(each) for each in re.search(r"divisors\[\].*\{(.*)\}", source)[1].split(",")]
    for baud, code in BAUDS.items():
        actual = link_protocol.CRYSTAL_HZ / 8 / (dividers[code] + 1) / link_protocol.BITS_PER_BYTE
        assert link_protocol.capacity(baud) == pytest.approx(actual), (
            f"{baud} baud: the budget has {link_protocol.capacity(baud):.0f} bytes/s, "
            f"the firmware's divider gives {actual:.0f}: correct {BUDGET} or firmware/avr.c"
        )


def test_baud_rates():
    coded = {code.meaning: code for code in frames.BaudCode}
    expected = {str(baud): code for baud, code in BAUDS.items()}
    assert expected == coded, differ("baud rates", expected, coded, "diffbot_settings.py")
    assert set(LinkSection.baud.choices) <= set(BAUDS), differ(
        "baud rates", LinkSection.baud.choices, BAUDS, ROBOT
    )


@pytest.mark.parametrize(
    ("parameter", "name", "unit", "most"),
    [
        (BoardSection.telemetry, "telemetry", 1, frames.TELEMETRY_MAXIMUM),
        (BoardSection.deadman, "deadman", 1e3, frames.DEADMAN_MAXIMUM),
        (EncoderSection.slots, "slots", 1, frames.SLOTS_MAXIMUM),
        (EncoderSection.glitch, "glitch", 1e6, frames.GLITCH_MAXIMUM),
        (SpeedLoopSection.static, "static", frames.GAIN_ONE, frames.GAIN_MAXIMUM),
        (SpeedLoopSection.speed, "speed", frames.GAIN_ONE, frames.GAIN_MAXIMUM),
        (SpeedLoopSection.proportional, "proportional", frames.GAIN_ONE, frames.GAIN_MAXIMUM),
        (SpeedLoopSection.integral, "integral", frames.INTEGRAL_ONE, frames.GAIN_MAXIMUM),
    ],
)
def test_bounds_of_the_robot_file(parameter, name, unit, most):
    """The board accepts every value that the robot file may have."""
    upper = parameter.bounds["maximum"]
    assert round(upper * unit) <= most, (
        f"{name}: a robot file may have {upper}, which is {upper * unit:g} on the wire, and the "
        f"board takes at most {most}. It would pass the check and be refused: correct {ROBOT}"
    )


def test_the_shortest_deadman():
    least = BoardSection.deadman.bounds["minimum"] * 1000
    assert least >= frames.DEADMAN_MINIMUM, (
        f"a robot file may ask for {least:g} ms, the board takes at least "
        f"{frames.DEADMAN_MINIMUM}: correct {ROBOT}"
    )
