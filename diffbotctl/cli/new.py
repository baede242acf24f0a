"""`diffbotctl new`: write a new robot file, pipeline, or package with a block or driver."""

from __future__ import annotations

import re
from functools import cache
from keyword import iskeyword
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from diffbotctl.cli.command import group, option
from diffbotctl.cli.contradictions import exclusive, needs
from diffbotctl.cli.options import choice_option
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, UsageError, closest_match

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import TextIO


# Path below the new package -> its template. Fields in braces are filled in.
def _package_files(kind: str) -> dict[str, str]:
    return {
        "{package}/__init__.py": "block_init.py",
        "{package}/{name}.py": f"{kind}.py",
        "tests/test_{name}.py": f"{kind}_test.py",
        "{name}.yaml": f"{kind}_pipeline.yaml",
        "setup.cfg": f"{kind}_setup.cfg",
        "pyproject.toml": "block_pyproject.toml",
        "README.md": f"{kind}_readme.md",
    }


BLOCK_FILES, DRIVER_FILES = _package_files("block"), _package_files("driver")
MESSAGE_FILES = _package_files("message") | {
    "{package}/messages.py": "message.py",
    "{package}/{name}.py": "message_block.py",
}
LESSON_FILES = {
    "lesson.md": "lesson.md",
    "check.yaml": "lesson_check.yaml",
    "start/double.py": "lesson_start.py",
    "start/double.yaml": "lesson_start.yaml",
    "start/numbers.py": "lesson_numbers.py",
    "check/judge.py": "lesson_judge.py",
    "check/judge.yaml": "lesson_judge.yaml",
    "check/numbers.py": "lesson_numbers.py",
    "solution/double.py": "lesson_start.py",
}

PROGRAM_FILES = {
    "python": {"{name}.py": "program_python.py", "diffbot_program.py": "diffbot_program.py"},
    "c": {"{name}.c": "program_c.c", "diffbot_program.h": "diffbot_program.h"},
    "node": {"{name}.js": "program_node.js"},
}
PROGRAM_LINES = {  # language: how it runs, and what to do before
    "python": ("python3 {name}.py", "# Python needs no build"),
    "c": ("./{name}", "cc -O2 -o {name} {name}.c -lm"),
    "node": ("node {name}.js", "# Node.js needs no build"),
}


def _part(help: str) -> Any:
    return option(help, metavar="PART")


class PartArguments(NamedTuple):
    """The parts of a robot; `composed_robot` checks their names."""

    board: str | None = _part("Board; the file is then composed of the parts.")
    driver: str | None = _part("Motor driver.")
    encoders: str | None = _part("none, one-channel (slotted discs; default) or two-channel.")
    imu: str | None = _part("IMU; default: none.")
    radio: str | None = _part("cable (default) or hc05.")
    slots: int | None = option(
        "Slots, or pulses of channel A, per turn of the wheel.", type=click.IntRange(1)
    )
    sensors: tuple[str, ...] = option(
        "--sensor", "Distance sensor in front. Repeatable: left, right, rear.", metavar="PART"
    )


PART_OPTIONS = ("--board", "--driver", "--encoders", "--imu", "--radio")


@group("Files", 1, "Write a robot, pipeline, block, ...")
def new() -> None:
    """Write a new robot, pipeline, trials, lesson, block or other part to start from."""


@new.command()
@exclusive("--kit", PART_OPTIONS, "a kit has its parts")
@needs(PART_OPTIONS[1:], ("--board",), "its pins depend on the board")
@needs(("--sensor", "--slots"), ("--board",), "the pins depend on the board")
def robot(
    name: str | None,
    parts: PartArguments,
    kit: str | None = option(
        "Kit to start from; without KIT: list the kits.",
        is_flag=False,
        flag_value="",
        metavar="[KIT]",
    ),
) -> None:
    """Write robots/NAME.yaml: all parts of a robot, with comments.

    NAME may be left out with --kit: it is then the kit's. With --board and --driver the file is
    composed of the parts, on pins that the board has for them.
    """
    if name is not None and parts.board is not None:
        compose(name, parts._asdict())
    elif kit is None and name is not None:
        write("robot", name)
    elif kit:
        _write_kit(kit, name)
    else:
        _list_kits(kit is None)


