"""`diffbotctl map`: the saved maps of the user, and the map of a running engine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from diffbotctl.cli.command import NEGATIVE_NUMBERS, NumbersCommand, group, option
from diffbotctl.cli.engine_client import attached
from diffbotctl.cli.options import ENGINE, FORCE, JSON, YES, quantity_option
from diffbotctl.cli.output import check_overwrite, print_json
from diffbotctl.errors import Problem, RunError, UsageError, closest_match

if TYPE_CHECKING:
    from diffbotctl.control_socket.client import ControlClient

ANSWER_TIMEOUT_S = 20.0
POLL_PERIOD_S = 0.05


@group("Record", 2, "; save, load, export, import maps")
def map() -> None:
    """Save the map of a running robot, find the robot in a saved one, and exchange maps with ROS.

    `diffbotctl run map` builds one. Saved maps are files of your user; `map list` shows them.
    """


@map.command("save")
def save(name: str, force: bool = FORCE, engine: str | None = ENGINE) -> int:
    """Save the map of the running engine as NAME."""
    from diffbotctl.drivers.map_store import map_path

    _refuse_saved(map_path(name), force, "choose another name, or add --force to replace it")
    _ask(engine, "save", {"name": name})
    click.echo(f"map saved: {name}, {map_path(name)}")
    return 0


@map.command("load")
def load(name: str, engine: str | None = ENGINE) -> int:
    """Load the map NAME into the running engine, which then searches for the robot in it."""
    _existing(name)
    _ask(engine, "load", {"name": name})
    click.echo(f"map loaded: {name}; drive gently, and the place is found, or asked for")
    return 0


@map.command("clear")
def clear(engine: str | None = ENGINE) -> int:
    """Begin an empty map where the robot stands."""
    _ask(engine, "clear", {})
    click.echo("the map is empty, and begins here")
    return 0


@map.command("place", cls=NumbersCommand, context_settings=NEGATIVE_NUMBERS)
def place(
    x: float = quantity_option("m", "--x", "Position in the map.", required=True),
    y: float = quantity_option("m", "--y", "Position in the map.", required=True),
    heading: float | None = quantity_option(
        "rad", "--heading", "Heading in the map; without it, the one that fits best."
    ),
    engine: str | None = ENGINE,
) -> int:
    """State where the robot is in the map, such as --x 1.2m --y -30cm --heading 90deg."""
    from diffbotctl.blocks.slam import place_arguments

    _ask(engine, "place", place_arguments(x, y, heading))
    click.echo("placed")
    return 0


@map.command("list")
def list_(as_json: bool = JSON) -> int:
    """List the saved maps."""
    from time import localtime, strftime

    from diffbotctl.drivers.map_store import maps_folder, stored_maps

    maps = stored_maps()
    for each in maps:
        if as_json:
            print_json(each._asdict())
        else:
            saved = strftime("%F %R", localtime(each.time))
            click.echo(f"{each.name:24} {each.size / 1000:8.0f} kB  {saved}")
    if not maps and not as_json:
        click.echo(f"no maps are saved in {maps_folder()}")
    return 0


@map.command("delete")
def delete(name: str, yes: bool = YES) -> int:
    """Delete the saved map NAME."""
    path = _existing(name)
    if not yes:
        click.confirm(f"delete {path}?", abort=True)
    path.unlink()
    click.echo(f"deleted: {name}")
    return 0


@map.command("export")
def export(
    name: str,
    output: Path = option("--output", "--to", "File to write: NAME.yaml.", required=True),
    force: bool = FORCE,
) -> int:
    """Write the saved map NAME as picture and yaml for ROS's map_server: NAME.pgm beside it."""
    from diffbotctl.mapping.map_file import load_map
    from diffbotctl.mapping.map_image import save_picture

    path = output.with_suffix(".yaml")
    for each in (path, path.with_suffix(".pgm")):
        check_overwrite(each, force)
    save_picture(load_map(_existing(name)).grid(), path)
    click.echo(f"{path}, {path.with_suffix('.pgm')}")
    return 0


@map.command("import")
def import_(
    file: Path,
    name: str | None = option("--name", "Name of the map; by default that of the file."),
    force: bool = FORCE,
) -> int:
    """Save a map of ROS's map_server, FILE.yaml and its picture, as a map of your user.

    It has cells alone: a robot is found in it, and followed, but it does not grow.
    """
    import numpy as np

    from diffbotctl.blocks.slam import is_map_name
    from diffbotctl.drivers.map_store import map_path
    from diffbotctl.mapping.map_file import save_map
    from diffbotctl.mapping.map_image import load_picture
    from diffbotctl.mapping.scan_map import Map

    grid = load_picture(file)
    name = name or file.stem
    if not is_map_name(name):
        raise click.UsageError(f"a map's name has letters, digits, - and _; not '{name}': --name")
    path = map_path(name)
    _refuse_saved(path, force, "choose another --name, or add --force to replace it")
    path.parent.mkdir(parents=True, exist_ok=True)
    save_map(Map(grid.resolution, (), np.zeros((0, 3)), grid), path)
    rows, columns = grid.cells.shape
    click.echo(f"map imported: {name}, {columns} x {rows} cells of {grid.resolution:g} m, {path}")
    return 0


def _refuse_saved(path: Path, force: bool, fix: str) -> None:
    """Raises UsageError when the map of this name exists, without `force`."""
    if path.exists() and not force:
        raise UsageError(Problem("E-OUTPUT", path.stem, "there is a map of this name", fix))


def _existing(name: str) -> Path:
    """The file of a saved map. Raises UsageError."""
    from diffbotctl.drivers.map_store import map_path, stored_maps

    names = [each.name for each in stored_maps()]
    if name in names:
        return map_path(name)
    near = closest_match(name, names)
    hint = f"did you mean {near}?" if near else "`diffbotctl map list` shows them"
    raise click.UsageError(f"there is no map '{name}'; {hint}")


def _ask(engine: str | None, task: str, arguments: dict[str, Any]) -> None:
    """Have the engine's map carry out a task, and wait until it has. Raises RunError."""
    with attached(engine, f"map {task}") as client:
        rows = client.request("list_actions")["actions"]
        block = next((row["action"] for row in rows if row["action"].endswith(".place")), "")
        block = block.rpartition(".")[0]
        if f"{block}.{task}" not in [row["action"] for row in rows]:
            cause = "its pipeline builds no map"
            raise RunError(Problem("E-MAP-RUN", "engine", cause, "start `diffbotctl run map`"))
        value = client.request("call_action", action=f"{block}.{task}", arguments=arguments)
        cause = _answer(client, int(value["value"]))
        if cause:
            raise RunError(Problem("E-MAP-RUN", f"map {task}", cause, "see `diffbotctl log`"))


def _answer(client: ControlClient, number: int) -> str:
    """Why a request to the map failed; empty when it was carried out."""
    import time

    topics = client.request("list_topics")["topics"]
    topic = next(row["topic"] for row in topics if row["type"] == "MapUpdate")
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    while time.monotonic() < deadline:
        update = client.request("describe_topic", topic=topic)["last"]
        if update is not None and update["request"] >= number:
            return str(update["refusal"])
        time.sleep(POLL_PERIOD_S)
    return f"its process has not answered for {ANSWER_TIMEOUT_S:g} s"
