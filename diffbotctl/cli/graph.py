"""`diffbotctl graph`: a pipeline's blocks and wires, as a tree or as Mermaid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.engine_client import attached, engine_option, paced

if TYPE_CHECKING:
    from rich.tree import Tree

    from diffbotctl.graph import Graph

Wire = tuple[str, str, str, str]  # from node, from port, to node, to port


@click.command()
@click.argument("pipeline", required=False)
@click.option("--live", is_flag=True, help="A running engine's, with rates and silent wires.")
@engine_option
@click.option("--robot", help="Robot file or name; wins over the pipeline's own.")
@click.option("--set", "sets", multiple=True, metavar="BLOCK.PARAM=VALUE", help="Change one value.")
@click.option("--mermaid", is_flag=True, help="Print a Mermaid diagram instead.")
def command(
    pipeline: str | None,
    live: bool,
    engine: str | None,
    robot: str | None,
    sets: tuple[str, ...],
    mermaid: bool,
) -> int:
    """Draw PIPELINE with all that is added to it: who feeds whom, with what."""
    if live or engine is not None:
        return _live(engine)
    if pipeline is None:
        raise click.UsageError("name a pipeline, such as goal, or ask for --live")
    from diffbotctl.config.load import load
    from diffbotctl.runs.build_graph import assemble

    configuration = load(pipeline, robot, sets)
    assembly = assemble(configuration, False)
    wires = list(wires_of(assembly.graph, assembly.command))
    if mermaid:
        for line in as_mermaid(wires, assembly.graph):
            click.echo(line)
        return 0
    from rich.console import Console

    title = f"{configuration.file}"
    if configuration.robot_file is not None:
        title += f" on {configuration.robot_file}"
    Console(soft_wrap=True, highlight=False).print(as_tree(title, wires, assembly.graph))
    return 0


def _live(engine: str | None) -> int:
    with attached(engine, "graph") as caller:
        rows = caller.ask("graph")["wires"]
    for row in rows:
        silent = row["age"] is not None and row["rate"] == 0.0 and row["messages"] > MANY
        mark = "  SILENT" if silent else ""
        to = f"{row['to']}.{row['port']}"
        click.echo(f"{row['topic']:22} -> {to:22} {row['type']:10} {paced(row):>16}{mark}")
    return 0


MANY = 20  # messages that make a wire one that is expected to go on, and silence worth a mark


def wires_of(graph: Graph, command: str | None) -> Iterator[Wire]:
    """Every wire of the graph, in the order of its blocks, and the one that leaves it."""
    for node in graph.nodes:
        for port, wire in node.wires.items():
            source, _, output = wire.partition(".")
            yield source, output, node.name, port
    if command is not None:
        source, _, output = command.partition(".")
        yield source, output, "robot", output


def as_mermaid(wires: list[Wire], graph: Graph) -> Iterator[str]:
    """A Mermaid flow chart; drivers are rounded."""
    yield "flowchart LR"
    inner = {node.name for node in graph.nodes}
    for name in dict.fromkeys(end for wire in wires for end in (wire[0], wire[2])):
        yield f"    {name}[{name}]" if name in inner else f"    {name}([{name}])"
    for source, output, node, port in wires:
        label = output if output == port else f"{output} to {port}"
        yield f"    {source} -->|{label}| {node}"


def as_tree(title: str, wires: list[Wire], graph: Graph) -> Tree:
    """A tree from the drivers on; a node's own wires are drawn where it is first met."""
    from rich.markup import escape
    from rich.tree import Tree

    inner = [node.name for node in graph.nodes]
    tree = Tree(escape(title))
    drawn: set[str] = set()
    fed = {wire[2] for wire in wires}
    drivers = [name for name in dict.fromkeys(wire[0] for wire in wires) if name not in inner]
    for name in [*drivers, *(name for name in inner if name not in fed)]:
        branch = tree.add(f"[bold]{escape(name)}[/bold]")
        drawn.add(name)
        _grow(branch, name, wires, drawn, graph)
    return tree


def _grow(branch: Tree, name: str, wires: list[Wire], drawn: set[str], graph: Graph) -> None:
    for source, output, node, port in wires:
        if source != name:
            continue
        kind = graph.kinds[f"{source}.{output}"].__name__
        label = f"{output} [dim]{kind}[/dim] -> [bold]{node}[/bold].{port}"
        if node in drawn:
            branch.add(f"{label} [dim](above)[/dim]")
            continue
        drawn.add(node)
        _grow(branch.add(label), node, wires, drawn, graph)
