"""Connection to a running engine, and its status in words."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.options import AT

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

SETTLING_TIMEOUT_S = 1.0  # a command takes effect within some instants, and a delay of the machine
POLL_PERIOD_S = 0.01
WATCHER_NICENESS = 10  # the control path goes first on a small machine


def host() -> str:
    """The computer that `--at` names; empty for this one."""
    context = click.get_current_context(silent=True)
    return "" if context is None else str(context.meta.get(AT, ""))


@contextmanager
def attached(
    engine: str | None, tool: str, deadline: float | None = None, at: str | None = None
) -> Iterator[ControlClient]:
    """A connection to the engine called `engine`, or to the only one; `tool` names the client.

    `deadline`: monotonic time by which everything has to be answered. `at`: in place of `--at`.
    """
    from diffbotctl.control_socket.client import ControlClient, choose_engine

    address = choose_engine(engine, host() if at is None else at)
    client = ControlClient(address, f"diffbotctl {tool}", deadline)
    try:
        yield client
    finally:
        client.close()


def held_by(status: dict[str, Any]) -> str:
    """The stop in force, as `code: cause`; empty when there is none."""
    held = status["held"]
    return "" if held is None else f"{held['code']}: {held['cause']}"


def rate_text(row: dict[str, Any]) -> str:
    """`50.0 Hz`, `last 3.2 s ago`, `no message yet`."""
    if row["age"] is None:
        return "no message yet"
    if row["rate"] == 0.0:
        return f"last {row['age']:.1f} s ago"
    return f"{row['rate']:6.1f} Hz"


def settled(client: ControlClient, condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The status as soon as `condition` is true of it, at the latest after SETTLING_TIMEOUT_S."""
    deadline = time.monotonic() + SETTLING_TIMEOUT_S
    while True:
        status = client.request("status")
        if condition(status) or time.monotonic() > deadline:
            return status
        time.sleep(POLL_PERIOD_S)