def compose(name: str, parts: dict[str, Any]) -> None:
    """Write the robot file of these parts, fields of RobotParts; None stands for the default.

    Raises UsageError for parts that do not fit together, and without a driver.
    """
    from diffbotctl.config.composed_robot import RobotParts, compose_robot

    chosen = {field: part for field, part in parts.items() if part is not None}
    if "driver" not in chosen:
        raise click.UsageError("--board needs --driver: the pins depend on both")
    fields = compose_robot(RobotParts(**chosen))
    write("robot", name, "composed_robot.yaml", fields)


class KitFile(NamedTuple):
    """A kit: what it is, its template, and what of it is not supported, if anything."""

    title: str
    template: str
    unsupported: str = ""


@cache
def kits() -> dict[str, KitFile]:
    """The kits that `new robot --kit` writes a robot file for."""
    from diffbotctl.parts import rows

    return {name: KitFile(**row) for name, row in rows("kits").items()}


def _list_kits(is_name_missing: bool) -> None:
    """Print the kits. Raises UsageError when a name was expected."""
    if is_name_missing:
        fix = "write `diffbotctl new robot NAME`, or `diffbotctl new robot --kit` for the kits"
        raise _refused("E-NAME", "new robot", "the robot has no name", fix)
    width = max(map(len, kits()))
    for name, kit in kits().items():
        note = " (its board is not supported)" if "our firmware" in kit.unsupported else ""
        click.echo(f"{name:{width}}  {kit.title}{note}")
    click.echo("\nWrite one: diffbotctl new robot --kit " + next(iter(kits())))


def _write_kit(name: str, robot_name: str | None) -> None:
    """Write the robot file of a kit. Raises UsageError for an unknown kit."""
    kit = kits().get(name)
    if kit is None:
        near = closest_match(name.lower().replace("-", "_"), kits())
        fix = f"did you mean {near}?" if near else f"the kits are {', '.join(kits())}"
        raise _refused("E-KIT", name, f"there is no kit '{name}'", fix)
    write("robot", robot_name or name, kit.template)
    if kit.unsupported:
        click.echo(f"note: {kit.unsupported}.")


@new.command()
def pipeline(name: str) -> None:
    """Write pipelines/NAME.yaml: goals and the blocks that drive to them."""
    write("pipeline", name)


@new.command()
def trials(name: str) -> None:
    """Write trials/NAME.yaml: simulated runs of a pipeline with faults, and what is expected."""
    write("trials", name)


@new.command()
def lesson(name: str) -> None:
    """Write lessons/NAME: a lesson for `diffbotctl learn`, with its text, solution and judge."""
    from diffbotctl.learn.course import LESSONS, ORDER

    _check_word(name, "lesson")
    if name in ORDER:
        cause = f"'{name}' is the name of a lesson of diffbotctl"
        raise _refused("E-NAME", name, cause, "choose another name")
    for path, template in LESSON_FILES.items():
        factor = "2.0 * " if path.startswith("solution") else ""
        fields = {"Name": name.replace("_", " ").capitalize(), "name": name, "factor": factor}
        _write(LESSONS / name / path, template, fields)
    click.echo(f"Now: diffbotctl learn check {name} --solution\n     diffbotctl learn next {name}")


@new.command()
def block(name: str) -> None:
    """Write the folder NAME: a block, its test, and a package that installs it."""
    _write_package(name, "block", BLOCK_FILES)


@new.command()
def message(name: str) -> None:
    """Write the folder NAME: a message type, a block that publishes it, and their package."""
    _write_package(name, "message", MESSAGE_FILES)


@new.command()
def driver(name: str) -> None:
    """Write the folder NAME: a driver that reads a device, its tests, and their package."""
    _write_package(name, "driver", DRIVER_FILES)


@new.command()
def program(
    name: str,
    language: str = choice_option(list(PROGRAM_FILES), "Language of the program."),
) -> None:
    """Write the folder NAME: a program in another process, and a pipeline that starts it."""
    _check_word(name, "program")
    run, build = (line.format(name=name) for line in PROGRAM_LINES[language])
    fields = {"name": name, "run": run, "build": build}
    files = {
        **PROGRAM_FILES[language],
        "{name}.yaml": "program_pipeline.yaml",
        "README.md": "program_readme.md",
    }
    for path, template in files.items():
        _write(Path(name) / path.format(name=name), template, fields)
    _place_schemas()
    click.echo(f"{name}/ is a program; its README.md explains how to run it.")


