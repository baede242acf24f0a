"""`diffbotctl topic`: the messages of a running engine."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.engine_client import attached, engine_option, paced, quantity_of

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient


COUNTS = 0.2  # s a velocity holds that is said once; 0.3 s of silence are a lost operator
WATCHING = 10  # niceness: whoever looks on leaves a small machine to the control path


@click.group()
def command() -> None:
    """Look at the topics of a running engine, and say what a person may say."""


@command.command("list")
@engine_option
def list_(engine: str | None) -> int:
    """Every topic with its type, rate and age; JSON lines when piped."""
    with attached(engine, "topic list") as caller:
        rows = caller.ask("topics")["topics"]
    if not sys.stdout.isatty():
        for row in rows:
            click.echo(json.dumps(row))
        return 0
    for row in rows:
        click.echo(f"{row['topic']:24} {row['type']:10} {paced(row)}")
    return 0


@command.command()
@click.argument("topic")
@click.option("--once", is_flag=True, help="The newest message only.")
@click.option("--for", "duration", metavar="TIME", help="Only so long, such as 10s.")
@engine_option
def echo(topic: str, once: bool, duration: str | None, engine: str | None) -> int:
    """Print the messages of TOPIC as they come; a field of it too: odometry.odometry.x.

    On a terminal one message a line as words, piped as JSON lines; `*` is every topic.
    """
    until = None if duration is None else time.monotonic() + quantity_of(duration, "s", "--for")
    os.nice(WATCHING)
    with attached(engine, "topic echo") as caller:
        name, path = _apart(caller, topic)
        known = caller.ask("watch", topic=name, last=once)["topic"]
        if known != name:
            click.echo(f"{name} is {known} here", err=True)
        for said in caller.stream(until):
            _print(said, path, name == "*")
            if once and "message" in said:
                break
    return 0


def _apart(caller: ControlClient, topic: str) -> tuple[str, list[str]]:
    """The topic and the path of a field in it."""
    wires = {row["topic"] for row in caller.ask("topics")["topics"]}
    steps = topic.split(".")
    for length in range(len(steps), 0, -1):
        name = ".".join(steps[:length])
        if name in wires:
            return name, steps[length:]
    return topic, []


def _print(said: dict[str, Any], path: list[str], named: bool) -> None:
    if "lost" in said:
        click.echo(f"({said['lost']} messages were lost: this client reads too slowly)", err=True)
    if "message" not in said:
        return
    value = said["message"]
    for step in path:
        try:
            value = value[int(step)] if isinstance(value, list) else value[step]
        except (KeyError, ValueError, IndexError, TypeError):
            raise click.UsageError(f"the message has no field '{step}': {value}") from None
    if not sys.stdout.isatty():
        print(json.dumps({"topic": said["topic"], "message": value} if named else value))
        sys.stdout.flush()
        return
    head = f"{said['topic']}  " if named else ""
    click.echo(head + ("  ".join(_words(value)) if isinstance(value, dict) else str(value)))


def _words(message: dict[str, Any]) -> Iterator[str]:
    for name, value in message.items():
        if name == "time":
            yield f"{value / 1e9:.3f} s"
        else:
            yield f"{name} {_short(value)}"


def _short(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@command.command()
@click.argument("topic")
@engine_option
def hz(topic: str, engine: str | None) -> int:
    """How often TOPIC carries a message, over the last two seconds, each second anew."""
    with attached(engine, "topic hz") as caller:
        while True:
            row = caller.ask("rate", topic=topic)
            gaps = ""
            if row["most_gap"] is not None:
                gaps = f"  gaps {row['least_gap'] * 1000:.1f} to {row['most_gap'] * 1000:.1f} ms"
            click.echo(f"{row['topic']}  {paced(row).strip()}{gaps}  {row['messages']} messages")
            if not sys.stdout.isatty():
                return 0
            time.sleep(1.0)


@command.command("type")
@click.argument("topic")
@engine_option
def type_(topic: str, engine: str | None) -> int:
    """The fields of TOPIC with their units and meaning."""
    with attached(engine, "topic type") as caller:
        said = caller.ask("type", topic=topic)
    click.echo(f"{said['topic']}  {said['type']}  {said['schema']['description']}")
    for name, about in said["schema"]["properties"].items():
        unit = about["x-unit"] or "-"
        click.echo(f"  {name:14} {unit:8} {about['description']}")
    return 0


@command.command()
@click.argument("topic")
@click.argument("message")
@click.option("--rate", metavar="HZ", type=click.FloatRange(0.1, 100.0), help="Again and again.")
@engine_option
def pub(topic: str, message: str, rate: float | None, engine: str | None) -> int:
    """Say MESSAGE, a JSON object, on TOPIC: operator.twist, operator.goal and the like.

    What blocks and drivers say is theirs alone, and a driver's input takes only what passed the
    mux, the limits and the last gate. A velocity that is said once holds for 0.2 s, then the robot
    stands; so it does after Ctrl-C.
    """
    try:
        fields = json.loads(message)
    except ValueError as error:
        raise click.UsageError(f"MESSAGE is no JSON: {error}") from error
    with attached(engine, "topic pub") as caller:
        try:
            while True:
                caller.ask("publish", topic=topic, message=fields)
                time.sleep(COUNTS if rate is None else 1.0 / rate)
                if rate is None:
                    return 0
        finally:
            # Who drove and is gone is lost; who lets go in good order leaves nothing held.
            caller.tell("release")
