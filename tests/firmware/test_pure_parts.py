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
from tests.sampling import by_day
from tests.support import firmware_parts
from tests.support.board_bench import BOOK
from tests.support.trials.board_settings import spoil

GOOD = BOOK.frame()
TICK = 4_000  # ns
FIELDS = SettingsFrame._fields
PINS = FIELDS[FIELDS.index("left_enable") : FIELDS.index("button") + 1]
# From the Mega 2560's pin drawing: which pins have PWM (without timer 1's 11 and 12, the board's
# clock), which raise interrupts (18 and 19 carry the radio link).
PWM = {2, 3, 4, 5, 6, 7, 8, 9, 10, 13, 44, 45, 46}
INTERRUPTS = {2, 3, 20, 21}
LINKS = {0, 1, 18, 19}


def verdicts(required):
    """(refusal, field) of each settings frame."""
    lines = firmware_parts.run("settings", lines=[pack(each).hex() for each in required])
    return [
        (RefusalCode(int(refusal)).name.lower(), FIELDS[int(field)])
        for refusal, field in (line.split() for line in lines)
    ]


def expected(field, pin):
    """Refusal of `pin` for `field` in the book robot's settings, from the pin drawing."""
    optional = "encoder" in field or field == "button"
    others = [getattr(GOOD, name) for name in PINS if name != field]
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


@pytest.mark.parametrize("field", PINS)
def test_every_pin_for_every_role(field):
    got = verdicts([GOOD._replace(**{field: pin}) for pin in range(256)])
    assert [refusal for refusal, _ in got] == [expected(field, pin) for pin in range(256)]


@pytest.mark.parametrize(
    ("field", "low", "high", "most"),
    by_day(
        2,
        [
            ("telemetry", 1, 100, 65535),
            ("left_slots", 1, 65535, 65535),
            ("right_slots", 1, 65535, 65535),
            ("battery_low", 0, 4092, 65535),
            ("glitch", 0, 50_000, 65535),
            ("deadman", 100, 500, 65535),  # never off
            ("left_start", 0, GAIN_MAXIMUM, 65535),
            ("right_gain", 0, GAIN_MAXIMUM, 65535),
            ("left_proportional", 0, GAIN_MAXIMUM, 65535),
            ("right_integral", 0, GAIN_MAXIMUM, 65535),
            ("baud", 0, 4, 255),
            ("edge", 1, 3, 3),
            ("reserved", 0, 0, 1),
        ],
    ),
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


@pytest.mark.parametrize("slots", [8, 20, 375, 4096, 16_384])
@pytest.mark.parametrize("seed", range(3))
def test_the_physics_models_the_speed_loop(seed, slots):
    """The same edges and commands at the same times: equal within fixed-point rounding.

    The wheel follows a target of its own, stands at times, and turns too slowly at others.
    """
    chance = Random(seed)
    rated = chance.uniform(4.0, 30.0)
    slope = 0.88 / rated
    gains = SpeedGains(0.12, slope, chance.uniform(0.0, 1.0) * slope, slope / 0.1)
    lag = chance.choice((0, chance.randrange(256)))  # periods; 0: unknown
    model = WheelSpeedLoop(gains, slots, lag * 0.01)
    ones = (GAIN_ONE, GAIN_ONE, GAIN_ONE, INTEGRAL_ONE)
    units = [round(gain * one) for gain, one in zip(gains, ones, strict=True)]
    lines = ["gains {} {} {} {} {} {}".format(*units, slots, lag)]
    required: list[tuple[float, bool]] = []
    now, angle, speed, last = 0, 0.0, 0.0, 0
    for _ in range(600):
        if chance.random() < 0.03:
            target = round(chance.uniform(-1.0, 1.0) * rated * 256) / 256
            target *= chance.random() < 0.9
            lines.append(f"command {round(target * 256)} {now // TICK}")
            model.command(now, target)
            required.append((model.duty, False))
        if chance.random() < 0.02:
            speed = abs(model.target) * chance.choice((0.0, 0.5, 0.9, 1.0, 1.1, 3.0))
        edges = int((angle + speed * 0.01) / model.pitch)
        angle += speed * 0.01 - edges * model.pitch
        now += 10_000_000
        if edges:
            last = now - TICK - int(angle / speed * 1e9) // TICK * TICK
            for _ in range(edges):
                model.edge(last)
        lines.append(f"step {now // TICK} {edges} {last // TICK}")
        model.tick(now)
        required.append((model.duty, model.fault))
        if model.fault:
            break
    answers = [line.split() for line in firmware_parts.run("speed", lines=lines)]
    duties = [int(duty) / 32768 for duty, _ in answers[: len(required)]]
    stalls = [bool(int(stalled)) for _, stalled in answers[: len(required)]]
    assert stalls == [stalled for _, stalled in required]
    if required[-1][1]:
        duties.pop(), required.pop()  # the board switches the motor off after the step
    # An error is rounded to 1/256 rad/s; an edge may seem overdue a period earlier in one of them.
    differences = sorted(abs(a - b) for a, (b, _) in zip(duties, required, strict=True))
    assert differences[int(0.95 * len(differences))] < 0.01
    assert differences[-1] < 0.1
