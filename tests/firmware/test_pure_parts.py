"""The firmware's pure parts on this machine, under sanitizers."""

from random import Random

import pytest

from diffbotctl.control.speed_loop import SpeedGains, WheelSpeedLoop
from diffbotctl.links.diffbot_codec import pack
from diffbotctl.links.diffbot_frames import (
    GAIN_MAXIMUM,
    GAIN_ONE,
    INTEGRAL_ONE,
    RefusalCode,
    SettingsFrame,
)
from diffbotctl.testing import firmware_parts
from diffbotctl.testing.board_bench import BOOK
from diffbotctl.testing.trials.board import spoil

GOOD = BOOK.frame()
UNKNOWN = 0xFFFFFF  # ticks: the period is unknown
FIELDS = SettingsFrame._fields
# From the Mega 2560's pin drawing: which pins have PWM (without timer 1's 11 and 12, the board's
# clock), which raise interrupts (18 and 19 carry the radio link).
PWM = {2, 3, 4, 5, 6, 7, 8, 9, 10, 13, 44, 45, 46}
INTERRUPTS = {2, 3, 20, 21}
LINKS = {0, 1, 18, 19}


def verdicts(wanted):
    """(refusal, field) of each settings frame."""
    lines = firmware_parts.run("settings", lines=[pack(each).hex() for each in wanted])
    return [
        (RefusalCode(int(refusal)).name.lower(), FIELDS[int(field)])
        for refusal, field in (line.split() for line in lines)
    ]


def expected(field, pin):
    """Refusal of `pin` for `field` in the book robot's settings, from the pin drawing."""
    optional = field in ("left_encoder_b", "right_encoder_b", "button")
    others = [getattr(GOOD, name) for name in FIELDS[11:22] if name != field]
    if pin == 255 and optional:
        return "none"
    if pin >= 70:
        return "pin_missing"
    if pin in LINKS:
        return "pin_link"
    if field.endswith("enable") and pin not in PWM:
        return "pin_pwm"
    if field.endswith("encoder") and pin not in INTERRUPTS:
        return "pin_interrupt"
    if pin in others or pin == 54:  # A0 is the distance sensor's
        return "pin_twice"
    return "none"


@pytest.mark.parametrize("field", FIELDS[11:22])
def test_every_pin_for_every_role(field):
    assert FIELDS[11] == "left_enable"
    assert FIELDS[21] == "button"
    got = verdicts([GOOD._replace(**{field: pin}) for pin in range(256)])
    assert [refusal for refusal, _ in got] == [expected(field, pin) for pin in range(256)]


@pytest.mark.parametrize(
    ("field", "low", "high", "most"),
    [
        ("telemetry", 1, 100, 65535),
        ("slots", 1, 10_000, 65535),
        ("glitch", 0, 50_000, 65535),
        ("deadman", 100, 500, 65535),  # never off
        ("left_start", 0, GAIN_MAXIMUM, 65535),
        ("right_gain", 0, GAIN_MAXIMUM, 65535),
        ("proportional", 0, GAIN_MAXIMUM, 65535),
        ("integral", 0, GAIN_MAXIMUM, 65535),
        ("baud", 0, 4, 255),
        ("edge", 1, 3, 3),
        ("reserved", 0, 0, 3),
    ],
)
def test_every_value_of_a_number(field, low, high, most):
    got = verdicts([GOOD._replace(**{field: value}) for value in range(most + 1)])
    assert [refusal == "none" for refusal, _ in got] == [low <= v <= high for v in range(most + 1)]
    assert {(refusal, name) for refusal, name in got if refusal != "none"} == (
        {("range", field)} if (low, high) != (0, most) else set()
    )


@pytest.mark.parametrize(("field", "other"), [("range", "battery"), ("battery", "range")])
def test_analog_channels(field, other):
    good = GOOD._replace(range=255, battery=255)._replace(**{other: 3})
    got = [refusal for refusal, _ in verdicts([good._replace(**{field: c}) for c in range(256)])]
    # The board has A0 to A15; the other sensor uses channel 3; 255 is none.
    assert got == [
        "none" if c == 255 else "pin_analog" if c > 15 else "pin_twice" if c == 3 else "none"
        for c in range(256)
    ]


def test_invalid_settings_are_refused():
    chance = Random(1)
    assert all(refusal != "none" for refusal, _ in verdicts([spoil(chance) for _ in range(2000)]))


def test_random_inputs_to_every_part():
    """Sanitizers, and the rules that pure.c checks: no duty against the target, no command accepted
    of a link that does not own the commands, no driving for a silent owner."""
    assert firmware_parts.run("fuzz", 7, 300_000) == ["fuzzed 300000"]


@pytest.mark.parametrize("seed", range(4))
def test_the_plant_models_the_speed_loop(seed):
    """The same edges and commands at the same times: equal within fixed-point rounding."""
    chance = Random(seed)
    gains = SpeedGains(0.12, 0.08, chance.choice((0.0, 0.01)), chance.uniform(0.0, 0.05))
    model = WheelSpeedLoop(gains, 20)
    ones = (GAIN_ONE, GAIN_ONE, GAIN_ONE, INTEGRAL_ONE)
    units = [round(gain * one) for gain, one in zip(gains, ones, strict=True)]
    lines = ["gains {} {} {} {} 20".format(*units)]
    wanted, now = [], 0
    last = before = edges = 0
    target = 0.0
    for tick in range(1, 400):
        now = tick * 10_000_000
        if chance.random() < 0.05:
            target = round(chance.uniform(-12, 12) * 256) / 256 if chance.random() < 0.9 else 0.0
            if target == 0.0 or model.target * target <= 0.0:
                edges = 0
            lines.append(f"command {round(target * 256)} {period(now, last, before, edges)}")
            model.command(now, target)
            wanted.append(model.duty)
        if target and chance.random() < 0.4:
            before, last, edges = last, now - chance.randrange(2500) * 4000, min(edges + 1, 2)
            model.edge(last)
        lines.append(f"step {period(now, last, before, edges)}")
        model.tick(now)
        if model.fault:
            break
        wanted.append(model.duty)
    got = [int(line) / 32768 for line in firmware_parts.run("speed", lines=lines)]
    # Rounding of gains (1/65536 each, times 12 rad/s) and of a whole run's integrator steps.
    assert got[: len(wanted)] == pytest.approx(wanted, abs=2e-3)


def period(now, last, before, edges):
    return UNKNOWN if edges < 2 else max(now - last, last - before) // 4000
