"""`calibrate encoders`: wiring, directions, slots and bounce of motors and encoders.

The pulses are short and go to one motor at a time, without a closed loop: a loop whose motor turns
the wrong way only increases the duty. Directions that the pulses prove lift the speed limit of
unproven robots.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any

from diffbotctl.calibrate import encoder_fit
from diffbotctl.calibrate.contradiction import ATTEMPTS_MAX, pulse_contradiction, turn_contradiction
from diffbotctl.calibrate.result import Finding, PartResult
from diffbotctl.calibrate.session import NOISE_COUNTS_MIN, RATED_SPEED_RATIO_MAX, RobotSession
from diffbotctl.calibrate.step import Event, Message, Outcome, StepProgress, StepRun, counted
from diffbotctl.calibrate.wiring_detection import (
    OTHER_SIDE,
    MotorPulse,
    WheelMotion,
    detect_wiring,
    wiring_findings,
)
from diffbotctl.config.robot import SIDES, Robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.messages import Duty
from diffbotctl.prompts.question import (
    ExpectedQuestion,
    ManualAction,
    MarkFloor,
    MotionNotice,
    Question,
    motion_consent,
)

PULSE_TIME_S = 0.4  # the board detects a stall after 0.5 s without edges above 0.3 of duty
WEAK_DUTY, STRONG_DUTY = 0.45, 0.8  # three times a usual dead band; enough for a stiff gear
ROLL_LISTEN_TIME_S = 0.5  # until the last edge is reported
TURNS_PER_ROLL = 10  # an error of 5 degrees at the end is 0.14 %
PULSE_TEXT = "Which wheel turned, and in which direction?"
PROOF_TEXT = "Which wheels turned, and in which direction?"
ROLLS_PER_WHEEL = 3  # so that a miscounted one is detected


@dataclass(frozen=True, slots=True)
class EncoderStep:
    """The step: for each wheel, `rolls` of `turns` turns by hand; 0: do not count the slots."""

    turns: int = TURNS_PER_ROLL
    rolls: int = ROLLS_PER_WHEEL
    name: str = "encoders"
    title: str = "wiring, directions and slots of motors and encoders"
    lifted: bool = True

    def questions(self, robot: Robot) -> Sequence[ExpectedQuestion]:
        """What each pulse turned, and the turns by hand."""
        questions = [
            ExpectedQuestion(motion_consent(self.name)),
            ExpectedQuestion(_motion_question("encoders.wheel", PULSE_TEXT), len(SIDES)),
            ExpectedQuestion(_motion_question("encoders.proof", PROOF_TEXT)),
        ]
        turns = [ExpectedQuestion(self._turns_by_hand(side)) for side in SIDES if self.rolls]
        return [*questions, *turns]

    def run(self, session: RobotSession) -> StepRun:
        """Pulse the motors, detect the wiring, prove the directions, then have wheels turned."""
        session.connect()
        noise = dict(zip(SIDES, session.standstill_counts, strict=True))
        yield _motion_notice(session, "first the left, then the right motor")
        noisy = {side for side, count in noise.items() if count >= NOISE_COUNTS_MIN}
        pulses: dict[str, MotorPulse] = {}
        for output in SIDES:
            before = pulses.get(SIDES[0])
            pulses[output] = yield from _pulse(session, output, noisy, before)
        wiring = detect_wiring(pulses, noise)
        for correction in wiring.corrections:
            yield Message(
                f"Found: {correction}. The robot file corrects this; leave the wires as they are."
            )
        if session.is_noisy:
            # The board takes settings only at standstill, which it cannot detect now.
            slots = yield from self._count_slots(session, wiring.input)
            report = [*wiring.corrections, *slots.report]
            return Outcome("encoders", [], report, [*wiring.faults, *slots.faults])
        findings = wiring_findings(wiring, session.file.robot)
        if findings:
            session.try_findings(findings)
        if wiring.is_complete:
            findings += yield from _prove_directions(session)
        # Glitch time and open share are those of one channel.
        has_one_channel = session.file.robot.drive.left.encoder.channels == 1
        can_capture = has_one_channel and session.capture_edges(True) is not None
        # With the findings applied, each encoder counts at the input of its own side.
        inputs = {side: side if socket else None for side, socket in wiring.input.items()}
        parts = [(yield from self._count_slots(session, inputs))]
        edges = session.capture_edges(False) or [] if can_capture else []
        if self.rolls:
            robot = session.file.robot
            if can_capture:
                parts.append(encoder_fit.measure_glitch(edges, robot))
            if not wiring.faults and not parts[0].faults:  # with a fault, this step is repeated
                parts.append(encoder_fit.measure_slot_duty(edges, robot))
        report = [*wiring.corrections]
        if not wiring.corrections and not wiring.faults:
            report.append("wiring, directions and encoders match the robot file")
        faults = [*wiring.faults]
        for part in parts:
            findings += part.findings
            faults += part.faults
            report += part.report
        return Outcome("encoders", findings, report, faults)

    def _count_slots(
        self, session: RobotSession, inputs: Mapping[str, str | None]
    ) -> Generator[Event, Any, PartResult]:
        """Have each wheel with a working encoder turned by hand, and count at its input."""
        rolls: dict[str, list[int]] = {}
        for side in SIDES:
            encoder = inputs[side]
            if encoder is None or not self.rolls:
                continue
            rolls[side] = []
            for number in range(self.rolls):
                yield StepProgress(f"{side} wheel, by hand", number, self.rolls)
                rolls[side].append((yield from self._roll(session, side, encoder, number)))
        return encoder_fit.count_slots(rolls, self.turns, session.file.robot)

    def _roll(
        self, session: RobotSession, side: str, encoder: str, number: int
    ) -> Generator[Event, Any, int]:
        """Counts at an input while a wheel is turned by hand."""
        other = OTHER_SIDE[encoder]
        for _ in range(ATTEMPTS_MAX):
            before = _counts(session)
            action = self._turns_by_hand(side)
            yield action._replace(text=counted(number, self.rolls, action.text))
            session.listen(ROLL_LISTEN_TIME_S)
            after = _counts(session)
            counts = {socket: abs(after[socket] - before[socket]) for socket in SIDES}
            reason = turn_contradiction(side, counts[encoder], counts[other])
            if reason is None or session.is_noisy:
                break
            yield Message(f"{reason} Was the other wheel turned? Turn the {side} one again.")
        return counts[encoder]

    def _turns_by_hand(self, side: str) -> ManualAction:
        turns = "one turn" if self.turns == 1 else f"{self.turns} turns"
        text = (
            f"Turn the {side} wheel forward by hand, exactly {turns}, at most one turn per second. "
            "A mark on the tyre helps."
        )
        return ManualAction(f"encoders.{side}_turns", text, (side, float(self.turns)))


def _motion_notice(session: RobotSession, motors: str) -> MotionNotice:
    drive = session.file.robot.drive
    rated = max(drive.left.motor.rated, drive.right.motor.rated)
    # The most by which the pulses of one notice can turn a wheel.
    turns = (WEAK_DUTY + STRONG_DUTY) * RATED_SPEED_RATIO_MAX * rated * PULSE_TIME_S / (2 * pi)
    text = (
        "The wheels must be off the ground. Each motor gets short pulses, "
        f"{motors}: at most {turns:.1f} turns of each wheel."
    )
    # The pulses are short enough to need no limit; the counts are still unknown.
    return MotionNotice("encoders", text, turns, watched=False)


def _pulse(
    session: RobotSession, output: str, noisy: set[str], before: MotorPulse | None
) -> Generator[Event, Any, MotorPulse]:
    """Pulse one motor; with a stronger pulse if nothing moved.

    An answer that the counts contradict is asked again after the same pulse. `before`: the pulse of
    the other motor.
    """
    duties = [WEAK_DUTY, STRONG_DUTY]
    answers: list[WheelMotion] = []
    while True:
        duty = duties[0]
        text = f"Look at both wheels. The {output} motor is driven now."
        yield MarkFloor(text, f"it turns for {PULSE_TIME_S:g} s", is_placed=False)
        left, right = (duty, 0.0) if output == "left" else (0.0, duty)
        signed = _drive_pulse(session, Duty(0, left, right))
        counts = {side: abs(count) for side, count in signed.items()}
        seen = yield from _ask_motion(
            "encoders.wheel",
            PULSE_TEXT,
            is_repeated=bool(answers),
        )
        reason = pulse_contradiction(seen, counts, noisy, before)
        if reason is not None and seen not in answers and len(answers) < ATTEMPTS_MAX - 1:
            answers.append(seen)
            yield Message(f"{reason} Look again; the same answer is accepted.")
            continue
        answers.clear()
        duties.pop(0)
        if seen is not WheelMotion.NONE or not duties:
            return MotorPulse(output, seen, counts, _directions(session, signed))


def _drive_pulse(session: RobotSession, duty: Duty) -> dict[str, int]:
    """Apply a pulse. Returns the signed counts of both inputs."""
    before = _counts(session)
    session.run_for(duty, PULSE_TIME_S)
    session.stop_and_wait()
    return {side: count - before[side] for side, count in _counts(session).items()}


def _directions(session: RobotSession, signed: Mapping[str, int]) -> dict[str, int]:
    """The direction that each input with two channels counted."""
    drive = session.file.robot.drive
    if drive.left.encoder.channels != 2:
        return {}
    return {side: 1 if count > 0 else -1 for side, count in signed.items() if count}


def _prove_directions(session: RobotSession) -> Generator[Event, Any, list[Finding]]:
    """Drive both motors forward with the findings applied; only a person can see the result."""
    session.connect()
    yield _motion_notice(session, "both at once and forward")
    answers: list[WheelMotion] = []
    while True:
        text = "Look at both wheels. Both motors are driven forward now."
        yield MarkFloor(text, f"they turn for {PULSE_TIME_S:g} s", is_placed=False)
        signed = _drive_pulse(session, Duty(0, WEAK_DUTY, WEAK_DUTY))
        counts = {side: abs(count) for side, count in signed.items()}
        seen = yield from _ask_motion(
            "encoders.proof",
            PROOF_TEXT,
            is_repeated=bool(answers),
        )
        reason = pulse_contradiction(seen, counts, set(), None)
        if reason is None or seen in answers or len(answers) >= ATTEMPTS_MAX - 1:
            break
        answers.append(seen)
        yield Message(f"{reason} Look again; the same answer is accepted.")
    if seen is WheelMotion.BOTH_FORWARD:
        return [Finding("drive.polarity", "calibrated")]
    cause = f"both motors were driven forward, but the answer was: {seen}"
    fix = "was the left wheel mistaken for the right, or forward for backward? Run this step again"
    raise RunError(Problem("E-CALIBRATE-ROBOT", "encoders", cause, fix))


def _ask_motion(name: str, text: str, is_repeated: bool) -> Generator[Event, Any, WheelMotion]:
    return WheelMotion((yield replace(_motion_question(name, text), is_repeated=is_repeated)))


def _motion_question(name: str, text: str) -> Question:
    choices = tuple(motion.value for motion in WheelMotion)
    return Question(name, text, choices=choices, quantity="wheel")


def _counts(session: RobotSession) -> dict[str, int]:
    frame = session.latest_frame()
    return {"left": frame.left, "right": frame.right}
