"""Hostile tables of drives, answers files and state files, drawn at random."""

from __future__ import annotations

import json
from collections.abc import Iterator
from random import Random

from tests.support.trials.hostile_yaml import ESCAPE, bombs, odd_value

HEADS = ("time,right,left,x,y,heading", "time,left,right", "time,right,left,", ESCAPE, "", "time")
CELLS = ("nan", "inf", "-inf", "1e308", "1e-320", "", " ", '"', ESCAPE, "\0", "9" * 5000, "x", "-1")
QUESTIONS = (
    *("distance.reading", "distance.length", "geometry.round", "encoders.turned", "reading", "x.y"),
    *("battery.chemistry", "battery.cells", "range.distance", ESCAPE, ""),
)


def hostile_tables(rng: Random, count: int) -> Iterator[bytes]:
    """Tables of counts; most begin like a good one."""
    yield b"time,right,left,x,y,heading\n" + b"0.1,1,1,0,0,0\n" * 300_000
    yield b"time,right,left\n" + b"," * 5_000_000
    yield bytes(range(256)) * 200
    for _ in range(count):
        rows = [HEADS[0] if rng.random() < 0.8 else rng.choice(HEADS)]
        for number in range(rng.choice((0, 1, 2, 50, 500))):
            cells = [
                f"{number * 0.1:.1f}",
                str(number),
                str(number),
                f"{number * 0.01:.3f}",
                "0",
                "0",
            ]
            if rng.random() < 0.05:
                cells[rng.randrange(6)] = rng.choice((*CELLS, str(odd_value(rng))[:300]))
            if rng.random() < 0.01:
                cells = cells[: rng.randrange(7)] * rng.choice((1, 2, 1000))
            rows.append(",".join(cells))
        yield "\n".join(rows).encode("utf-8", "surrogatepass")


def hostile_answers(rng: Random, count: int) -> Iterator[bytes]:
    """Answers files and other YAML or JSON files of the user's settings."""
    yield from bombs().values()
    for _ in range(count):
        entries = {rng.choice(QUESTIONS): odd_value(rng) for _ in range(rng.randrange(6))}
        yield json.dumps(entries, ensure_ascii=rng.random() < 0.5).encode("utf-8", "surrogatepass")
