"""The chapters of the guided setup, the questions that it asks, and the file that answers them."""

from __future__ import annotations

from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from diffbotctl.calibrate.runner import STEPS
from diffbotctl.cli.new import kits
from diffbotctl.config.composed_robot import NONE, PART_KINDS, USUAL_SLOTS
from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.prompts.question import Answer, AnswerError, Question

ANSWER_CODE = "E-START-ANSWER"


class ChapterKey(StrEnum):
    """A chapter, as the progress file names it."""

    SIMULATED = "simulated"
    ROBOT = "robot"
    BOARD = "board"
    FIRMWARE = "firmware"
    WHEELS = "wheels"
    MEASURE = "measure"
    METRE = "metre"
    GOAL = "goal"


class Chapter(NamedTuple):
    """One chapter, and its texts."""

    key: ChapterKey
    title: str
    ahead: str
    """what will happen"""
    truth: str
    """what is true once it is done"""


CHAPTERS = (
    Chapter(
        ChapterKey.SIMULATED,
        "A simulated robot",
        "a simulated robot, like the one of the book, drives to a goal",
        "diffbotctl works: a simulated robot reached its goal",
    ),
    Chapter(
        ChapterKey.ROBOT,
        "Your robot file",
        "you name the robot's parts; its file states how they are wired, for every command",
        "{robot} describes your robot, and its checks pass",
    ),
    Chapter(
        ChapterKey.BOARD,
        "The board",
        "the board is searched on the USB ports",
        "the board is on {port}",
    ),
    Chapter(
        ChapterKey.FIRMWARE,
        "The firmware",
        "the firmware is flashed, unless the board has it already; about 5 s",
        "the board runs the diffbotctl firmware with the settings of {robot}",
    ),
    Chapter(
        ChapterKey.WHEELS,
        "Wheels and encoders",
        "each motor gets short pulses with the wheels off the ground; you report what turned",
        "the wiring matches {robot}, and both wheels turn in the right direction",
    ),
    Chapter(
        ChapterKey.MEASURE,
        "Calibration of motors and wheels",
        "motors (2 minutes), wheels with a tape (half an hour); you can do this later",
        "`diffbotctl calibrate show` lists what is calibrated and what is not",
    ),
    Chapter(
        ChapterKey.METRE,
        "The first metre",
        "the robot drives one metre straight ahead on the floor",
        "the robot drove its first metre",
    ),
    Chapter(
        ChapterKey.GOAL,
        "The first goal",
        "the robot drives to a point 1 m ahead and 0.5 m to the left, and stops at walls",
        "the robot reached a goal",
    ),
)


def headline(key: ChapterKey) -> str:
    """The headline of a chapter, such as `3 of 8  The board`."""
    number = next(n for n, chapter in enumerate(CHAPTERS, 1) if chapter.key is key)
    return f"{number} of {len(CHAPTERS)}  {CHAPTERS[number - 1].title}"


LIFTED = Question(
    "lifted",
    "Are the wheels off the ground?",
    choices=("yes", "no"),
)
MEASURE = Question(
    "measure",
    "Calibrate now: all (half an hour, with a tape), only the motors (2 minutes), or later?",
    choices=("all", "motors", "later"),
)
METRE = Question(
    "metre",
    "The robot drives 1 m straight ahead. Is it on the floor within your reach, with 1.5 m free "
    "ahead of it and 0.5 m on either side?",
    choices=("yes", "no"),
    is_consent=True,
)
GOAL = Question(
    "goal",
    "The robot drives to a point 1 m ahead and 0.5 m to the left, and turns left there. Is it back "
    "at its start, with 1.5 m free ahead of it, 1 m to the left and 0.5 m to the right?",
    choices=("yes", "no"),
    is_consent=True,
)
OTHER_PARTS = "other"
KIT = Question(
    "kit",
    f"Is your robot wired as one of these kits? If not, answer {OTHER_PARTS} and name its parts.",
    choices=(*kits(), OTHER_PARTS),
)


class PartQuestion(Question):
    """A question for a part; its name is one of PART_KINDS."""

    def parse(self, answer: object) -> Answer:
        """The part's name. Raises AnswerError with what comes nearest."""
        if not str(answer or "").strip():
            return super().parse(answer)
        with suppress(AnswerError):
            if self.name != "driver":  # the beginning of a chip's name is that of others
                return super().parse(answer)
        try:
            return PART_KINDS[self.name].check(str(answer))
        except UsageError as error:
            problem = error.problems[0]
            raise AnswerError(f"{problem.cause}; {problem.fix}") from None


def part_question(name: str, text: str, default: str | None = None) -> PartQuestion:
    """The question for the part called `name`; `default`: the answer for an empty line."""
    return PartQuestion(name, text, choices=PART_KINDS[name].names, default=default)


def board_question(found: str | None) -> PartQuestion:
    """Which board it is; `found`: the type of the one that is connected."""
    return part_question("board", "Which board?", found)


def slots_question(encoders: str) -> Question:
    """How many slots the encoders of a kind have."""
    return Question(
        "slots",
        "How many slots, or pulses of channel A, has a turn of the wheel? "
        "`diffbotctl calibrate encoders` counts them later.",
        unit="1",
        minimum=1,
        default=float(USUAL_SLOTS[encoders]),
        is_whole=True,
    )


DRIVER = part_question("driver", "Which motor driver? Its name is printed on the chip or board.")
ENCODERS = part_question(
    "encoders",
    "Which encoders? A slotted disc has one channel, a Hall encoder with A and B has two.",
)
SENSOR = part_question("sensor", "Which distance sensor is in front?", NONE)
IMU = part_question("imu", "Which IMU?", NONE)
RADIO = part_question("radio", "Does it drive over its USB cable, or an HC-05?", "cable")
QUESTIONS = (
    *(LIFTED, MEASURE, METRE, GOAL, KIT),
    *(board_question(None), DRIVER, ENCODERS, slots_question("one-channel"), SENSOR, IMU, RADIO),
)


def read_answers(path: Path) -> AnswersFile:
    """The answers to QUESTIONS and to those of the calibration.

    Raises UsageError for an unusable file, or one with a name that is not a question.
    """
    answers = AnswersFile(path, code=ANSWER_CODE, error=UsageError)
    names = [question.name for question in QUESTIONS]
    for name in answers.answers:
        if name not in names and name.partition(".")[0] not in STEPS:
            near = closest_match(name, names) or join_words(names, "or")
            cause, fix = f"there is no question '{name}'", f"did you mean {near}?"
            raise UsageError(Problem(ANSWER_CODE, str(path), cause, fix))
    return answers
