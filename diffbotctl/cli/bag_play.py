"""`diffbotctl bag play`: recorded messages into the inputs of an engine that is running."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from diffbotctl.cli.command import option, subcommand
from diffbotctl.cli.engine_client import attached
from diffbotctl.cli.options import ENGINE, YES
from diffbotctl.errors import Problem, RunError, closest_match
from diffbotctl.time import SECOND

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

INPUT = "input."  # begins the wire of a declared input
MESSAGES_PER_SECOND_MAX = 250  # the control socket takes 300 requests
EXAMPLE = "such as --map robot.scan=input.scan"


class PlayedSpan(NamedTuple):
    """The mapped messages of a recording: the first and last time (ns), and how many there are."""

    first: int
    last: int
    messages: int

    @property
    def period(self) -> float:
        """Time in ns from one begin of a loop to the next: the last message has a mean gap too."""
        length = self.last - self.first
        return length + (length / (self.messages - 1) if length else SECOND)


@subcommand()
def play(
    file: Path,
    maps: tuple[str, ...] = option(
        "--map",
        "A recorded topic, and the input that gets its messages. Repeatable.",
        required=True,
        metavar="TOPIC=INPUT",
    ),
    rate: float = option(
        "X times the recorded speed.", type=click.FloatRange(0.01, 100.0), default=1.0, metavar="X"
    ),
    loop: bool = option("Begin again at the end, until Ctrl-C."),
    drive: bool = option("Also into inputs on which the robot's motion depends."),
    yes: bool = YES,
    engine: str | None = ENGINE,
) -> None:
    """Play topics of the recording FILE into inputs that the running pipeline declares.

    An input on which motion depends needs --drive, and on a real robot a yes as well. When the
    messages end, it expires as any other: the robot is then stopped until `resume`.
    """
    inputs = dict(map(_read_map, maps))
    kinds = _recorded_kinds(file, inputs)
    span = _span(file, inputs, rate, loop)
    with attached(engine, "bag play") as client:
        moving = [
            inputs[topic] for topic in inputs if _feeds_motion(client, inputs[topic], kinds[topic])
        ]
        if moving:
            _require_drive(client, moving, drive, yes)
        click.echo(f"playing {span.messages} messages; Ctrl-C ends it", err=True)
        begin = time.monotonic()
        while True:
            for at, target, fields in _messages(file, inputs):
                due = begin + (at - span.first) / SECOND / rate
                _take_replies(client.stream(due))
                client.send("publish", topic=target, message=fields)
            begin += span.period / SECOND / rate
            if not loop:
                break
        client.request("status")  # its reply comes after those to all messages
        _take_replies(client.streamed)
    click.echo(f"{span.messages} messages were played")


def _read_map(text: str) -> tuple[str, str]:
    """A recorded topic and the input for it. Raises click.UsageError."""
    topic, _, target = (part.strip() for part in text.partition("="))
    if not topic or not target:
        raise click.UsageError(f"--map '{text}' has no TOPIC=INPUT, {EXAMPLE}")
    if not target.startswith(INPUT):
        cause = f"--map cannot play into '{target}', only into what `inputs` of a pipeline declares"
        raise click.UsageError(f"{cause}, {EXAMPLE}")
    return topic, target


def _recorded_kinds(file: Path, inputs: dict[str, str]) -> dict[str, str]:
    """The type of each recorded topic. Raises RunError for one without messages."""
    from diffbotctl.recording.reader import recording_info

    kinds = {topic.name: topic.kind for topic in recording_info(file).topics if topic.messages}
    for topic in inputs:
        if topic not in kinds:
            near = closest_match(topic, kinds)
            fix = f"did you mean {near}?" if near else f"`diffbotctl bag info {file}` lists them"
            cause = f"it has no messages of {topic}"
            raise RunError(Problem("E-RECORDING", str(file), cause, fix))
    return kinds


def _messages(file: Path, inputs: dict[str, str]) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """The time (ns), the input and the fields of each mapped message."""
    from diffbotctl.recording.reader import RecordingReader

    for item in RecordingReader(file).messages():
        if item.wire in inputs:
            fields = json.loads(item.data)
            fields.pop("time", None)  # the engine stamps it
            yield item.time, inputs[item.wire], fields


def _span(file: Path, inputs: dict[str, str], rate: float, loop: bool) -> PlayedSpan:
    """What is played. Raises click.UsageError for more than the control socket takes."""
    times = [at for at, _, _ in _messages(file, inputs)]
    span = PlayedSpan(times[0], times[-1], len(times))
    begin, busiest = 0, span.messages * SECOND * rate / span.period if loop else 0.0
    for end, at in enumerate(times):
        while at - times[begin] >= SECOND * rate:
            begin += 1
        busiest = max(busiest, end - begin + 1)
    if busiest > MESSAGES_PER_SECOND_MAX:
        raise click.UsageError(
            f"these are up to {busiest:.0f} messages in a second, and the control socket takes "
            f"{MESSAGES_PER_SECOND_MAX}: lower --rate, or map fewer topics"
        )
    return span


def _feeds_motion(client: ControlClient, target: str, kind: str) -> bool:
    """Whether motion depends on the input. Raises RunError for one of another type."""
    reply = client.request("describe_topic", topic=target)
    if reply["topic"] != target or reply["type"] != kind:
        cause = f"the recorded messages are of type {kind}, not {reply['type']}"
        raise RunError(Problem("E-INPUT", target, cause, "map another topic"))
    return bool(reply["feeds_motion"])


def _require_drive(client: ControlClient, moving: list[str], drive: bool, yes: bool) -> None:
    """Require --drive, and a person's yes for a real robot. Raises click.UsageError."""
    names = ", ".join(moving)
    if not drive:
        raise click.UsageError(f"the robot's motion depends on {names}: add --drive")
    status = client.request("status")
    if status["simulated"] or yes:
        return
    question = f"The REAL robot on {status['port']} will move by recorded messages. Go on?"
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("no terminal to ask whether the real robot may move: add --yes")
    if not click.confirm(question):
        raise click.UsageError("the motion was refused")


def _take_replies(replies: Iterable[dict[str, Any]]) -> None:
    """Raise RunError for a message that was refused, or when the run has ended."""
    for reply in replies:
        if reply.get("ended") or not reply.get("ok", True):
            cause = reply.get("cause", "the run has ended")
            code = reply.get("error", "E-NO-ANSWER")
            raise RunError(Problem(code, "bag play", cause, reply.get("fix", "")))
