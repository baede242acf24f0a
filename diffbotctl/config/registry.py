"""Registry of blocks and drivers: finds the class of one by its name.

A built-in name always means the built-in class; it is found without searching the installed
packages, which takes 30 ms. `clashes` reports packages that register a built-in name too. When two
other packages register one name, neither is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from diffbotctl.block import Block, DeclarationError
from diffbotctl.device import DeviceDriver
from diffbotctl.errors import Place, closest_match
from diffbotctl.message_types import type_name, type_problem
from diffbotctl.messages import BUILT_IN, STD_MSGS
from diffbotctl.physics_model import Plant

ENTRY_POINT_GROUP = "diffbotctl.blocks"
MESSAGES_GROUP = "diffbotctl.messages"
DRIVERS_GROUP = "diffbotctl.drivers"
PLANTS_GROUP = "diffbotctl.plants"
BLOCKS_FOLDER = Path(__file__).parents[1] / "blocks"
# A built-in block is the class in the module of its name.
BLOCKS = {
    path.stem: f"diffbotctl.blocks.{path.stem}" for path in sorted(BLOCKS_FOLDER.glob("[a-z]*.py"))
}
DRIVERS = {
    "joystick": "diffbotctl.drivers.joystick:Joystick",
    "lidar": "diffbotctl.drivers.lidar:Lidar",
    "map_builder": "diffbotctl.drivers.map_builder:MapSource",
    "rosserial": "diffbotctl.drivers.rosserial:Rosserial",
}

IMPORT_FIX = "correct or remove the package that provides it"
INSTALL_FIX = (
    "install its package, `pip install -e FOLDER` for one of your own, or use one that "
    "`diffbotctl blocks` lists"
)
Kind = TypeVar("Kind")


class RegistryError(LookupError):
    """A name has no class, or more than one; `fix` is the remedy.

    `place`: the line of the user's code that is wrong.
    """

    def __init__(self, code: str, cause: str, fix: str, place: Place | None = None) -> None:
        super().__init__(cause)
        self.code = code
        self.fix = fix
        self.place = place


def block(name: str) -> type[Block]:
    """The block class called `name`. Only its own module is imported. Raises RegistryError."""
    return _class(name, BLOCKS, ENTRY_POINT_GROUP, Block)


def driver(name: str) -> type[DeviceDriver]:
    """The driver class called `name`. Raises RegistryError."""
    return _class(name, DRIVERS, DRIVERS_GROUP, DeviceDriver)


def plant(name: str) -> type[Plant]:
    """The class of physics called `name`, of another package. Raises RegistryError."""
    return _class(name, {}, PLANTS_GROUP, Plant)


def _class(name: str, built_in: Mapping[str, str], group: str, base: type[Kind]) -> type[Kind]:
    """The class derived from `base` that a name stands for. Raises RegistryError."""
    path = built_in.get(name) or _path_in_packages(name, group)
    candidate = _attribute(name, path)
    if isinstance(candidate, type) and issubclass(candidate, base):
        return candidate
    cause = f"'{name}' ({path}) is not derived from {base.__module__}.{base.__name__}"
    raise RegistryError("E-BLOCK-IMPORT", cause, IMPORT_FIX)


def driver_names() -> list[str]:
    """Every known driver, built in or from other packages."""
    return sorted({*DRIVERS, *(point.name for point in _entry_points(DRIVERS_GROUP))})


def names() -> list[str]:
    """Every known name, built in or from other packages."""
    return sorted({*BLOCKS, *(point.name for point in _entry_points())})


def clashes() -> list[RegistryError]:
    """The names that more than one package registers."""
    owners: dict[str, list[str]] = {name: ["diffbotctl"] for name in BLOCKS}
    for point in _entry_points():
        owners.setdefault(point.name, []).append(_owner(point))
    return [_clash(name, packages) for name, packages in owners.items() if len(packages) > 1]


def message_names() -> list[str]:
    """Every message type that a file may name, built in or from other packages."""
    return sorted([*BUILT_IN, *_message_points()], key=lambda name: ("/" in name, name))


def message_type(name: str) -> type:
    """The message class with this identity: `Range`, `my_package/Face`. Raises RegistryError.

    The types of std_msgs may be written as in ROS: `Int32` or `std_msgs/Int32`. A class of another
    package is found by the entry point `diffbotctl.messages`: a file never names a module to
    import.
    """
    short = name.removeprefix("std_msgs/")
    if short in STD_MSGS:
        return STD_MSGS[short]
    if name in BUILT_IN:
        return BUILT_IN[name]
    points = _message_points()
    if name not in points:
        names = message_names()
        known = [*names, "String"]
        near = closest_match(name, known) or closest_match(name.rpartition("/")[2], known)
        fix = (
            f"did you mean {near}?"
            if near
            else f"`diffbotctl types` lists them: {', '.join(names)}"
        )
        raise RegistryError("E-MESSAGE-TYPE", f"there is no message type '{name}'", fix)
    kind = _attribute(name, points[name])
    problem = type_problem(kind) if isinstance(kind, type) else ("it is no class", "correct it")
    if problem is not None or type_name(kind) != name:
        cause, fix = problem or (f"its class is {type_name(kind)}", "correct the entry point")
        raise RegistryError("E-MESSAGE-TYPE", f"{name} is no message: {cause}", fix)
    return cast(type, kind)


def _message_points() -> dict[str, str]:
    """The message types of other packages, each with `module:Class`."""
    return {
        f"{point.value.partition('.')[0]}/{point.name}": point.value
        for point in _entry_points(MESSAGES_GROUP)
    }


def _attribute(name: str, path: str) -> Any:
    """What `module:attribute` leads to; of a module alone its block. Raises RegistryError."""
    name_of_module, _, attribute = path.partition(":")
    try:
        module = import_module(name_of_module)
        return getattr(module, attribute) if attribute else _own_block(module)
    except DeclarationError as error:
        raise RegistryError("E-BLOCK-IMPORT", f"'{name}' ({path}): {error}", error.fix) from error
    except Exception as error:
        cause = f"'{name}' ({path}) cannot be imported: {type(error).__name__}: {error}"
        raise RegistryError("E-BLOCK-IMPORT", cause, IMPORT_FIX) from error


def _own_block(module: ModuleType) -> type:
    """The one class that the module defines and that is a block. Raises ValueError."""
    classes = [kind for kind in vars(module).values() if isinstance(kind, type)]
    (own,) = (
        kind for kind in classes if issubclass(kind, Block) and kind.__module__ == module.__name__
    )
    return own


def _path_in_packages(name: str, group: str) -> str:
    """`module:Class` of the one other package that has a block or driver called `name`."""
    points = [point for point in _entry_points(group) if point.name == name]
    if len(points) > 1:
        raise _clash(name, [_owner(point) for point in points])
    if points:
        return str(points[0].value)
    if group == PLANTS_GROUP:
        fix = "write ./my_plant.py:MyPlant, or install the package that has it"
        raise RegistryError("E-BLOCK-UNKNOWN", f"there is no plant '{name}'", fix)
    is_driver = group == DRIVERS_GROUP
    known = driver_names() if is_driver else names()
    near, listed = closest_match(name, known), ", ".join(known)
    fix = f"there are {listed}" if is_driver else f"{INSTALL_FIX}: {listed}"
    code, kind = ("E-SOURCE", "driver") if is_driver else ("E-BLOCK-UNKNOWN", "block")
    fix = f"did you mean {near}?" if near else fix
    raise RegistryError(code, f"there is no {kind} '{name}'", fix)


def _clash(name: str, packages: list[str]) -> RegistryError:
    cause = f"the name '{name}' is registered by {' and by '.join(packages)}"
    return RegistryError("E-BLOCK-CLASH", cause, "uninstall all but one of these packages")


def _owner(point: Any) -> str:
    return str(point.dist.name if point.dist else point.value)


def _entry_points(group: str = ENTRY_POINT_GROUP) -> list[Any]:
    from importlib.metadata import entry_points  # 30 ms; not needed for built-in blocks

    return list(entry_points(group=group))
