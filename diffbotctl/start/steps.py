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
        "a robot like the book's, with its motors, encoders and wall, drives to a goal",
        "diffbotctl works here: a simulated robot reached its goal",
    ),
    Chapter(
        ChapterKey.ROBOT,
        "Your robot's file",
        "a file of your own says what is wired where; every command reads it",
        "{robot} describes your robot, and has no mistake that shows without it",
    ),
    Chapter(
        ChapterKey.BOARD,
        "The board",
        "the Mega 2560 is looked for on the USB ports",
        "the board is on {port}",
    ),
    Chapter(
        ChapterKey.FIRMWARE,
        "The firmware",
        "the firmware is written onto the board, unless it is there already; about 5 s",
        "the board runs our firmware and has the settings of {robot}",
    ),
    Chapter(
        ChapterKey.WHEELS,
        "Which wheel is which",
        "each motor gets short pulses, the wheels lifted, and you say what turned",
        "motors and encoders are what {robot} says, and both wheels turn the right way",
    ),
    Chapter(
        ChapterKey.MEASURE,
        "What motors and wheels really are",
        "the motors by themselves (2 minutes), the wheels with a tape (half an hour); it may wait",
        "`diffbotctl calibrate show` lists what was measured, and what was not",
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
        "the robot drives to a place 1 m ahead and 0.5 m to its left, and stops at walls",
        "the robot reached a goal",
    ),
)


def headline(key: ChapterKey) -> str:
    """The headline of a chapter, such as `3 of 8  The board`."""
    number = next(n for n, chapter in enumerate(CHAPTERS, 1) if chapter.key is key)
    return f"{number} of {len(CHAPTERS)}  {CHAPTERS[number - 1].title}"


LIFTED = Question(
    "lifted",
    "Are the wheels in the air, so that they can turn without moving the robot?",
    choices=("yes", "no"),
)
MEASURE = Question(
    "measure",
    "Measure now: all, which needs a tape and half an hour; the motors alone, which needs two "
    "minutes and nothing; or later?",
    choices=("all", "motors", "later"),
)
FLOOR = Question(
    "floor",
    "Does it stand on the floor, with 1.5 m free ahead and 1 m to its left, and can you reach it?",
    choices=("yes", "no"),
)
QUESTIONS = (LIFTED, MEASURE, FLOOR)


def read_answers(path: Path) -> AnswersFile:
    """The answers to QUESTIONS and to those of the calibration.

    Raises UsageError for an unusable file, or one with a name that is not a question.
    """
    answers = AnswersFile(path, code=ANSWER_CODE, error=UsageError)
    names = [question.name for question in QUESTIONS]
    for name in answers.answers:
        if name not in names and name.partition(".")[0] not in STEPS:
            near = closest_match(name, names) or join_words(names, "or")
            cause, fix = f"'{name}' is never asked", f"did you mean {near}?"
            raise UsageError(Problem(ANSWER_CODE, str(path), cause, fix))
    return answers
