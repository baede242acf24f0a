"""`diffbotctl topic`: the messages of a running engine."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import command, group, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.engine_client import WATCHER_NICENESS, attached, rate_text
from diffbotctl.cli.options import ENGINE, FOR, JSON
from diffbotctl.cli.output import print_json, print_row
from diffbotctl.errors import Problem, UsageError
from diffbotctl.ui.text import fold_text

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

VELOCITY_PERIOD_S = 0.2  # a velocity published once holds this long; 0.3 s are a lost operator
RATE_PERIOD_S = 1.0
EMPTY_TEXT = '""'
ELLIPSIS = "..."
SHOWN_UNITS = ("m", "rad", "m/s", "rad/s", "s", "V")  # of numbers; the others are counts and ratios


@group("Look", 5, "Print messages")
def topic() -> None:
    """List, print, measure and publish the messages of a running engine."""


@topic.command("list")
def list_(as_json: bool = JSON, engine: str | None = ENGINE) -> None:
    """List every topic with its type, rate and age."""
    with attached(engine, "topic list") as client:
        rows = client.request("list_topics")["topics"]
    for row in rows:
        print_row(as_json, row, f"{row['topic']:24} {row['type']:10} {rate_text(row)}")


@topic.command()
def echo(
    topic: str,
    once: bool = option("Print the newest message only."),
    duration: float | None = FOR,
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> None:
    """Print the messages of TOPIC as they arrive, or one field of it: odometry.odometry.x.

    One message on a line; `*` is every topic. On a terminal the last numbers of a message that is
    too long for the line are left out: --once and --json print all of it.
    """
    os.nice(WATCHER_NICENESS)
    with attached(engine, "topic echo") as client:
        name, path = _split_field(client, topic)
        reply = client.request("subscribe", topic=name, last=once)
        wire = reply["topic"]
        if wire != name:
            click.echo(f"{name} is {wire} here", err=True)
        if reply.get("silence"):
            click.echo(reply["silence"], err=True)
        units = {} if name == "*" or as_json else _units(client, wire)
        until = None if duration is None else time.monotonic() + duration
        width = None if once else getattr(sys.stdout, "columns", None)
        for event in client.stream(until):
            _print_event(event, path, name == "*", as_json, units, width)
            if once and "message" in event:
                break


def _refuse_constant(word: str) -> None:
    """Python's reader accepts NaN and Infinity, which JSON does not have."""
    raise ValueError(f"{word} is no number")


def _split_field(client: ControlClient, topic: str) -> tuple[str, list[str]]:
    wires = {row["topic"] for row in client.request("list_topics")["topics"]}
    steps = topic.split(".")
    for length in range(len(steps), 0, -1):
        name = ".".join(steps[:length])
        if name in wires:
            return name, steps[length:]
    return topic, []


def _units(client: ControlClient, topic: str) -> dict[str, str]:
    """The unit of each field of the messages on `topic`."""
    fields = client.request("describe_topic", topic=topic)["schema"]["properties"]
    return {name: field["x-unit"] for name, field in fields.items()}


def _print_event(
    event: dict[str, Any],
    path: list[str],
    with_topic: bool,
    as_json: bool,
    units: dict[str, str],
    width: int | None,
) -> None:
    if "lost" in event:
        click.echo(f"({event['lost']} messages lost: this client reads too slowly)", err=True)
    if "message" not in event:
        return
    value = event["message"]
    for step in path:
        try:
            value = value[int(step)] if isinstance(value, list) else value[step]
        except (KeyError, ValueError, IndexError, TypeError):
            has = f"it has {', '.join(value)}" if isinstance(value, dict) else f"it is {value}"
            raise click.UsageError(f"there is no field '{step}' here: {has}") from None
    if as_json:
        print_json({"topic": event["topic"], "message": value} if with_topic else value)
        return
    head = f"{event['topic']}  " if with_topic else ""
    if isinstance(value, dict):
        texts = dict(_field_texts(value, {} if path else units))
        text = "  ".join(texts.values())
        if width is not None and len(head) + len(text) > width:
            text = _fitted(texts, value, width - len(head))
    else:
        text = str(value) or EMPTY_TEXT
    print(head + text, flush=True)


def _fitted(texts: dict[str, str], message: dict[str, Any], width: int) -> str:
    """`texts` in one line without the last numbers, lists and empty texts; a text stays."""
    kept = dict(texts)
    for name in reversed(texts):
        line = "  ".join([*kept.values(), ELLIPSIS])
        if len(line) <= width:
            return line
        if name != "time" and not (isinstance(message[name], str) and message[name]):
            del kept[name]
    return "  ".join(kept.values())


