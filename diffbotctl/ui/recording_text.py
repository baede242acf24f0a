"""Recordings as text: the content of one, and the differences between two."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime

from diffbotctl.printable import shortened
from diffbotctl.recording.comparison import TopicDifference
from diffbotctl.recording.metrics import Metrics
from diffbotctl.recording.reader import RecordingInfo
from diffbotctl.time import SECOND

TEXT_LENGTH_MAX = 1000
INPUTS = "black box recording, inputs only; `diffbotctl replay` computes the rest;"
# States of a recording of the black box.
FLIGHTS = {
    "run": f"{INPUTS} from the start of the run",
    "state": f"{INPUTS} from a known state",
    "unknown": f"{INPUTS} from an unknown state",
}
# How each metric is shown: its unit, and how many of that are one SI unit.
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


def info_lines(info: RecordingInfo) -> Iterator[str]:
    """What `bag info` prints."""
    about = info.about
    started = datetime.fromtimestamp((int(about["epoch"]) + info.begins) / SECOND, UTC)
    size = f"{info.size / 1e6:.2f} MB" if info.size >= 1e6 else f"{info.size / 1e3:.1f} kB"
    port = about.get("port", "unknown")
    if port == "sim":
        port = f"sim (seed {about.get('seed', 'unknown')})"
    overrides = json.loads(about.get("sets", "[]"))
    yield f"file       {info.path} ({size})"
    yield f"started    {started.astimezone().strftime('%Y-%m-%d %H:%M:%S %z')}"
    yield f"duration   {(info.ends - info.begins) / SECOND:.2f} s"
    yield f"pipeline   {about.get('pipeline', 'unknown')}"
    yield f"robot      {about.get('robot') or 'none'} on {port}"
    if overrides:
        yield f"set        {shortened(', '.join(overrides), TEXT_LENGTH_MAX)}"
    yield f"version    {about.get('version', 'unknown')}"
    yield f"ended      {_end(info)}"
    yield f"file is    {_state(info)}"
    if info.attachments:
        yield f"attached   {', '.join(info.attachments)}"
    yield ""
    yield f"{'topic':26} {'type':23} {'messages':>8} {'rate':>10}  from"
    for topic in info.topics:
        rate = "" if topic.rate is None else f"{topic.rate:.2f} Hz"
        name, kind, origin = map(shortened, (topic.name, topic.kind, topic.origin))
        yield f"{name:26} {kind:23} {topic.messages:8d} {rate:>10}  {origin}"


def difference_lines(topics: list[TopicDifference], names: tuple[str, str]) -> Iterator[str]:
    """What `bag diff` prints of the topics."""
    equal = []
    for topic in topics:
        if topic.place is None:
            equal.append(topic)
            continue
        name, time = shortened(topic.name), topic.time / SECOND
        yield f"{name}: message {topic.place + 1} differs, at {time:.6f} s"
        texts = _differing_fields(topic)
        for name, message, text in zip(names, (topic.one, topic.other), texts, strict=True):
            shown = "nothing" if message is None else f"{message[0] / SECOND:.6f} s {text}"
            yield f"  {name}  {shown}"
        if topic.counts[0] != topic.counts[1]:
            yield f"  messages in total: {topic.counts[0]} and {topic.counts[1]}"
    if equal:
        messages = sum(topic.counts[0] for topic in equal)
        yield f"same: {len(equal)} of {len(topics)} topics, {messages} messages"


def _differing_fields(topic: TopicDifference) -> list[str]:
    """Of both messages the fields that differ; the whole text where only one is there."""
    texts = ["" if message is None else message[1] for message in (topic.one, topic.other)]
    if not all(texts):
        return texts
    one, other = map(json.loads, texts)
    names = [name for name in one if other.get(name, one) != one[name]]
    return [json.dumps({name: message.get(name) for name in names}) for message in (one, other)]


def metrics_table(one: Metrics, other: Metrics, heads: tuple[str, str]) -> Iterator[str]:
    """A table of the metrics of two runs, with the change of each."""
    yield f"{'':24} {heads[0]:>12} {heads[1]:>12} {'change':>12}"
    for name, (unit, scale) in UNITS.items():
        first, second = getattr(one, name), getattr(other, name)
        if first is None and second is None:
            continue
        change = ""
        if first is not None and second is not None:
            change = "same" if first == second else _value(second - first, scale, unit, "+")
        texts = [_value(value, scale, unit) for value in (first, second)]
        yield f"{name.replace('_', ' '):24} {texts[0]:>12} {texts[1]:>12} {change:>12}"


def metrics_lines(metrics: Metrics) -> Iterator[str]:
    for name, (unit, scale) in UNITS.items():
        value = getattr(metrics, name)
        if value is not None:
            yield f"{name.replace('_', ' '):24} {_value(value, scale, unit):>12}"


def _value(value: float | None, scale: float, unit: str, sign: str = "") -> str:
    if value is None:
        return "-"
    if not unit:
        return f"{value:{sign}d}"
    return f"{value * scale:{sign}.3f} {unit}"


def _end(info: RecordingInfo) -> str:
    if info.end is None:
        return "unknown: the recording has no end record"
    cause = shortened(info.end.get("cause", "unknown"), TEXT_LENGTH_MAX)
    code = shortened(info.end.get("code", ""))
    return f"{cause} (exit code {code})" if code else f"the run continued after: {cause}"


def _state(info: RecordingInfo) -> str:
    if info.recovered is not None:
        lost = info.recovered.get("damaged_chunks", "0")
        damaged = "" if lost == "0" else f", {lost} damaged chunks are missing"
        return f"recovered from a cut file{damaged}"
    if info.complete:
        return FLIGHTS.get(info.about.get("flight", ""), "complete")
    return "CUT; all messages before the cut can be read. `diffbotctl bag recover` repairs the file"
