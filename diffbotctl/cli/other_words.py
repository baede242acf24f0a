"""What to type instead: for commands of ROS, a word too many, a unit apart, a goal without quotes.

The rows of ROS are in ros_words.yaml: `ros2 topic echo` is looked up as `rostopic echo`. The
longest row that the typed words begin with is the answer.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import click
import yaml

from diffbotctl.config.lookup import is_known, is_path
from diffbotctl.errors import Problem, UsageError


class RosAnswer(NamedTuple):
    """What to type here, without `diffbotctl`, and what is different; the latter may be empty."""

    command: str
    note: str = ""


# Endings of programs that are left away, as of `serial_node.py` and `rviz2`.
ENDINGS = (".py", ".launch", ".xml", "2")
PROGRAM_STARTERS = ("rosrun", "roslaunch")  # package and program follow
# Options of the commands of ROS that are followed by a value.
WITH_VALUE = ("-b", "-c", "-d", "-n", "-O", "-o", "-p", "-r", "-s", "-w", "--rate", "--times")


@cache
def ros_answers() -> dict[str, RosAnswer]:
    """The answers, by the words of ROS."""
    text = Path(__file__).with_name("ros_words.yaml").read_text(encoding="utf-8")
    return {words: RosAnswer(**row) for words, row in yaml.safe_load(text).items()}


def ros_error(words: list[str]) -> UsageError | None:
    """The error for words that are of ROS, with what to type instead; None for others."""
    found = ros_answer(words)
    if found is None:
        return None
    cause = f"this is a command of ROS{found.note and '; '}{found.note}"
    fix = f"type: diffbotctl {found.command}"
    return UsageError(Problem("E-ROS-WORD", words[0], cause, fix))


def ros_answer(words: list[str]) -> RosAnswer | None:
    """What a ROS user should type instead of `words`; None for words that are not of ROS."""
    words = _without_options(words)
    if words[:1] == ["ros2"]:
        words = _as_ros_1(words[1:])
    if not words:
        return None
    if words[0] in PROGRAM_STARTERS:
        programs = (_known_program(word) for word in reversed(words[1:3]))
        return next(filter(None, programs), ros_answers()[words[0]])
    for length in (2, 1):
        found = ros_answers().get(" ".join(words[:length]))
        if found is not None:
            return found._replace(command=_filled(found.command, words[length:]))
    return ros_answers().get(_program_name(words[0]))


def _as_ros_1(words: list[str]) -> list[str]:
    """The words after `ros2` as ROS 1 has them: `param get /guard margin` names its node apart."""
    if words[:1] == ["param"] and len(words) > 3:
        words = [*words[:2], f"{words[2]}/{words[3]}", *words[4:]]
    return [f"ros{words[0]}", *words[1:]] if words else []


def _known_program(word: str) -> RosAnswer | None:
    """The answer for a program of a package or a launch file; any keyboard teleop is one."""
    name = _program_name(word)
    is_teleop = "teleop" in name and "joy" not in name
    return ros_answers().get(name) or (RosAnswer("teleop") if is_teleop else None)


def _program_name(word: str) -> str:
    """The name of a program without its ending."""
    for ending in () if word in ros_answers() else ENDINGS:
        word = word.removesuffix(ending)
    return word


def _without_options(words: list[str]) -> list[str]:
    kept: list[str] = []
    skips_next = False
    for word in words:
        if skips_next:
            skips_next = False
        elif word.startswith("-") and not word[1:2].isdigit():
            skips_next = word in WITH_VALUE
        else:
            kept.append(word)
    return kept


def _filled(command: str, typed: list[str]) -> str:
    """The command with the words in capitals replaced by what was typed, as far as it goes."""
    rest = iter(typed)
    words: list[str] = []
    for word in command.split():
        if word == "[TOPIC]...":
            words += map(shlex.quote, rest)
        elif word == "PARAMETER":
            words.append(shlex.quote(next(rest, word).strip("/").replace("/", ".")))
        elif word == "TYPE":  # geometry_msgs/msg/Twist is Twist here
            words.append(shlex.quote(next(rest, word).rpartition("/")[2]))
        elif word.isalpha() and word.isupper():
            words.append(shlex.quote(next(rest, word)))
        else:
            words.append(word)
    return " ".join(words)


EXTRA = re.compile(r"unexpected extra arguments? \((.*)\)")
SPEED_HINT = "\nWrite --speed 0.1 to drive, or --turn 45deg/s to turn"
OF_ONE_WORD = ("--goal",)  # options whose value has spaces, and so needs quotes


def explained(error: click.ClickException, arguments: Sequence[str]) -> str:
    """The message of `error` of the command line `arguments`, with what to write instead."""
    from diffbotctl.units import UNITS, is_number

    message = error.format_message()
    if not isinstance(error, click.UsageError):
        return message
    extra = EXTRA.search(message)
    for word, after in pairwise(arguments):
        is_apart = is_number(word) and after in UNITS
        if is_apart and (extra is not None or isinstance(error, click.BadParameter)):
            return f"'{word} {after}' are two words here: write {word}{after}, or use quotes"
    return message + ("" if extra is None else _hint(extra[1].partition(" ")[0], error, arguments))


def _hint(word: str, error: click.UsageError, arguments: Sequence[str]) -> str:
    """A sentence about the first word too many; empty without one."""
    for option in OF_ONE_WORD:
        values = _words_after(option, arguments)
        if len(values) > 1:
            value = " ".join(values)
            return f'\nQuote a value with spaces: {option} "{value}"'
    name = "" if error.ctx is None else error.ctx.command.name
    return SPEED_HINT if name == "drive" else _robot_hint(word, error.ctx)


def _words_after(option: str, arguments: Sequence[str]) -> list[str]:
    if option not in arguments:
        return []
    words = arguments[arguments.index(option) + 1 :]
    end = next((place for place, word in enumerate(words) if word.startswith("--")), len(words))
    return list(words[:end])


def _robot_hint(word: str, context: click.Context | None) -> str:
    """Robots are often typed behind the pipeline."""
    options = [] if context is None else context.command.params
    has_option = any("--robot" in parameter.opts for parameter in options)
    if has_option and not is_path(word) and is_known(word, "robots"):
        return f"\nTo name a robot, write --robot {word}"
    return ""
