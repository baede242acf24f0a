"""`calibrate encoders`: which wire is which, which way is forward, how many slots, how much bounce.

Pulses are short and go to one motor at a time, without any closed loop: a loop whose motor turns
the wrong way only pushes harder. What the pulses prove lifts the speed cap of unproven robots.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

from diffbotctl.calibrate import encoder_fit, wiring_detection
from diffbotctl.calibrate.result import Finding, PartResult
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.step import (
    Event,
    ManualAction,
    MarkFloor,
    Message,
    MotionNotice,
    Outcome,
    Running,
    StepProgress,
)
from diffbotctl.config.robot import SIDES
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Duty
from diffbotctl.prompts.question import Question

# The board takes a wheel without edges for stalled after 0.5 s above 0.3 of duty.
PULSE_TIME_S = 0.4  # s
GENTLE_DUTY, STRONG_DUTY = 0.45, 0.8  # duty: three times a usual dead band; what a stiff gear needs
RATED_SPEED_RATIO_MAX = 1.6  # times the rated speed: what the robot file may understate it by
LISTEN_TIME_S = 0.5  # s after a pulse, until the last edge has been told
MOTION_CHOICES = (
    "none",
    "left forward",
    "left backward",
    "right forward",
    "right backward",
    "both forward",
    "both backward",
    "opposite ways",
)
TURNS_PER_ROLL = 10  # by hand; a miss of 5 degrees at the end is a seventh of a per cent
ROLLS_PER_WHEEL = 3  # repeats, so that one that was miscounted shows


@dataclass(frozen=True, slots=True)
class EncoderStep:
    """The step. `rolls` of `turns` turns by hand for each wheel; 0: the slots are not counted."""

    turns: int = TURNS_PER_ROLL
    rolls: int = ROLLS_PER_WHEEL
    name: str = "encoders"
    title: str = "which wire is which, which way is forward, how many slots"
    lifted: bool = True

    def run(self, rig: RobotSession) -> Running:
        """Pulses, what they show, a proof of it, then turns by hand."""
        rig.meet()
        resting = dict(zip(SIDES, rig.still, strict=True))
        yield _motion_notice(rig, "first the left, then the right motor")
        pulses = {}
        for channel in SIDES:
            pulses[channel] = yield from _pulse(rig, channel)
        found = wiring_detection.detect_wiring(pulses, resting)
        for fault in found.mended:
            yield Message(f"found: {fault}. Settings make up for it, the wires may stay.")
        if rig.noisy:
            # The board takes settings only at rest, which it cannot see now.
            counted = yield from self._slots(rig, found.socket)
            report = [*found.mended, *counted.report]
            return Outcome("encoders", [], report, [*found.faults, *counted.faults])
        findings = wiring_detection.wiring_findings(found, rig.file.robot)
        if findings:
            rig.attempt(findings)
        if found.proven:
            findings += yield from _prove_directions(rig)
        gathers = rig.capture(True) is not None
        # From here on the board hears each wheel as its own side.
        heard = {side: socket and side for side, socket in found.socket.items()}
        counted = yield from self._slots(rig, heard)
        flanks = rig.capture(False) or [] if gathers else []
        findings += counted.findings
        faults = [*found.faults, *counted.faults]
        report = [*found.mended, *_wiring_report(found), *counted.report]
        if self.rolls:
            robot = rig.file.robot
            told = [encoder_fit.measure_glitch(flanks, robot)] if gathers else []
            if not faults:  # with one, this step is run again when it is mended
                told.append(encoder_fit.measure_slot_duty(flanks, robot))
            for each in told:
                findings += each.findings
                faults += each.faults
                report += each.report
        return Outcome("encoders", findings, report, faults)

    def _slots(
        self, rig: RobotSession, sockets: Mapping[str, str | None]
    ) -> Generator[Event, Any, PartResult]:
        """Turn by hand each wheel whose encoder answers, at the socket where it does."""
        rolls: dict[str, list[int]] = {}
        for side in SIDES:
            socket = sockets[side]
            if socket is None or not self.rolls:
                continue
            rolls[side] = []
            for number in range(self.rolls):
                yield StepProgress(f"{side} wheel by hand", number, self.rolls)
                rolls[side].append((yield from self._roll(rig, side, socket)))
        return encoder_fit.count_slots(rolls, self.turns, rig.file.robot)

    def _roll(self, rig: RobotSession, side: str, socket: str) -> Generator[Event, Any, int]:
        """Counts at a socket while a wheel is turned by hand."""
        before = _counts(rig)
        turns = "one turn" if self.turns == 1 else f"{self.turns} turns"
        text = (
            f"Turn the {side} wheel by hand, forward, through exactly {turns}, "
            "no faster than a turn a second; a mark on the tyre helps."
        )
        yield ManualAction(f"encoders.{side}_turns", text, (side, float(self.turns)))
        rig.listen(LISTEN_TIME_S)
        return abs(_counts(rig)[socket] - before[socket])


def _motion_notice(rig: RobotSession, which: str) -> MotionNotice:
    most = _turns_max(rig)
    text = (
        "The wheels must be off the ground. Each motor gets short pulses, "
        f"{which}: no wheel turns more than {most:.1f} turns."
    )
    # The pulses are short enough by themselves; the counts are what is to be found out.
    return MotionNotice(text, most, watched=False)


def _turns_max(rig: RobotSession) -> float:
    """What the pulses of one announcement can turn a wheel by, at worst."""
    drive = rig.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    return (GENTLE_DUTY + STRONG_DUTY) * RATED_SPEED_RATIO_MAX * rated * PULSE_TIME_S / (2 * pi)


def _pulse(rig: RobotSession, channel: str) -> Generator[Event, Any, wiring_detection.MotorPulse]:
    """Push one motor; more strongly when nothing has moved."""
    seen, counts = "none", dict.fromkeys(SIDES, 0)
    for duty in (GENTLE_DUTY, STRONG_DUTY):
        yield MarkFloor(f"Look at both wheels: the {channel} motor's pins are driven now.")
        before = _counts(rig)
        rig.hold(_single_motor(channel, duty), PULSE_TIME_S)
        rig.rest()
        counts = {side: abs(now - before[side]) for side, now in _counts(rig).items()}
        seen = yield _motion_question("encoders.wheel", "Which wheel turned, and which way?")
        if seen != "none":
            break
    return wiring_detection.MotorPulse(channel, seen, counts)


def _prove_directions(rig: RobotSession) -> Generator[Event, Any, list[Finding]]:
    """Both motors forward with what was found: only the eye can tell that it is true."""
    rig.meet()
    yield _motion_notice(rig, "both at once and forward")
    yield MarkFloor("Look at both wheels: both motors are driven forward now.")
    rig.hold(Duty(0, GENTLE_DUTY, GENTLE_DUTY), PULSE_TIME_S)
    rig.rest()
    seen = yield _motion_question("encoders.proof", "Which wheels turned, and which way?")
    if seen == "both forward":
        return [Finding("drive.polarity", "calibrated")]
    cause = f"both motors were driven forward, and what turned was: {seen}"
    fix = "was a wheel taken for the other, or its front for its back? Run this step again"
    raise RunError(Problem("E-CALIBRATE-ROBOT", "encoders", cause, fix))


def _motion_question(name: str, text: str) -> Question:
    return Question(name, text, choices=MOTION_CHOICES, quantity="wheel")


def _single_motor(channel: str, duty: float) -> Duty:
    return Duty(0, duty, 0.0) if channel == "left" else Duty(0, 0.0, duty)


def _counts(rig: RobotSession) -> dict[str, int]:
    last = rig.latest()
    return {"left": last.left, "right": last.right}


def _wiring_report(found: wiring_detection.DetectedWiring) -> list[str]:
    if found.mended or found.faults:
        return []
    return ["wires, directions and encoders are as the robot file states"]
