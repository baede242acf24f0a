"""Robots with faults planted in them, and the calibration chain run on each."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, pi
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.calibrate.session import RobotSession
from diffbotctl.calibrate.simulated_session import SimulatedTools
from diffbotctl.calibrate.step import Outcome
from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import SIDES
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.prompts.question import ManualAction, MarkFloor, MotionNotice

ANSWERS = """\
encoders: {measure: eye}
distance.reading: {measure: tape, noise: 1 mm}
geometry: {measure: tape, noise: 2 mm}
"""
TRUTH = "geometry: {track_spread: 0.03, diameter_spread: 0.005}"
STATED_REVERSED = {"left": True, "right": False}  # by robots/book_2wd.yaml
DISCS = (16, 24, 30)


class Wiring(NamedTuple):
    """How a robot was soldered together, and what a calibration must say of it."""

    left: str = "reversed"  # as robots/book_2wd.yaml has it
    right: str = "plain"
    encoders: str = "plain"
    left_encoder: str = "plain"
    right_encoder: str = "plain"
    slots: int = 20

    def text(self, robot: str = "book_2wd") -> str:
        """The robot file, on top of the shipped `robot`."""
        wiring = ", ".join(
            f"{name}: {value}" for name, value in self._asdict().items() if name != "slots"
        )
        return (
            f"format: 1\nkind: robot\ninclude: {robot}\n"
            f"simulation: {{{TRUTH}, wiring: {{{wiring}}}, encoder: {{slots: {self.slots}}}}}\n"
            "calibration: {}\n"
        )

    def faults(self) -> set[str]:
        """The faults by the words with which they must be named."""
        motors = {"left": self.left, "right": self.right}
        cells = {"left": self.left_encoder, "right": self.right_encoder}
        crossed = self.left == "swapped"
        found = {
            f"{side} encoder {cells[side]}"
            for side in SIDES
            if cells[side] != "plain" and motors[side] != "dead"
        }
        if crossed:
            found.add("motors swapped")
        # A plug that leads nowhere cannot be seen to be in the wrong place.
        if self.encoders == "swapped" and any(
            cells[side] == "plain" and motors[side] != "dead" for side in SIDES
        ):
            found.add("encoders swapped")
        for side in SIDES:
            if motors[side] == "dead":
                found.add(f"{side} motor dead")
                continue
            channel = ("right" if side == "left" else "left") if crossed else side
            if STATED_REVERSED[channel] != (motors[side] == "reversed"):
                found.add(f"{side} motor reversed")
        if self.slots != 20 and any(
            cells[side] == "plain" and motors[side] != "dead" for side in SIDES
        ):
            found.add(f"{self.slots} slots instead of 20")
        return found

    def repaired(self) -> Wiring:
        """With what only a hand can mend mended."""
        left, right = ("plain" if fault == "dead" else fault for fault in (self.left, self.right))
        return self._replace(left=left, right=right, left_encoder="plain", right_encoder="plain")


def drawn(rng: Random) -> Wiring:
    """Faults at random: each robot has some, a third of them one that only a hand can mend."""
    crossed = rng.random() < 0.35
    motors = (
        ["swapped", "swapped"] if crossed else [rng.choice(["plain", "reversed"]) for _ in SIDES]
    )
    made = Wiring(
        left=motors[0],
        right=motors[1],
        encoders="swapped" if rng.random() < 0.35 else "plain",
        slots=rng.choice(DISCS) if rng.random() < 0.25 else 20,
    )
    luck = rng.random()
    side = rng.choice(SIDES)
    if luck < 0.12 and not crossed:
        return made._replace(left="dead") if side == "left" else made._replace(right="dead")
    if luck < 0.36:
        fault = "dead" if luck < 0.24 else "floating"
        if side == "left":
            return made._replace(left_encoder=fault)
        return made._replace(right_encoder=fault)
    return made


class SilentScreen:
    """A screen that shows nothing."""

    def say(self, text: str) -> None: ...
    def progress(self, progress: Any) -> None: ...
    def draw(self, drawing: Any) -> None: ...


class Watched(AnswersFile):
    """An answers file that holds the robot to what was announced, by its truth."""

    def __init__(self, path: Path, truths: SimulatedTools, made: RobotSession) -> None:
        super().__init__(path, truths)
        self.truths = truths
        self.worst = 0.0
        """most of an announced bound that was used"""
        self._announced: MotionNotice | None = None
        self._from = truths.truth
        note = made.on_frame

        def look(now: int, frame: Any) -> None:
            note(now, frame)
            self._look()

        made.on_frame = look  # type: ignore[method-assign]

    def confirm_motion(self, notice: MotionNotice) -> None:
        """The bound holds from here."""
        super().confirm_motion(notice)
        self._announced, self._from = notice, self.truths.truth

    def act(self, action: ManualAction) -> None:
        """What a hand turns was not announced."""
        self._announced = None
        super().act(action)

    def mark_floor(self, mark: MarkFloor) -> None:
        """Whoever marks the start has put the robot back to it."""
        super().mark_floor(mark)
        if self._announced is not None and self._announced.reach is not None:
            self._from = self.truths.truth

    def _look(self) -> None:
        bound = self._announced
        if bound is None:
            return
        begun, now = self._from, self.truths.truth
        if bound.turns is not None:
            turned = max(
                abs(now.left_angle - begun.left_angle), abs(now.right_angle - begun.right_angle)
            ) / (2 * pi)
            self.worst = max(self.worst, turned / bound.turns)
        if bound.reach is not None:
            gone = hypot(now.pose.x - begun.pose.x, now.pose.y - begun.pose.y)
            self.worst = max(self.worst, gone / bound.reach)


class Chained(NamedTuple):
    """A robot after the chain."""

    session: RobotSession
    truths: SimulatedTools
    outcomes: dict[str, Outcome]
    prompter: Watched

    @property
    def worst(self) -> float:
        """Most of an announced bound that was used."""
        return self.prompter.worst

    def named(self) -> list[str]:
        """All errors that the encoders step reported."""
        outcome = self.outcomes["encoders"]
        return [*outcome.report, *outcome.faults]

    def run(self, name: str) -> None:
        """Run one more step."""
        self.outcomes[name] = run_step(make_step(name), self.session, self.prompter, SilentScreen())
        self.session.recording.clear()


def chained(
    wiring: Wiring,
    seed: int,
    folder: Path,
    names: Sequence[str],
    port: str = "sim",
    robot: str = "book_2wd",
) -> Chained:
    """Run the steps called `names` on a robot drawn by `seed`."""
    file, answers = folder / f"robot_{seed}.yaml", folder / "answers.yaml"
    file.write_text(wiring.text(robot))
    answers.write_text(ANSWERS)
    made, truths = open_session(load_robot(str(file)), port, seed)
    assert truths is not None
    prompter = Watched(answers, truths, made)
    found = Chained(made, truths, {}, prompter)
    for name in names:
        found.run(name)
    return found
