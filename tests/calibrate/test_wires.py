"""Pulses and what they show: worked out by hand for every way to mix up wires."""

import pytest

from diffbotctl.calibrate import wiring_detection
from diffbotctl.calibrate.wiring_detection import MotorPulse, WheelMotion
from diffbotctl.config.load import load_robot

QUIET = {"left": 0, "right": 0}


def detect(left, right, resting=QUIET):
    """`left`, `right`: what was seen and the counts of both sockets, by the channel pulsed."""
    pulses = {
        channel: MotorPulse(channel, WheelMotion(seen), {"left": a, "right": b})
        for channel, (seen, a, b) in (("left", left), ("right", right))
    }
    return wiring_detection.detect_wiring(pulses, resting)


def begins(faults):
    return [fault.split(":")[0] for fault in faults]


@pytest.mark.parametrize(
    "left, right, mended",
    [
        (("left forward", 4, 0), ("right forward", 0, 4), []),
        (("left backward", 4, 0), ("right forward", 0, 4), ["left motor reversed"]),
        # the left channel turns the right wheel, whose encoder sits in its own socket
        (("right forward", 0, 4), ("left forward", 4, 0), ["motors swapped"]),
        (("left forward", 0, 4), ("right forward", 4, 0), ["encoders swapped"]),
        # both exchanged: each channel arrives at its own socket, and only the eye can tell
        (("right forward", 4, 0), ("left forward", 0, 4), ["motors swapped", "encoders swapped"]),
        (
            ("right backward", 0, 4),
            ("left forward", 4, 0),
            ["motors swapped", "right motor reversed"],
        ),
        # one count is noise: a wheel that was pushed gives more
        (("left forward", 4, 1), ("right forward", 1, 4), []),
    ],
)
def test_faults_that_settings_correct(left, right, mended):
    detected = detect(left, right)
    assert begins(detected.corrections) == mended
    assert detected.faults == [] and detected.is_complete


@pytest.mark.parametrize(
    "left, right, resting, faults, mended",
    [
        (("none", 0, 0), ("right forward", 0, 4), QUIET, ["left motor dead"], []),
        (("left forward", 0, 0), ("right forward", 0, 4), QUIET, ["left encoder dead"], []),
        (
            ("left forward", 4, 20),
            ("right forward", 0, 20),
            {"left": 0, "right": 50},
            ["right encoder floating"],
            [],
        ),
        # the left wheel counts in the right socket, so the dead one must sit in the left
        (
            ("left forward", 0, 4),
            ("right forward", 0, 0),
            QUIET,
            ["right encoder dead"],
            ["encoders swapped"],
        ),
        (
            ("none", 0, 0),
            ("both forward", 4, 4),
            QUIET,
            ["both motors are connected to the right output of the driver"],
            [],
        ),
        (
            ("left forward", 4, 0),
            ("left forward", 4, 0),
            QUIET,
            ["both outputs turn the left wheel"],
            [],
        ),
        (
            ("left forward", 4, 4),
            ("right forward", 0, 4),
            QUIET,
            ["both encoders count when only the left wheel turns"],
            [],
        ),
    ],
)
def test_faults_that_need_rewiring(left, right, resting, faults, mended):
    detected = detect(left, right, resting)
    assert (begins(detected.faults), begins(detected.corrections)) == (faults, mended)


def test_pins_and_directions_that_make_up_for_exchanged_and_reversed_motors():
    robot = load_robot("book_2wd").robot  # left 5, 6, 7, reversed; right 8, 9, 10
    detected = detect(("right forward", 0, 4), ("left backward", 4, 0))
    values = {each.field: each.value for each in wiring_detection.wiring_findings(detected, robot)}
    assert values == {
        "drive.right.motor.enable": "5",
        "drive.right.motor.in1": "6",
        "drive.right.motor.in2": "7",
        "drive.right.motor.reversed": True,  # channel 5, 6, 7 is set so, and was right
        "drive.left.motor.enable": "8",
        "drive.left.motor.in1": "9",
        "drive.left.motor.in2": "10",
        # channel 8, 9, 10 was not set so and turned backward: now it is, and left stays as it was
    }


def test_encoders_change_their_pins():
    detected = detect(("left forward", 0, 4), ("right forward", 4, 0))
    values = {
        e.field: e.value
        for e in wiring_detection.wiring_findings(detected, load_robot("book_2wd").robot)
    }
    assert values == {"drive.left.encoder.pin": "3", "drive.right.encoder.pin": "2"}


def test_nothing_is_exchanged_on_incomplete_evidence():
    detected = detect(("none", 0, 0), ("left forward", 4, 0))
    assert not detected.is_complete
    assert wiring_detection.wiring_findings(detected, load_robot("book_2wd").robot) == []


def two_channels(left, right, stated):
    """Corrections and findings of pulses of 40 counts; `left`, `right`: what was seen, the input
    that counted, and the direction that it counted."""
    pulses = {}
    for channel, (seen, socket, direction) in (("left", left), ("right", right)):
        counts = {side: 40 if side == socket else 0 for side in ("left", "right")}
        pulses[channel] = MotorPulse(channel, WheelMotion(seen), counts, {socket: direction})
    detected = wiring_detection.detect_wiring(pulses, QUIET)
    sets = [
        "robot.drive.encoder.channels=2",
        "robot.drive.left.encoder.pin_b=22",
        "robot.drive.right.encoder.pin_b=23",
        *(f"robot.drive.{side}.encoder.reversed={value}" for side, value in stated.items()),
    ]
    findings = wiring_detection.wiring_findings(detected, load_robot(None, sets).robot)
    return begins(detected.corrections), {
        finding.field.removeprefix("drive."): finding.value
        for finding in findings
        if ".encoder." in finding.field
    }


@pytest.mark.parametrize(
    "left, right, stated, mended, written",
    [
        (("left forward", "left", 1), ("right forward", "right", 1), {}, [], {}),
        (
            ("left forward", "left", -1),
            ("right forward", "right", 1),
            {},
            ["left encoder"],
            {"left.encoder.reversed": True},
        ),
        # the motor turns backward, and the encoder counts back, as it must
        (
            ("left backward", "left", -1),
            ("right forward", "right", 1),
            {},
            ["left motor reversed"],
            {},
        ),
        (
            ("left forward", "left", 1),
            ("right backward", "right", 1),
            {},
            ["right encoder", "right motor reversed"],
            {"right.encoder.reversed": True},
        ),
        # stated as reversed, and it is not
        (
            ("left forward", "left", -1),
            ("right forward", "right", 1),
            {"left": "true"},
            ["left encoder"],
            {"left.encoder.reversed": False},
        ),
        # both plugs swapped: pins of both channels change sides
        (
            ("left forward", "right", 1),
            ("right forward", "left", 1),
            {},
            ["encoders swapped"],
            {
                "left.encoder.pin": "3",
                "left.encoder.pin_b": "23",
                "right.encoder.pin": "2",
                "right.encoder.pin_b": "22",
            },
        ),
    ],
)
def test_the_direction_of_two_channels(left, right, stated, mended, written):
    assert two_channels(left, right, stated) == (mended, written)
