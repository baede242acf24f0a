"""What to write instead of a word too many: a unit apart, a goal without quotes, a robot."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import click

from diffbotctl.config.lookup import is_known, is_path

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