@new.command()
def schemas() -> None:
    """Write schemas/: with it editors check and complete robot, pipeline and view files.

    The other commands of `new` do so too. The first line of a file in robots/ or pipelines/ names
    its schema: `# yaml-language-server: $schema=../schemas/robot.schema.json`.
    """
    from diffbotctl.config.editor_schemas import FOLDER

    _place_schemas()
    click.echo(f"{FOLDER}/ is up to date")


def _write_package(name: str, what: str, files: dict[str, str]) -> None:
    """Write a package with a block called `name`. Raises UsageError for a name that is taken."""
    from diffbotctl.config import registry

    _check_word(name, what)
    taken = registry.driver_names() if what == "driver" else registry.names()
    if iskeyword(name) or name in taken:
        kind = "driver" if what == "driver" else "block"
        cause = "a keyword of Python" if iskeyword(name) else f"the name of an existing {kind}"
        raise _refused("E-NAME", name, f"'{name}' is {cause}", "choose another name")
    package = f"diffbot_{name}"
    fields = {
        "name": name,
        "Name": "".join(word.capitalize() for word in name.split("_")),
        "package": package,
        "project": package.replace("_", "-"),
    }
    for path, template in files.items():
        _write(Path(name) / path.format(**fields), template, fields)
    _place_schemas()
    click.echo(f"{name}/ is a package; its README.md explains how to install and run it.")


def write(
    kind: str, name: str, template: str = "", fields: Mapping[str, str] | None = None
) -> None:
    """Write a new file of the kind `robot`, `pipeline` or `trials`.

    `template`: default: the one of its kind. `fields`: values of it beside name and file. Raises
    UsageError when the file exists, and in a checkout of diffbotctl.
    """
    from diffbotctl.config import lookup

    _check_word(name, kind)
    path = Path(f"{kind.removesuffix('s')}s") / f"{name}.yaml"
    if lookup.is_shipped(path):  # calibration and `param save` would refuse to write it
        raise lookup.shipped_folder_error(path, "E-FILE-WRITE")
    _write(path, template or f"{kind}.yaml", {"name": name, "file": str(path), **(fields or {})})
    _place_schemas()
    also = {"robot": "wiring", "pipeline": "graph", "trials": "trials"}[kind]
    click.echo(f"Now: diffbotctl check {path}\n     diffbotctl {also} {path}")


def _place_schemas() -> None:
    """Write ./schemas, which the first lines of the templates name. Raises UsageError."""
    from diffbotctl.config.editor_schemas import FOLDER, place_schemas

    try:
        written = place_schemas()
    except OSError as error:
        cause = f"cannot be written: {error.strerror}"
        fix = "use a writable folder on a disk with free space"
        raise _refused("E-FILE-WRITE", str(FOLDER), cause, fix) from error
    if written:
        click.echo(f"written: {FOLDER}/, with which editors check and complete these files")


def _check_word(name: str, what: str) -> None:
    from diffbotctl.config.node_ports import is_name

    if not is_name(name):
        cause = f"'{name}' is not a valid {what} name: use lower-case letters, digits and _"
        likely = re.sub(r"\W+", "_", name.rpartition("/")[2]).lower()
        fix = f"such as {likely}" if is_name(likely) else "begin it with a letter"
        raise _refused("E-NAME", name, cause, fix)


def _write(path: Path, template: str, fields: dict[str, str]) -> None:
    """Write `template` with its `fields` filled in to the new file `path`."""
    source = folder("templates") / f"{template}.tmpl"
    text = Template(source.read_text(encoding="utf-8")).substitute(fields)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            _fill(path, file, text)
    except FileExistsError as error:
        fix = "choose another name, or move that file"
        raise _refused("E-FILE-WRITE", str(path), "the file exists", fix) from error
    except OSError as error:
        cause = f"cannot be written: {error.strerror}"
        fix = "use a writable folder on a disk with free space"
        raise _refused("E-FILE-WRITE", str(path), cause, fix) from error
    click.echo(f"written: {path}")


def _fill(path: Path, file: TextIO, text: str) -> None:
    """Write the whole text, or remove the file: a partial robot file would be found by its name."""
    try:
        file.write(text)
        file.flush()
    except OSError:
        path.unlink()
        raise


def _refused(code: str, place: str, cause: str, fix: str) -> Exception:
    return UsageError(Problem(code, place, cause, fix))
