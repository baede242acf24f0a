"""A run whose control socket is attacked: any bytes, floods, clients that never read."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from diffbotctl.control_socket.dispatch import METHODS
from tests.support.command_process import children_of
from tests.support.running import PlainClient, moves, running
from tests.support.trials.hostile_yaml import odd_value

NAME = "test"
FLOOD_CLIENTS = 20
FAR_GOAL = ("goal", "--goal", "900m 0", "--set", "follower.patience=1000 s", "--stay")
FIELDS = (
    *("topic", "x", "y", "heading", "linear", "angular", "reason", "parameter", "value", "last"),
    *("action", "arguments", "block", "level", "message", "take_over", "time", "lease"),
)


class SocketAttack(NamedTuple):
    """What became of a run under attack. `stops`: s from the request to wheel commands of zero."""

    requests: int
    survived: bool
    peak_bytes: int
    failures: list[str]
    stops: list[float]


def hostile_line(rng: Random) -> bytes:
    """One line that a client might send."""
    kind = rng.randrange(8)
    if kind == 0:
        return rng.randbytes(rng.choice((1, 10, 1000))).replace(b"\n", b"") + b"\n"
    if kind == 1:
        return rng.choice(
            (b"\n", b"{}\n", b"[" * 30_000 + b"\n", b'"' * 70_000, b"9" * 5000 + b"\n")
        )
    request: dict[str, Any] = {"id": odd_value(rng) if rng.random() < 0.3 else 1}
    request["method"] = rng.choice(list(METHODS)) if rng.random() < 0.9 else odd_value(rng)
    for name in rng.sample(FIELDS, rng.randrange(4)):
        request[name] = odd_value(rng) if rng.random() < 0.7 else "robot.encoders"
    return json.dumps(request).encode()[:200_000] + b"\n"


def attack(folder: Path, rng: Random, connections: int, lines: int) -> SocketAttack:
    """Send `lines` hostile lines on each of `connections`, one after the other."""
    with running(folder, *FAR_GOAL, name=NAME) as process:
        sent = 0
        slow = [_connected(folder) for _ in range(10)]
        for client in slow:  # greet slowly, subscribe to everything and never read
            client.sendall(b'{"hello": 2, "name": "slow"}\n{"method": "subscribe", "topic": "*"')
        for _ in range(connections):
            with _connected(folder) as client, suppress(OSError):
                client.settimeout(0.2)
                if rng.random() < 0.9:
                    client.sendall(b'{"hello": 2, "name": "x"}\n')
                for _ in range(lines):
                    client.sendall(hostile_line(rng))
                    sent += 1
                    if rng.random() < 0.3:
                        client.recv(1 << 16)
        watcher = PlainClient(folder)
        survived = bool(watcher.request("status")) and process.poll() is None
        peak = max(map(_peak_bytes, _family(process.pid)))
        for client in slow:
            client.close()
        watcher.close()
        return SocketAttack(sent, survived, peak, _failures(folder), [])


def flood(folder: Path, repeats: int) -> SocketAttack:
    """Stop a driving robot `repeats` times while twenty clients send as much as they can."""
    with running(folder, *FAR_GOAL, name=NAME) as process:
        with _flood(folder):
            client = PlainClient(folder)
            stops = _timed_stops(client, repeats)
            client.close()
        survived = process.poll() is None
        peak = max(map(_peak_bytes, _family(process.pid)))
        return SocketAttack(0, survived, peak, _failures(folder), stops)


def silent_reader(folder: Path, requests: int, repeats: int) -> SocketAttack:
    """A client that sends `requests` and never reads, while another one stops a driving robot."""
    with running(folder, *FAR_GOAL, name=NAME) as process:
        pid = os.fork()
        if not pid:
            with suppress(BaseException), _connected(folder) as reader:
                reader.settimeout(60.0)
                reader.sendall(b'{"hello": 2, "name": "reader"}\n')
                reader.sendall(b'{"id": 1, "method": "snapshot"}\n' * requests)
            os._exit(0)
        client = PlainClient(folder)
        stops = _timed_stops(client, repeats)
        os.waitpid(pid, 0)  # it ends when it is disconnected
        survived = bool(client.request("status")) and process.poll() is None
        client.close()
        peak = max(map(_peak_bytes, _family(process.pid)))
        return SocketAttack(requests, survived, peak, _failures(folder), stops)


def _timed_stops(client: PlainClient, repeats: int) -> list[float]:
    """Seconds from a client's `stop` until the driving robot is held, `repeats` times."""
    stops = []
    for _ in range(repeats):
        client.request("resume")
        client.request("goto", x=900.0, y=0.0)
        client.until(moves)
        began = time.monotonic()
        client.send('{"id": "halt", "method": "stop"}')
        client.until(lambda status: _held(status) and not moves(status))
        stops.append(time.monotonic() - began)
    return stops


def _held(status: dict[str, Any]) -> bool:
    held = status["held"]
    return held is not None and bool(held["code"])


@contextmanager
def _flood(folder: Path) -> Iterator[None]:
    """Twenty clients, each a process, that send requests as quickly as they are taken."""
    pids = []
    for number in range(FLOOD_CLIENTS):
        pid = os.fork()
        if not pid:
            with suppress(BaseException):
                _send_for_ever(folder, number)
            os._exit(0)
        pids.append(pid)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


def _send_for_ever(folder: Path, number: int) -> None:
    request = b'{"id": 1, "method": "%s"}\n'
    names = (b"status", b"snapshot", b"list_topics", b"list_wires")
    block = b"".join(Random(number).choices([request % name for name in names], k=100))
    with _connected(folder) as client:
        client.sendall(b'{"hello": 2, "name": "flood"}\n')
        client.setblocking(False)
        waiting = block
        while True:
            select.select([client], [client], [])
            with suppress(BlockingIOError):
                waiting = waiting[client.send(waiting) :] or block
            with suppress(BlockingIOError):
                if not client.recv(1 << 20):
                    return


def _connected(folder: Path) -> socket.socket:
    client = socket.socket(socket.AF_UNIX)
    client.settimeout(10.0)
    client.connect(str(folder / "diffbotctl" / f"{NAME}.socket"))
    return client


def _family(pid: int) -> list[int]:
    """A process and its children."""
    return [pid, *children_of(pid)]


def _peak_bytes(pid: int) -> int:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    return 0


def _failures(folder: Path) -> list[str]:
    """Failures that the server has noted in its log."""
    log = folder / "diffbotctl" / f"{NAME}.log"
    if not os.path.exists(log):
        return []
    return [line for line in log.read_text().splitlines() if '"traceback"' in line]
