"""The chapters of the guided setup, the questions that it asks, and the file that answers them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from diffbotctl.calibrate.runner import STEPS
from diffbotctl.errors import Problem, UsageError, closest_match, join_words
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.prompts.question import Question

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
        "your robot file states how the robot is wired; every command reads it",
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
QUESTIONS = (LIFTED, MEASURE, METRE, GOAL)


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
