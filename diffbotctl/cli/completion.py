"""`diffbotctl completion`: what a shell needs to complete commands, options, names and codes.

A shell waits for names at each Tab: an engine that does not answer at once offers none.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from diffbotctl.cli import COMPLETING
from diffbotctl.cli.command import argument, command
from diffbotctl.cli.engine_client import host
from diffbotctl.printable import keep_lines

Values = Callable[[click.Context], Iterable[str]]
PORTS = ("sim", "emulated", "auto")


@command("Set up", 9, "Print the completion script of a shell")
def completion(shell: str = argument(type=click.Choice(["bash", "zsh", "fish"]))) -> None:
    """Print what SHELL needs to complete diffbotctl's words.

    \b
    bash  diffbotctl completion bash \\
            > ~/.local/share/bash-completion/completions/diffbotctl
    zsh   diffbotctl completion zsh > ~/.zfunc/_diffbotctl
          (with ~/.zfunc in fpath)
    fish  diffbotctl completion fish \\
            > ~/.config/fish/completions/diffbotctl.fish
    """
    ctx = click.get_current_context()
    kind = get_completion_class(shell)
    assert kind is not None
    keep_lines(sys.stdout)
    click.echo(kind(ctx.find_root().command, {}, "diffbotctl", COMPLETING).source())


def teach(command: click.Command) -> click.Command:
    """Attach the completions to a command and its subcommands. Only while completing."""
    for parameter in command.params:
        known = KNOWN.get(f"{command.name} {parameter.name}", KNOWN.get(parameter.name or ""))
        if known is not None and isinstance(parameter.type, click.types.StringParamType):
            parameter.type = Known(known)
    for below in getattr(command, "commands", {}).values():
        teach(below)
    return command


class Known(click.types.StringParamType):
    """A text of which some values are known; what is typed need not be one of them."""

    def __init__(self, values: Values) -> None:
        self.values = values

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Those that begin so; files, once it looks like a path."""
        if "/" in incomplete and not incomplete.startswith("/dev/"):
            return [CompletionItem(incomplete, type="file")]
        return [CompletionItem(each) for each in self.values(ctx) if each.startswith(incomplete)]


def _files(kind: str) -> Values:
    def names(ctx: click.Context) -> list[str]:
        from diffbotctl.config.lookup import names as shipped

        own = (path.stem for path in Path(kind).glob("*.yaml"))
        return sorted({*shipped(kind), *own})

    return names


def _ports(ctx: click.Context) -> list[str]:
    found = (str(each) for kind in ("ttyACM", "ttyUSB", "rfcomm") for each in DEV.glob(f"{kind}*"))
    return [*PORTS, *sorted(found)]


def _returned_by(module: str, function: str) -> Values:
    """The names that a function without arguments returns; its module is imported when asked."""

    def names(ctx: click.Context) -> list[str]:
        return sorted(getattr(import_module(f"diffbotctl.{module}"), function)())

    return names


def _both(ctx: click.Context) -> list[str]:
    return sorted({*_files("pipelines")(ctx), *_files("robots")(ctx)})


def _parts(kind: str) -> Values:
    def names(ctx: click.Context) -> list[str]:
        from diffbotctl.config.composed_robot import PART_KINDS

        return list(PART_KINDS[kind].names)

    return names


ANSWER_TIMEOUT_S = 0.5  # of all engines together
Reply = dict[str, Any]


def engine_names(ctx: click.Context) -> list[str]:
    """The engines that this user may access."""
    from diffbotctl.control_socket.address import engines

    return [engine.name for engine in engines()]


def _named_in(method: str, rows: str, name: str) -> Values:
    """The field `name` of the `rows` in the reply of the engine to `method`."""
    return lambda ctx: _names(ctx, method, rows, name)


def parameters(ctx: click.Context) -> list[str]:
    """The parameters of the running blocks; for `set` those that may change."""
    is_set = ctx.info_name == "set"
    return _names(
        ctx, "list_parameters", "parameters", "parameter", lambda row: row["live"] or not is_set
    )


def action_arguments(ctx: click.Context) -> list[str]:
    """`name=` for each argument of the action that is called."""
    rows = [row for reply in _replies(ctx, "list_actions") for row in reply["actions"]]
    named = [row["arguments"] for row in rows if row["action"] == ctx.params.get("action")]
    return sorted({f"{name}=" for names in named for name in names})


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


DEV = Path("/dev")
TOPICS = _named_in("list_topics", "topics", "topic")
# Values of a parameter by its name, or by the names of its command and itself.
KNOWN: dict[str, Values] = {
    "robot": _files("robots"),
    "robot_argument": _files("robots"),
    "pipeline": _files("pipelines"),
    "world": _files("pipelines"),
    "files": _both,
    "port": _ports,
    "radio": _ports,
    "code": _returned_by("codes", "code_texts"),
    "engine": engine_names,
    "topic": TOPICS,
    "topics": TOPICS,
    "exclude": TOPICS,
    "parameter": parameters,
    "parameters": parameters,
    "action": _named_in("list_actions", "actions", "action"),
    "block": _named_in("list_blocks", "blocks", "block"),
    "sets": settings,
    "kit": _returned_by("cli.new", "kits"),
    "board": _parts("board"),
    "driver": _parts("driver"),
    "encoders": _parts("encoders"),
    "sensors": _parts("sensor"),
    "imu": _parts("imu"),
    "robot radio": _parts("radio"),
    "sensor": sensors,
    "show name": _returned_by("config.registry", "names"),
    "types name": _returned_by("config.registry", "message_names"),
    "call arguments": action_arguments,
    "dash fields": plotted_fields,
    "plot fields": recorded_fields,
    "export fields": recorded_fields,
}
