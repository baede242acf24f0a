"""Names that live: those of running engines, of a recording, of a pipeline. For completion only.

A shell waits for them at each Tab: an engine that does not answer at once offers nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import Any

import click

from diffbotctl.cli.engine_client import host

ANSWER_TIMEOUT_S = 0.5  # of all engines together
Reply = dict[str, Any]


def engine_names(ctx: click.Context) -> list[str]:
    """The engines that this user may access."""
    from diffbotctl.control_socket.address import engines

    return [engine.name for engine in engines()]


def topics(ctx: click.Context) -> list[str]:
    """The topics of the running engine."""
    return _names(ctx, "list_topics", "topics", "topic")


def parameters(ctx: click.Context) -> list[str]:
    """The parameters of the running blocks; for `set` those that may change."""
    is_set = ctx.info_name == "set"
    return _names(
        ctx, "list_parameters", "parameters", "parameter", lambda row: row["live"] or not is_set
    )


def actions(ctx: click.Context) -> list[str]:
    """The actions that can be called."""
    return _names(ctx, "list_actions", "actions", "action")


def action_arguments(ctx: click.Context) -> list[str]:
    """`name=` for each argument of the action that is called."""
    rows = [row for reply in _replies(ctx, "list_actions") for row in reply["actions"]]
    named = [row["arguments"] for row in rows if row["action"] == ctx.params.get("action")]
    return sorted({f"{name}=" for names in named for name in names})


def blocks(ctx: click.Context) -> list[str]:
    """The blocks that run."""
    return _names(ctx, "list_blocks", "blocks", "block")


def plotted_fields(ctx: click.Context) -> list[str]:
    """The numbers that the running engine has sent, as `block.port.field`."""
    return sorted(
        {
            f"{topic}.{name}"
            for reply in _replies(ctx, "snapshot")
            for topic, message in reply["messages"].items()
            for name, value in message.items()
            if name != "time" and isinstance(value, int | float)
        }
    )


def recorded_fields(ctx: click.Context) -> list[str]:
    """The topics and fields of the recording that the command names."""
    from diffbotctl.errors import UserError
    from diffbotctl.recording.fields import all_columns, column_wires

    with suppress(UserError, OSError, TypeError):
        wires = column_wires(ctx.params["file"])
        return [*wires, *(column.name for column in all_columns(wires))]
    return []


def settings(ctx: click.Context) -> list[str]:
    """`block.parameter=` for each block of the pipeline that the command names."""
    from diffbotctl.config.load import load
    from diffbotctl.errors import UserError
    from diffbotctl.params import declared

    pipeline = ctx.params.get("pipeline") or "goal"
    with suppress(UserError):
        configuration = load(pipeline, ctx.params.get("robot"), ())
        return [f"{use.name}.{name}=" for use in configuration.blocks for name in declared(use.cls)]
    return []


def sensors(ctx: click.Context) -> list[str]:
    """The sensors of the robot that the command names."""
    from diffbotctl.config.load import load_robot
    from diffbotctl.errors import UserError

    with suppress(UserError):
        return list(load_robot(ctx.params.get("robot")).robot.sensors)
    return []


def _names(
    ctx: click.Context,
    method: str,
    rows: str,
    name: str,
    chosen: Callable[[Reply], bool] = lambda row: True,
) -> list[str]:
    """The field `name` of the `rows` in the replies to `method`."""
    return sorted(
        {row[name] for reply in _replies(ctx, method) for row in reply[rows] if chosen(row)}
    )


def _replies(ctx: click.Context, method: str) -> Iterator[Reply]:
    """The reply of the engine that the command names, else of every engine on this computer.

    None of another computer: a shell that completes must not log in there.
    """
    from diffbotctl.control_socket.address import engines
    from diffbotctl.control_socket.client import ControlClient
    from diffbotctl.errors import UserError

    if host():
        return
    chosen = _named_engine(ctx)
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    for engine in engines():
        if chosen not in (None, engine.name):
            continue
        with suppress(UserError, OSError):
            client = ControlClient(engine, "diffbotctl completion", deadline)
            try:
                yield client.request(method)
            finally:
                client.close()


def _named_engine(ctx: click.Context) -> str | None:
    """The value of `--engine`, here or at the group of commands above."""
    contexts: Iterable[click.Context] = filter(None, (ctx, ctx.parent))
    return next((each.params["engine"] for each in contexts if each.params.get("engine")), None)
