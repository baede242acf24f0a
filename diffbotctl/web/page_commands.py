"""What a page may ask: each command is one entry here, and becomes requests of the control socket.

A page has no rights of its own. The engine checks every request again.
"""

from __future__ import annotations

import json
from collections.abc import Container
from typing import Any, NamedTuple

from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.control_socket.requests import TEXT_MAX_LENGTH, finite
from diffbotctl.web.plot_samples import FIELDS_MAX, topic_of

READS = frozenset(
    {
        "list_blocks",
        "list_topics",
        "describe_topic",
        "list_parameters",
        "read_log",
        "explain_stop",
        "list_wires",
    }
)
LOG_LINES = 100
COMMANDS = frozenset(
    {
        "drive",
        "release",
        "lost",
        "stop",
        "resume",
        "goto",
        "place",
        "allow_goals",
        "take",
        "give",
        "read",
        "plot",
        "set",
    }
)


class DriveCommand(NamedTuple):
    """A velocity while the finger of `press` is down, with the newest `number` of the server."""

    press: int
    number: int
    linear: float  # m/s
    angular: float  # rad/s


def parse_command(text: str) -> tuple[str, Fields]:
    """The name and the fields of a command. Raises RefusalError for anything else."""
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict) or fields.get("do") not in COMMANDS:
        raise RefusalError("E-REQUEST", "the page sent something that is no command")
    return fields.pop("do"), fields


def drive_command(fields: Fields) -> DriveCommand:
    """A drive command. Raises RefusalError for values that are no numbers."""
    return DriveCommand(
        whole_number(fields, "press"),
        whole_number(fields, "n"),
        number(fields, "linear"),
        number(fields, "angular"),
    )


def number(fields: Fields, name: str) -> float:
    """A finite number. Raises RefusalError."""
    value = finite(fields.get(name))
    if value is None:
        raise RefusalError("E-REQUEST", f"the page sent no number as {name}")
    return value


def whole_number(fields: Fields, name: str) -> int:
    """A whole number. Raises RefusalError."""
    value: Any = fields.get(name)
    if type(value) is not int or not 0 <= value < 1 << 53:  # the whole numbers of JavaScript
        raise RefusalError("E-REQUEST", f"the page sent no whole number as {name}")
    return value


def goal_fields(fields: Fields) -> Fields:
    """The fields of `goto`. Raises RefusalError."""
    goal: Fields = {"x": number(fields, "x"), "y": number(fields, "y")}
    if fields.get("heading") is not None:
        goal["heading"] = number(fields, "heading")
    return goal


def read_request(fields: Fields) -> tuple[str, Fields]:
    """Method and fields of a request that only reads. Raises RefusalError."""
    method = fields.get("method")
    if method not in READS:
        raise RefusalError("E-REQUEST", "a page may not ask that")
    if method == "describe_topic":
        return method, {"topic": short_text(fields.get("topic"), "topic")}
    return method, {"last": LOG_LINES} if method == "read_log" else {}


def short_text(value: Any, name: str) -> str:
    """A text that may go on to the engine. Raises RefusalError."""
    if not isinstance(value, str) or len(value) > TEXT_MAX_LENGTH:
        raise RefusalError("E-REQUEST", f"the page sent no short text as {name}")
    return value


def plotted_fields(fields: Fields, topics: Container[str]) -> list[str]:
    """The fields to plot, all of `topics`; none ends the plots. Raises RefusalError."""
    names = fields.get("fields")
    if not isinstance(names, list) or len(names) > FIELDS_MAX:
        raise RefusalError("E-REQUEST", f"a page plots at most {FIELDS_MAX} fields")
    chosen = list(dict.fromkeys(short_text(name, "field") for name in names))
    for name in chosen:
        if topic_of(name) not in topics:
            raise RefusalError("E-REQUEST", f"this run has no topic {topic_of(name)} to plot")
    return chosen
