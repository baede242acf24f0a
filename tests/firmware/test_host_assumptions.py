"""The host's tables about our firmware agree with the firmware."""

import re
from pathlib import Path

import pytest

from diffbotctl.config.board_pins import MEGA_2560
from diffbotctl.config.checks.pins import pins_for, serial_pins
from diffbotctl.config.robot import BoardSection, EncoderSection, LinkSection, SpeedLoopSection
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links import link_protocol
from diffbotctl.links.diffbot_codec import WIRE_BYTES
from diffbotctl.links.diffbot_settings import BAUDS
from diffbotctl.testing import firmware_parts

FIRMWARE = Path(__file__).parents[2] / "firmware"
TIMERS = (0, 2, 3, 4, 5)  # of three PWM outputs each, in the order of the firmware's numbers
NOTHING, LINK = 15, 14  # of board.h
BOARDS = "diffbotctl/config/board_pins.py"
BUDGET = "diffbotctl/links/link_protocol.py"
ROBOT = "diffbotctl/config/robot.py"


@pytest.fixture(scope="module")
def table():
    """(PWM output, interrupt) of each pin in the firmware's table."""
    return [tuple(map(int, line.split())) for line in firmware_parts.run("pins")]


def differ(what, host, firmware, place):
    return (
        f"{what}: {host} in the host's table, {firmware} in the firmware. A robot file would pass "
        f"the check and be refused by the board, or the reverse: correct {place}"
    )


def test_the_board_has_the_pins_of_the_host_s_table(table):
    host = len(MEGA_2560.digital) + len(MEGA_2560.analog)
    assert host == len(table), differ("pins", host, len(table), BOARDS)
    source = (FIRMWARE / "board_mega2560.c").read_text()
    for name, expected in (
        ("board_first_analog", MEGA_2560.first_analog),
        ("board_analogs", len(MEGA_2560.analog)),
    ):
        actual = int(re.search(rf"{name} = (\d+);", source)[1])
        assert expected == actual, differ(name, expected, actual, BOARDS)


def test_pins_with_pwm_and_their_timers(table):
    expected = {int(pin): MEGA_2560.pwm[pin] for pin in pins_for(MEGA_2560, "pwm", "diffbot")}
    actual = {number: TIMERS[pwm // 3] for number, (pwm, _) in enumerate(table) if pwm != NOTHING}
    assert expected == actual, differ("timers of PWM pins", expected, actual, BOARDS)


def test_pins_with_interrupts(table):
    serial = serial_pins(MEGA_2560, 1, "diffbot")
    expected = {int(pin) for pin in MEGA_2560.interrupts if pin not in serial}
    actual = {number for number, (_, line) in enumerate(table) if line < LINK}
    assert expected == actual, differ("pins with interrupts", expected, actual, BOARDS)


@pytest.mark.parametrize("uart", MEGA_2560.links["diffbot"])
def test_pins_of_the_serial_links(table, uart):
    expected = {int(pin) for pin in serial_pins(MEGA_2560, uart, "diffbot")}
    actual = {number for number, (_, line) in enumerate(table) if line == LINK}
    assert expected == actual, differ("pins of serial links", expected, actual, BOARDS)


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
    source = (FIRMWARE / "link.c").read_text()
    dividers = [int(each) for each in re.search(r"divisors\[\].*\{(.*)\}", source)[1].split(",")]
    for baud, code in BAUDS.items():
        actual = link_protocol.CRYSTAL_HZ / 8 / (dividers[code] + 1) / link_protocol.BITS_PER_BYTE
        assert link_protocol.capacity(baud) == pytest.approx(actual), (
            f"{baud} baud: the budget has {link_protocol.capacity(baud):.0f} bytes/s, "
            f"the firmware's divider gives {actual:.0f}: correct {BUDGET} or firmware/link.c"
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
