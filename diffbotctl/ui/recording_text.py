"""Recordings in words: what is in one, and how two differ."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime

from diffbotctl.recording.comparison import TopicDifference
from diffbotctl.recording.metrics import Metrics
from diffbotctl.recording.reader import RecordingInfo
from diffbotctl.time import SECOND

LONGEST = 60  # characters shown of a message that differs


def info_lines(seen: RecordingInfo) -> Iterator[str]:
    """What `bag info` prints."""
    about = seen.about
    yield f"file       {seen.path} ({_size(seen.size)})"
    yield f"started    {_moment(int(about['epoch']) + seen.begins)}"
    yield f"duration   {(seen.ends - seen.begins) / SECOND:.2f} s"
    yield f"pipeline   {about.get('pipeline', 'unknown')}"
    yield f"robot      {about.get('robot') or 'none'} on {_port(about)}"
    settings = json.loads(about.get("sets", "[]"))
    if settings:
        yield f"set        {', '.join(settings)}"
    yield f"version    {about.get('version', 'unknown')}"
    yield f"ended      {_ended(seen)}"
    yield f"file is    {_state(seen)}"
    yield ""
    yield f"{'topic':28} {'type':24} {'messages':>8} {'rate':>10}  from"
    for topic in seen.topics:
        rate = "" if topic.rate is None else f"{topic.rate:.2f} Hz"
        yield f"{topic.name:28} {topic.kind:24} {topic.messages:8d} {rate:>10}  {topic.origin}"


def difference_lines(topics: list[TopicDifference], names: tuple[str, str]) -> Iterator[str]:
    """What `bag diff` prints of the topics."""
    for topic in topics:
        if topic.place is None:
            continue
        yield f"{topic.name}: message {topic.place + 1} differs, at {topic.time / SECOND:.6f} s"
        for name, said in zip(names, (topic.one, topic.other), strict=True):
            words = "nothing" if said is None else f"{said[0] / SECOND:.6f} s {said[1]}"
            yield f"  {name}  {words}"
        if topic.counts[0] != topic.counts[1]:
            yield f"  messages in all: {topic.counts[0]} and {topic.counts[1]}"
    same = [topic for topic in topics if topic.place is None]
    if same:
        messages = sum(topic.counts[0] for topic in same)
        yield f"same: {len(same)} of {len(topics)} topics, {messages} messages"


def metrics_table(one: Metrics, other: Metrics, heads: tuple[str, str]) -> Iterator[str]:
    """A table of both runs' metrics, with what changed."""
    yield f"{'':24} {heads[0]:>12} {heads[1]:>12} {'change':>12}"
    for name, (unit, scale) in UNITS.items():
        left, right = getattr(one, name), getattr(other, name)
        if left is None and right is None:
            continue
        change = ""
        if left is not None and right is not None:
            change = "same" if left == right else _figure(right - left, scale, unit, "+")
        texts = [_figure(value, scale, unit) for value in (left, right)]
        yield f"{name.replace('_', ' '):24} {texts[0]:>12} {texts[1]:>12} {change:>12}"


# How each figure is shown: its unit, and how many of that make one of SI.
UNITS: dict[str, tuple[str, float]] = {
    "goals_reached": ("", 1),
    "time_to_goal": ("s", 1),
    "cross_track_max": ("mm", 1000),
    "cross_track_rms": ("mm", 1000),
    "path": ("m", 1),
    "stops": ("", 1),
    "final_error": ("mm", 1000),
    "true_error": ("mm", 1000),
}


def _figure(value: float | None, scale: float, unit: str, sign: str = "") -> str:
    if value is None:
        return "-"
    if not unit:
        return f"{value:{sign}d}"
    return f"{value * scale:{sign}.3f} {unit}"


def _ended(seen: RecordingInfo) -> str:
    if seen.end is None:
        return "unknown: the recording does not tell its end"
    cause, code = seen.end.get("cause", "unknown"), seen.end.get("code", "")
    return f"{cause} (exit code {code})" if code else f"it went on after: {cause}"


def _state(seen: RecordingInfo) -> str:
    if seen.recovered is not None:
        lost = seen.recovered.get("damaged_chunks", "0")
        damaged = "" if lost == "0" else f", {lost} damaged chunks are missing"
        return f"recovered from one that was cut{damaged}"
    if seen.complete:
        return FLIGHTS.get(seen.about.get("flight", ""), "complete")
    return "CUT; every message up to the cut is there. `diffbotctl bag recover` mends the file"


INPUTS = "the flight recorder's: only what came in; `diffbotctl replay` makes the rest"
FLIGHTS = {
    "run": f"{INPUTS}, from the run's start",
    "state": f"{INPUTS}, from a known state",
    "unknown": f"{INPUTS}, from a state unknown",
}


def _port(about: dict[str, str]) -> str:
    port = about.get("port", "unknown")
    return f"{port} (seed {about.get('seed', 'unknown')})" if port == "sim" else port


def _moment(epoch: int) -> str:
    return datetime.fromtimestamp(epoch / SECOND, UTC).astimezone().strftime("%Y-%m-%d %H:%M:%S %z")


def _size(size: int) -> str:
    return f"{size / 1e6:.2f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