def _field_texts(message: dict[str, Any], units: dict[str, str]) -> Iterator[tuple[str, str]]:
    for name, value in message.items():
        if name == "time":
            yield name, f"{value / 1e9:.3f} s"
        else:
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            unit = units.get(name, "") if is_number else ""
            shown = unit if unit in SHOWN_UNITS else ""
            yield name, f"{name} {_short_text(value)} {shown}".rstrip()


def _short_text(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_short_text, value))}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value) or EMPTY_TEXT


@topic.command()
@exclusive("--once", ("--for",), "one line needs no time limit")
def hz(
    topic: str,
    once: bool = option("Print one line and end."),
    duration: float | None = FOR,
    as_json: bool = JSON,
    engine: str | None = ENGINE,
) -> None:
    """Measure how often TOPIC carries a message: rate over the last two seconds, each second."""
    until = None if duration is None else time.monotonic() + duration
    with attached(engine, "topic hz") as client:
        while True:
            row = client.request("topic_rate", topic=topic)
            print_row(as_json, row, _rate_line(row))
            if once or (until is not None and time.monotonic() + RATE_PERIOD_S > until):
                return
            time.sleep(RATE_PERIOD_S)


def _rate_line(row: dict[str, Any]) -> str:
    gaps = ""
    if row["most_gap"] is not None:
        gaps = f"  gaps {row['least_gap'] * 1000:.1f} to {row['most_gap'] * 1000:.1f} ms"
    return f"{row['topic']}  {rate_text(row).strip()}{gaps}  {row['messages']} messages"


@topic.command("type")
def type_(topic: str, as_json: bool = JSON, engine: str | None = ENGINE) -> None:
    """Show the fields of TOPIC with their units and meaning."""
    with attached(engine, "topic type") as client:
        reply = client.request("describe_topic", topic=topic)
    if as_json:
        print_json({name: reply[name] for name in ("topic", "type", "schema")})
        return
    _print_type(f"{reply['topic']}  {reply['type']}", reply["schema"])


@command("Look", 6, "; list message types")
def types(name: str | None, as_json: bool = JSON) -> None:
    """List the types of messages, or show the fields of NAME with their units and meaning.

    NAME is one such as Twist, Int32 or my_package/Face. No engine needs to run.
    """
    from diffbotctl.config import registry
    from diffbotctl.message_types import type_name
    from diffbotctl.recording.message_schema import json_schema

    for each in registry.message_names() if name is None else [name]:
        try:
            kind = registry.message_type(each)
        except registry.RegistryError as error:
            if name is not None:
                raise UsageError(Problem(error.code, "types", str(error), error.fix)) from None
            click.echo(f"{each}: {error}; {error.fix}", err=True)
            continue
        schema = json_schema(kind)
        if as_json:
            print_json({"type": type_name(kind), "schema": schema})
        elif name is None:
            click.echo(fold_text(f"{type_name(kind):16} {schema['description']}", hang=17))
        else:
            _print_type(type_name(kind), schema)


def _print_type(head: str, schema: dict[str, Any]) -> None:
    click.echo(fold_text(f"{head}  {schema['description']}"))
    width = max(map(len, schema["properties"]))
    for name, field in schema["properties"].items():
        bounds = ""
        if {"minimum", "maximum"} <= field.keys():
            bounds = f" {field['minimum']} to {field['maximum']}."
        text = f"  {name:{width}} {field['x-unit'] or '-':8} {field['description']}{bounds}"
        click.echo(fold_text(text.rstrip(), hang=width + 10))


@topic.command()
def pub(
    topic: str,
    message: str,
    rate: float | None = option(
        "Repeat at this rate.", metavar="HZ", type=click.FloatRange(0.1, 100.0)
    ),
    engine: str | None = ENGINE,
) -> None:
    """Publish MESSAGE, a JSON object, on TOPIC: operator.twist, operator.goal, an input, ...

    Only the topics of the operator and the inputs of the pipeline can be published. A velocity
    published once holds for 0.2 s, then the robot stops; it also stops after Ctrl-C.
    """
    try:
        fields = json.loads(message, parse_constant=_refuse_constant)
    except ValueError as error:
        raise click.UsageError(
            f"""MESSAGE is not JSON, such as '{{"linear": 0.1}}': {error}"""
        ) from error
    except RecursionError:
        raise click.UsageError("MESSAGE is nested too deeply") from None
    with attached(engine, "topic pub") as client:
        try:
            client.request("publish", topic=topic, message=fields)
            if not client.request("topic_rate", topic=topic)["is_read"]:
                click.echo(f"no block and no program of this pipeline reads {topic}", err=True)
            if rate is None:
                click.echo(f"published once on {topic}; --rate repeats it")
            time.sleep(VELOCITY_PERIOD_S if rate is None else 1.0 / rate)
            while rate is not None:
                client.request("publish", topic=topic, message=fields)
                time.sleep(1.0 / rate)
            return
        finally:
            # Without the release the engine would report a lost operator.
            client.send("release")
