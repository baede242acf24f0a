"""The chapters of the path, and what is true after each; record.py keeps which are done."""

from __future__ import annotations

from typing import NamedTuple


class Chapter(NamedTuple):
    """One chapter: its key in the record, and what a person reads of it."""

    key: str
    title: str
    ahead: str
    """what will happen, before it does"""
    truth: str
    """what is true once it is done"""


CHAPTERS = (
    Chapter(
        "simulated",
        "A simulated robot",
        "a robot like the book's, with its motors, encoders and wall, drives to a goal",
        "diffbotctl works here: a simulated robot reached its goal",
    ),
    Chapter(
        "robot",
        "Your robot's file",
        "a file of your own says what is wired where; every command reads it",
        "{robot} describes your robot, and has no mistake that shows without it",
    ),
    Chapter(
        "board",
        "The board",
        "the Mega 2560 is looked for on the USB ports",
        "the board is on {port}",
    ),
    Chapter(
        "firmware",
        "The firmware",
        "the firmware is written onto the board, unless it is there already; about 5 s",
        "the board runs our firmware and has the settings of {robot}",
    ),
    Chapter(
        "wheels",
        "Which wheel is which",
        "each motor gets short pulses, the wheels lifted, and you say what turned",
        "motors and encoders are what {robot} says, and both wheels turn the right way",
    ),
    Chapter(
        "measure",
        "What motors and wheels really are",
        "the motors by themselves (2 minutes), the wheels with a tape (half an hour); it may wait",
        "`diffbotctl calibrate show` lists what was measured, and what was not",
    ),
    Chapter(
        "metre",
        "The first metre",
        "the robot drives one metre straight ahead on the floor",
        "the robot drove its first metre",
    ),
    Chapter(
        "goal",
        "The first goal",
        "the robot drives to a place 1 m ahead and 0.5 m to its left, and stops at walls",
        "the robot reached a goal",
    ),
)


def headline(key: str) -> str:
    """A chapter's headline, such as `3 of 7  The board`."""
    number = next(n for n, chapter in enumerate(CHAPTERS, 1) if chapter.key == key)
    return f"{number} of {len(CHAPTERS)}  {CHAPTERS[number - 1].title}"
