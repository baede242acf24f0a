"""`diffbotctl bag record` and `bag save`: recordings of an engine that is running."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import argument, option, subcommand
from diffbotctl.cli.engine_client import WATCHER_NICENESS, attached
from diffbotctl.cli.options import ENGINE, FOR, FORCE
from diffbotctl.cli.output import check_overwrite
from diffbotctl.errors import Problem, RunError

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient
    from diffbotctl.recording.live_recording import LiveRecording, LiveTopic

FLUSH_PERIOD_S = 0.5
SAVING_TIMEOUT_S = 10.0  # a slow SD card takes a second
POLL_PERIOD_S = 0.05


@subcommand()
def record(
    topics: tuple[str, ...] = argument("[TOPIC]..."),
    exclude: tuple[str, ...] = option("Leave topics out. Repeatable.", metavar="PATTERN"),
    output: Path | None = option("Default: ENGINE-DATE-TIME.mcap here."),
    force: bool = FORCE,
    duration: float | None = FOR,
    engine: str | None = ENGINE,
) -> int:
    """Record TOPICs of a running engine, or all, until Ctrl-C or the end of the run.

    A TOPIC may be a pattern: 'odometry.*'. The file can be inspected and plotted; it cannot be
    replayed, because it does not hold the state in which it begins: for that `bag save`.

    Exit code: 0 complete, 1 messages were lost.
    """
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: stopped.append(number))
    with attached(engine, "bag record") as client:
        chosen = _choose_topics(client, topics, exclude)
        path = output or Path(f"{client.about['engine']}-{time.strftime('%Y%m%d-%H%M%S')}.mcap")
        check_overwrite(path, force)
        recording = _open(path, client, chosen)
        try:
            click.echo(f"recording {len(chosen)} topics to {path}; Ctrl-C ends it", err=True)
            os.nice(WATCHER_NICENESS)
            until = None if duration is None else time.monotonic() + duration
            cause, lost = _record(client, recording, chosen, until, stopped)
            recording.end(cause if not lost else f"{cause}; {lost} messages were lost")
        except OSError as error:
            raise _cannot_write(path, error) from error
        finally:
            recording.close()
    click.echo(f"{path}: {recording.messages} messages")
    if lost:
        click.echo(f"{lost} messages were lost: this computer reads too slowly", err=True)
    return int(lost > 0)


def _record(
    client: ControlClient,
    recording: LiveRecording,
    topics: Iterable[LiveTopic],
    until: float | None,
    stopped: list[int],
) -> tuple[str, int]:
    """Record to the end. Returns its cause, and how many messages were lost."""
    for topic in topics:
        client.request("subscribe", topic=topic.name)
    lost = 0
    while True:
        flush_due = time.monotonic() + FLUSH_PERIOD_S
        for event in client.stream(flush_due if until is None else min(flush_due, until)):
            if event.get("ended"):
                lost += sum(_take(recording, rest) for rest in client.stream(_soon()))
                return "the run has ended", lost
            lost += _take(recording, event)
            if time.monotonic() > flush_due:
                break
        recording.flush()
        if stopped:
            return "the recording was ended", lost
        if until is not None and time.monotonic() >= until:
            return "time limit of the recording reached", lost


def _take(recording: LiveRecording, event: dict[str, Any]) -> int:
    """Record one line of the stream. Returns how many messages it reports as lost."""
    if "message" in event:
        recording.write(event["topic"], event["message"])
    return int(event.get("lost", 0))


def _soon() -> float:
    """Until when the rest of the stream may come: the server sends it after the end."""
    return time.monotonic() + FLUSH_PERIOD_S


def _choose_topics(
    client: ControlClient, names: Iterable[str], exclude: Iterable[str]
) -> list[LiveTopic]:
    """The topics that names and patterns mean. Raises RunError for an unknown one."""
    from diffbotctl.graph import LOG
    from diffbotctl.recording.live_recording import LiveTopic

    known = [row["topic"] for row in client.request("list_topics")["topics"]]
    chosen: dict[str, None] = {}
    for name in names or ("*",):
        found = [topic for topic in known if fnmatchcase(topic, name)]
        if not found:
            found = [client.request("describe_topic", topic=name)["topic"]]
        chosen.update(dict.fromkeys(found))
    for pattern in exclude:
        for topic in [topic for topic in chosen if fnmatchcase(topic, pattern)]:
            del chosen[topic]
    if not chosen:
        raise click.UsageError("no topic is left to record")
    blocks = {LOG, *(row["block"] for row in client.request("list_blocks")["blocks"])}
    described = (client.request("describe_topic", topic=topic) for topic in chosen)
    return [
        LiveTopic(
            reply["topic"],
            reply["type"],
            reply["schema"],
            reply["topic"].rpartition(".")[0] in blocks,
        )
        for reply in described
    ]


def _open(path: Path, client: ControlClient, topics: list[LiveTopic]) -> LiveRecording:
    from diffbotctl.recording.live_recording import LiveRecording

    status = client.request("status")
    # The engine's zero of time, as a client estimates it.
    epoch = client.about.get("epoch") or time.time_ns() - status["time"]
    about = {
        "version": str(client.about["version"]),
        "epoch": str(epoch),
        "pipeline": str(status["pipeline"]),
        "robot": str(status["robot"] or ""),
        "port": str(status["port"]),
        **({"simulated": "yes"} if status["simulated"] else {}),
    }
    try:
        return LiveRecording(path, about, topics)
    except OSError as error:
        raise _cannot_write(path, error) from error


def _cannot_write(path: Path, error: OSError) -> Exception:
    cause = f"cannot record there: {error.strerror}"
    return RunError(Problem("E-RECORD", str(path), cause, "give another file: --output"))


@subcommand()
def save(engine: str | None = ENGINE) -> int:
    """Save the last three minutes of a running engine, or the whole run if it is younger.

    The file goes to the folder of the black box on the engine's computer, which keeps the ten
    newest; it can be replayed.
    """
    with attached(engine, "bag save") as client:
        reply = client.request("save_black_box")
        deadline = time.monotonic() + SAVING_TIMEOUT_S
        while not reply["is_written"] and time.monotonic() < deadline:
            time.sleep(POLL_PERIOD_S)
            reply = client.request("save_black_box", number=reply["number"])
    if not reply["is_written"]:
        click.echo(f"{reply['file']} has not been written yet", err=True)
        return 1
    click.echo(f"saved: {reply['file']}")
    return 0
