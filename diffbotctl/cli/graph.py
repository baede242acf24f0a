"""`diffbotctl graph`: the blocks and wires of a pipeline, as a tree or as Mermaid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import click

from diffbotctl.cli.engine_client import attached, rate_text
from diffbotctl.cli.options import engine_option, json_option, robot_option, set_option
from diffbotctl.cli.output import print_json

if TYPE_CHECKING:
    from rich.tree import Tree

    from diffbotctl.graph import Graph

SILENCE_MESSAGES_MIN = 20  # after so many messages, a wire without a rate is marked as silent


class Wire(NamedTuple):
    """One wire, from a node's output to another node's input."""

    source: str
    output: str
    target: str
    port: str


@click.command()
@click.argument("pipeline", required=False)
@click.option(
    "--running", "--live", is_flag=True, help="The graph of a running engine, with rates."
)
@engine_option
@robot_option
@set_option
@click.option("--mermaid", is_flag=True, help="Print a Mermaid diagram.")
@json_option
def command(
    pipeline: str | None,
    running: bool,
    engine: str | None,
    robot: str | None,
    sets: tuple[str, ...],
    mermaid: bool,
    as_json: bool,
) -> int:
    """Draw the blocks and wires of PIPELINE, with the nodes that are added to it."""
    if running or engine is not None:
        return _draw_running(engine, as_json)
    if pipeline is None:
        raise click.UsageError("give a pipeline, such as goal, or --running")
    from diffbotctl.config.load import load
    from diffbotctl.message_types import type_name
    from diffbotctl.runs.build_graph import assemble

    configuration = load(pipeline, robot, sets)
    assembly = assemble(configuration, False)
    wires = list(wires_of(assembly.graph, assembly.command))
    for name, _, part in assembly.parts:
        if part.command is not None:
            wires.append(_command_wire(f"{name}.{part.command}", f"{name}.robot"))
    if as_json:
        for wire in wires:
            kind = type_name(assembly.graph.kinds[f"{wire.source}.{wire.output}"])
            print_json({**wire._asdict(), "type": kind})
    elif mermaid:
        for line in mermaid_lines(wires, assembly.graph):
            click.echo(line)
    else:
        title = f"{configuration.file}"
        if configuration.robot_file is not None:
            title += f" on {configuration.robot_file}"
        _print_tree(title, wires, assembly.graph)
    return 0


def _print_tree(title: str, wires: list[Wire], graph: Graph) -> None:
    from shutil import get_terminal_size

    from diffbotctl.errors import WIDTH
    from diffbotctl.ui.console import PrintableConsole

    if get_terminal_size((WIDTH, 24)).columns < WIDTH:  # the branches of the tree would be broken
        click.echo(title)
        for wire in wires:
            click.echo(f"  {wire.source}.{wire.output} -> {wire.target}.{wire.port}")
        return
    PrintableConsole(soft_wrap=True, highlight=False).print(wire_tree(title, wires, graph))


def _draw_running(engine: str | None, as_json: bool) -> int:
    with attached(engine, "graph") as client:
        rows = client.request("list_wires")["wires"]
    for row in rows:
        if as_json:
            print_json(row)
            continue
        is_silent = (
            row["age"] is not None and row["rate"] == 0.0 and row["messages"] > SILENCE_MESSAGES_MIN
        )
        mark = "  SILENT" if is_silent else ""
        target = f"{row['to']}.{row['port']}"
        click.echo(f"{row['topic']:22} -> {target:22} {row['type']:10} {rate_text(row):>16}{mark}")
    return 0


def wires_of(graph: Graph, command: str | None) -> Iterator[Wire]:
    """Every wire of the graph, in the order of its blocks, and the command wire to the robot."""
    for node in graph.nodes:
        for port, wire in node.wires.items():
            source, _, output = wire.rpartition(".")
            yield Wire(source, output, node.name, port)
    if command is not None:
        yield _command_wire(command, "robot")


def _command_wire(command: str, robot: str) -> Wire:
    source, _, output = command.rpartition(".")
    return Wire(source, output, robot, output)


def mermaid_lines(wires: list[Wire], graph: Graph) -> Iterator[str]:
    """A Mermaid flow chart; drivers are rounded."""
    yield "flowchart LR"
    blocks = {node.name for node in graph.nodes}
    for name in dict.fromkeys(end for wire in wires for end in (wire.source, wire.target)):
        key = _key(name)
        yield f"    {key}[{name}]" if name in blocks else f"    {key}([{name}])"
    for wire in wires:
        label = wire.output if wire.output == wire.port else f"{wire.output} to {wire.port}"
        yield f"    {_key(wire.source)} -->|{label}| {_key(wire.target)}"


def _key(name: str) -> str:
    """The name of a node in Mermaid, where a dot has a meaning."""
    return name.replace(".", "_")


def wire_tree(title: str, wires: list[Wire], graph: Graph) -> Tree:
    """A tree that starts at the drivers; the wires of a node stand where it first appears."""
    from rich.markup import escape
    from rich.tree import Tree

    blocks = [node.name for node in graph.nodes]
    fed = {wire.target for wire in wires}
    drivers = [name for name in dict.fromkeys(wire.source for wire in wires) if name not in blocks]
    tree = Tree(escape(title))
    drawn: set[str] = set()
    for name in [*drivers, *(name for name in blocks if name not in fed)]:
        drawn.add(name)
        _add_branches(tree.add(f"[bold]{escape(name)}[/bold]"), name, wires, drawn, graph)
    return tree


def _add_branches(
    branch: Tree, name: str, wires: list[Wire], drawn: set[str], graph: Graph
) -> None:
    from diffbotctl.message_types import type_name

    for source, output, target, port in wires:
        if source != name:
            continue
        kind = type_name(graph.kinds[f"{source}.{output}"])
        label = f"{output} [dim]{kind}[/dim] -> [bold]{target}[/bold].{port}"
        if target in drawn:
            branch.add(f"{label} [dim](above)[/dim]")
            continue
        drawn.add(target)
        _add_branches(branch.add(label), target, wires, drawn, graph)
