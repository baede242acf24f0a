"""`diffbotctl completion`: what a shell needs to complete commands, options, names and codes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import click
from click.shell_completion import CompletionItem, get_completion_class

from diffbotctl.cli import COMPLETING, live_names
from diffbotctl.cli.command import argument, command
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


def _codes(ctx: click.Context) -> list[str]:
    from diffbotctl.codes import code_texts

    return sorted(code_texts())


def _blocks(ctx: click.Context) -> list[str]:
    from diffbotctl.config.registry import names

    return names()


def _message_types(ctx: click.Context) -> list[str]:
    from diffbotctl.config.registry import message_names

    return message_names()


def _both(ctx: click.Context) -> list[str]:
    return sorted({*_files("pipelines")(ctx), *_files("robots")(ctx)})


def _kits(ctx: click.Context) -> list[str]:
    from diffbotctl.cli.new import kits

    return sorted(kits())


def _parts(kind: str) -> Values:
    def names(ctx: click.Context) -> list[str]:
        from diffbotctl.config.composed_robot import PART_KINDS

        return list(PART_KINDS[kind].names)

    return names


DEV = Path("/dev")
# Values of a parameter by its name, or by the names of its command and itself.
KNOWN: dict[str, Values] = {
    "robot": _files("robots"),
    "robot_argument": _files("robots"),
    "pipeline": _files("pipelines"),
    "world": _files("pipelines"),
    "files": _both,
    "port": _ports,
    "radio": _ports,
    "code": _codes,
    "engine": live_names.engine_names,
    "topic": live_names.topics,
    "topics": live_names.topics,
    "exclude": live_names.topics,
    "parameter": live_names.parameters,
    "parameters": live_names.parameters,
    "action": live_names.actions,
    "block": live_names.blocks,
    "sets": live_names.settings,
    "kit": _kits,
    "board": _parts("board"),
    "driver": _parts("driver"),
    "encoders": _parts("encoders"),
    "sensors": _parts("sensor"),
    "imu": _parts("imu"),
    "robot radio": _parts("radio"),
    "sensor": live_names.sensors,
    "show name": _blocks,
    "types name": _message_types,
    "call arguments": live_names.action_arguments,
    "dash fields": live_names.plotted_fields,
    "plot fields": live_names.recorded_fields,
    "export fields": live_names.recorded_fields,
}
