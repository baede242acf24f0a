"""What all commands share that speak to a running engine: which one, and how to reach it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

engine_option = click.option(
    "--engine", metavar="NAME", help="Which engine, when several are running."
)


@contextmanager
def attached(engine: str | None, tool: str) -> Iterator[ControlClient]:
    """A connection to the engine called `engine`, or to the only one; `tool` is our name there."""
    from diffbotctl.control_socket.client import ControlClient, choose_engine

    caller = ControlClient(choose_engine(engine), f"diffbotctl {tool}")
    try:
        yield caller
    finally:
        caller.close()


def quantity_of(text: str, unit: str, what: str) -> float:
    """A number with or without unit, in SI. Raises click.UsageError."""
    from math import isfinite

    from diffbotctl.units import UnitError, quantity

    try:
        value = quantity(text, unit)
    except UnitError as error:
        raise click.UsageError(f"{what}: {error}") from error
    if not isfinite(value):
        raise click.UsageError(f"{what}: {text} makes no sense here")
    return value


def held_by(status: dict[str, Any]) -> str:
    """What holds the robot, in words; empty when nothing does."""
    held = status["held"]
    return "" if held is None else f"{held['code']}: {held['cause']}"


def paced(row: dict[str, Any]) -> str:
    """`50.0 Hz`, `silent for 3.2 s`, `nothing yet`."""
    if row["age"] is None:
        return "nothing yet"
    if row["rate"] == 0.0:
        return f"last {row['age']:.1f} s ago"
    return f"{row['rate']:6.1f} Hz"


def settled(caller: ControlClient, seen: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The status as soon as `seen` is true of it, or after SETTLING whatever it is then."""
    import time

    deadline = time.monotonic() + SETTLING
    while True:
        status = caller.ask("status")
        if seen(status) or time.monotonic() > deadline:
            return status
        time.sleep(LOOK)


SETTLING = 1.0  # s for a command to take effect: some instants, with a machine's hiccup
LOOK = 0.01  # s between two looks at the status
