"""`diffbotctl graph`: the blocks and wires of a pipeline, as a tree, a picture or Mermaid."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, option
from diffbotctl.cli.contradictions import exclusive, needs
from diffbotctl.cli.engine_client import attached, host, rate_text
from diffbotctl.cli.options import ENGINE, FORCE, JSON, ROBOT, SETS
from diffbotctl.cli.output import print_json, write_output
from diffbotctl.printable import keep_lines
from diffbotctl.render.graph_layout import Wire, dot_lines, mermaid_lines

if TYPE_CHECKING:
    from rich.tree import Tree

    from diffbotctl.config.configuration import Configuration
    from diffbotctl.graph import Graph
    from diffbotctl.runs.build_graph import Assembly

OF_FILES = ("PIPELINE", "--robot", "--set", "--mermaid", "--output")
OF_AN_ENGINE = "the graph of a running engine comes from the engine, and is a list"
TREE_COLUMNS_MAX = 1000  # more than a pipeline has levels and names
SILENCE_MESSAGES_MIN = 20  # after so many messages, a wire without a rate is marked as silent


@command("Look", 9, "; draw a pipeline")
@exclusive("--running", OF_FILES, OF_AN_ENGINE)
@exclusive("--engine", OF_FILES, OF_AN_ENGINE)
@exclusive("--at", OF_FILES, OF_AN_ENGINE)
@exclusive("--output", ("--json", "--mermaid"), "each is another form of the graph")
@exclusive("--json", ("--mermaid",), "each is another form of the graph")
@needs(("--force",), ("--output",), "it overwrites a file")
def graph(
    pipeline: str | None,
    running: bool = option(
        "--running",
        "--live",
        "The graph of a running engine, with rates; SILENT: it has stopped sending.",
    ),
    engine: str | None = ENGINE,
    robot: str | None = ROBOT,
    sets: tuple[str, ...] = SETS,
    mermaid: bool = option("Print a Mermaid diagram."),
    output: Path | None = option("Write a picture: FILE.svg, .dot (Graphviz) or .mmd (Mermaid)."),
    force: bool = FORCE,
    as_json: bool = JSON,
) -> int:
    """Draw the blocks and wires of PIPELINE, with the nodes that are added to it."""
    if running or engine is not None or host():
        return _draw_running(engine, as_json)
    if pipeline is None:
        raise click.UsageError("give a pipeline, such as goal, or --running")
    from diffbotctl.config.load import load
    from diffbotctl.message_types import type_name
    from diffbotctl.runs.build_graph import assemble

    configuration = load(pipeline, robot, sets)
    assembly = assemble(configuration, False)
    wires = [
        *wires_of(assembly.graph, assembly.command),
        *_wires_out_of(configuration, assembly),
    ]
    blocks = [node.name for node in assembly.graph.nodes]
    title = f"{configuration.file}"
    if configuration.robot_file is not None:
        title += f" on {configuration.robot_file}"
    if output is not None:
        _write_picture(output, force, title, wires, assembly.graph)
    elif as_json:
        for wire in wires:
            kind = type_name(assembly.graph.kinds[f"{wire.source}.{wire.output}"])
            print_json({**wire._asdict(), "type": kind})
    elif mermaid:
        keep_lines(sys.stdout)
        for line in mermaid_lines(wires, set(blocks)):
            click.echo(line)
    else:
        _print_tree(title, wires, assembly.graph)
    return 0


def _write_picture(output: Path, force: bool, title: str, wires: list[Wire], graph: Graph) -> None:
    from diffbotctl.message_types import type_name
    from diffbotctl.render.graph_svg import graph_svg

    blocks = [node.name for node in graph.nodes]
    kinds = {wire: type_name(kind) for wire, kind in graph.kinds.items()}
    writers = {
        ".svg": lambda: graph_svg(title, wires, blocks, kinds),
        ".dot": lambda: "\n".join(["// diffbotctl", *dot_lines(wires, set(blocks), title), ""]),
        ".mmd": lambda: "\n".join(["%% diffbotctl", *mermaid_lines(wires, set(blocks)), ""]),
    }
    write_output(output, writers, force)


def _print_tree(title: str, wires: list[Wire], graph: Graph) -> None:
    from rich.measure import Measurement

    from diffbotctl.ui.console import PrintableConsole

    tree = wire_tree(wires, graph)
    console = PrintableConsole(soft_wrap=True, highlight=False, width=TREE_COLUMNS_MAX)
    width = Measurement.get(console, console.options, tree).maximum
    click.echo(title)
    if get_terminal_size((width, 24)).columns < width:  # its branches would be broken
        for wire in wires:
            click.echo(f"  {wire.source}.{wire.output} -> {wire.target}.{wire.port}")
        return
    console.print(tree)


def _draw_running(engine: str | None, as_json: bool) -> int:
    with attached(engine, "graph") as client:
        rows = client.request("list_wires")["wires"]
    for row in rows:
        if as_json:
            print_json(row)
            continue
        is_silent = (
            row["age"] is not None
            and row["rate"] == 0.0
            and row["messages"] > SILENCE_MESSAGES_MIN
            and not row["topic"].startswith("operator.")  # sends while a person drives
        )
        mark = "  SILENT" if is_silent else ""
        target = f"{row['to']}.{row['port']}"
        click.echo(f"{row['topic']:22} -> {target:22} {row['type']:10} {rate_text(row):>16}{mark}")
    return 0


def wires_of(graph: Graph, command: str | None) -> Iterator[Wire]:
    """Every wire of the graph, in the order of its blocks, and the command wire to the robot."""
    for node in graph.nodes:
        yield from _wires_into(node.name, node.wires)
    if command is not None:
        yield _command_wire(command, "robot")


def _wires_out_of(configuration: Configuration, assembly: Assembly) -> Iterator[Wire]:
    """The wires to several robots, and those that programs and devices take."""
    for name, _, part in assembly.parts:
        if part.command is not None:
            yield _command_wire(f"{name}.{part.command}", f"{name}.robot")
    for use in configuration.programs:
        yield from _wires_into(use.name, use.wires)
    for device in configuration.sources:
        yield from _wires_into(device.name, device.wires)


def _wires_into(name: str, wires: Mapping[str, str]) -> Iterator[Wire]:
    """The wires into the node `name`, from its inputs to their sources."""
    for port, wire in wires.items():
        source, _, output = wire.rpartition(".")
        yield Wire(source, output, name, port)


def _command_wire(command: str, robot: str) -> Wire:
    source, _, output = command.rpartition(".")
    return Wire(source, output, robot, output)


def wire_tree(wires: list[Wire], graph: Graph) -> Tree:
    """A tree that starts at the drivers; the wires of a node are below its first appearance."""
    from rich.markup import escape
    from rich.tree import Tree

    blocks = [node.name for node in graph.nodes]
    fed = {wire.target for wire in wires}
    drivers = [name for name in dict.fromkeys(wire.source for wire in wires) if name not in blocks]
    tree = Tree("", hide_root=True)
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
