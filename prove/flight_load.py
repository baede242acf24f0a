"""What the flight recorder costs those whom the hub serves, while its largest file is written."""

from __future__ import annotations

import json
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from diffbotctl.config.load import load
from diffbotctl.messages import Encoders
from diffbotctl.recording.black_box import BlackBox, StopEvent
from diffbotctl.recording.black_box_store import SIZE_MAX_BYTES
from diffbotctl.runs.build_graph import Assembly, assemble
from diffbotctl.runs.control_socket import RunControlSocket
from diffbotctl.runs.options import RunOptions, SocketOptions
from diffbotctl.runs.outputs import RunReports, run_facts, start_black_box
from diffbotctl.time import SECOND
from tests.support.trials.row import Row

PERIOD = SECOND // 10_000  # ns between two instants: so fast that the ring is full before it is old
BATCH = 50  # instants handed on at once
DRAWN = 20  # bytes of each that are drawn, and cannot be compressed
RATE = 0.02  # s between two questions; a client that asks more often is made to wait
LONGEST = 0.1  # s; a driver who is lost must be noticed within half a second
SECONDS = 3.0  # of questions, from the moment in which the file is begun


@contextmanager
def hub(folder: Path) -> Iterator[tuple[BlackBox, RunControlSocket, Assembly]]:
    """A hub with a flight recorder; the engine is this program."""
    setup = load("goal", None, [])
    assembly = assemble(setup, real=False)
    facts = partial(run_facts, setup, RunOptions(), [])
    flight, keeper = start_black_box(
        folder,
        setup,
        assembly,
        RunReports(facts, lambda: (0, 0), lambda: None, lambda line: None, print),
    )
    with patch.dict(os.environ, {"XDG_RUNTIME_DIR": str(folder)}):
        station = RunControlSocket(SocketOptions("load"), setup, assembly, "sim", store=keeper)
    try:
        yield flight, station, assembly
    finally:
        flight.finish({"code": "0", "cause": "", "last": "0"})
        station.channel.close()
        station.end()
        flight.close()


def fill(flight: BlackBox, assembly: Assembly, share: float) -> None:
    """Hand the recorder what hardly compresses until a share of its ring is full; then a stop."""
    place = assembly.graph.sources.index("robot.encoders")
    rng, now, size = Random(1), 0, 0
    flight.sender.channel.setblocking(True)

    def instant() -> tuple[Any, ...]:
        values: list[Any] = [None] * len(assembly.graph.sources)
        drawn = [rng.getrandbits(40) for _ in range(4)]
        values[place] = Encoders(now, drawn[0], drawn[1], drawn[2], drawn[3], 9.0, 9.0)
        return (now, *values)

    while size < share * SIZE_MAX_BYTES:
        batch = []
        for _ in range(BATCH):
            now += PERIOD
            batch.append(instant())
        flight.sender.send(batch)
        size += BATCH * DRAWN
    flight.sender.send(StopEvent(now, "load", "a measurement"))
    now += 2 * SECOND  # what comes after a stop belongs to its file
    flight.sender.send([instant()])


def answers(path: Path) -> Iterator[float]:
    """Seconds that a client waits for each of its questions."""
    with socket.socket(socket.AF_UNIX) as client, client.makefile("rb") as lines:
        client.connect(str(path))
        lines.readline()
        client.sendall(json.dumps({"hello": 2, "name": "load"}).encode() + b"\n")
        until = time.monotonic() + SECONDS
        while (began := time.monotonic()) < until:
            client.sendall(json.dumps({"id": 1, "method": "status"}).encode() + b"\n")
            lines.readline()
            yield time.monotonic() - began
            time.sleep(RATE)


def row(share: float) -> Row:
    """The longest that a client waits for an answer while a share of a ring is being written."""
    with tempfile.TemporaryDirectory() as name, hub(Path(name)) as (flight, station, assembly):
        fill(flight, assembly, share)
        waited = [next(asked := answers(station.path))]
        while flight.sender.receive() is None and (answer := next(asked, None)) is not None:
            waited.append(answer)
    longest = max(waited)
    return Row(
        "hub's answer while a flight is written, worst",
        f"{longest * 1e3:.0f} ms of {len(waited)}",
        f"<= {LONGEST * 1e3:.0f} ms",
        longest <= LONGEST,
    )
