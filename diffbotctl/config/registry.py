"""Which kinds of blocks and drivers there are, and the class behind each name.

A built-in name always means the built-in class, and is found without looking at what else is
installed, which takes 30 ms. A package that claims such a name too is reported by `clashes`, which
`check` and `blocks` call; of two other packages with one name neither is taken.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from diffbotctl.block import Block
from diffbotctl.errors import closest_match

BLOCKS = {
    "canvas": "diffbotctl.blocks.canvas:TurtleCanvas",
    "command_mux": "diffbotctl.blocks.command_mux:CommandMux",
    "diff_drive": "diffbotctl.blocks.diff_drive:DiffDrive",
    "goal_follower": "diffbotctl.blocks.goal_follower:GoalFollower",
    "listener": "diffbotctl.blocks.listener:Listener",
    "obstacle_stop": "diffbotctl.blocks.obstacle_stop:ObstacleStop",
    "odometry": "diffbotctl.blocks.odometry:OdometryBlock",
    "path": "diffbotctl.blocks.path:PathSource",
    "range_sensor": "diffbotctl.blocks.range_sensor:RangeSensor",
    "scan_stop": "diffbotctl.blocks.scan_stop:ScanStop",
    "speed_limiter": "diffbotctl.blocks.speed_limiter:SpeedLimiter",
    "talker": "diffbotctl.blocks.talker:Talker",
    "wander": "diffbotctl.blocks.wander:Wander",
    "wheel_speed": "diffbotctl.blocks.wheel_speed:WheelSpeed",
}

DRIVERS: dict[str, str] = {}

TABLES = {"diffbotctl.blocks": BLOCKS, "diffbotctl.drivers": DRIVERS}


MEND = "mend or remove the package that brings it"


class RegistryError(LookupError):
    """A name stands for no class, or for two; `fix` says what to do."""

    def __init__(self, code: str, cause: str, fix: str) -> None:
        super().__init__(cause)
        self.code = code
        self.fix = fix


def block(name: str) -> type[Block]:
    """The block class called `name`. Only its own module is imported. Raises RegistryError."""
    found, path = _found(name, "diffbotctl.blocks")
    if not (isinstance(found, type) and issubclass(found, Block)):
        cause = f"'{name}' ({path}) is no block: it does not derive from diffbotctl.block.Block"
        raise RegistryError("E-BLOCK-IMPORT", cause, MEND)
    return found


def driver(name: str) -> Any:
    """The driver called `name`. Raises RegistryError."""
    return _found(name, "diffbotctl.drivers")[0]


def names(group: str = "diffbotctl.blocks") -> list[str]:
    """Every known name of `group`, built in or from other packages."""
    return sorted({*TABLES[group], *(point.name for point in _entry_points(group))})


def clashes(group: str = "diffbotctl.blocks") -> list[RegistryError]:
    """The names that more than one package claims."""
    owners: dict[str, list[str]] = {name: ["diffbotctl"] for name in TABLES[group]}
    for point in _entry_points(group):
        owners.setdefault(point.name, []).append(_owner(point))
    return [_clash(name, packages) for name, packages in owners.items() if len(packages) > 1]


def _found(name: str, group: str) -> tuple[Any, str]:
    """What `name` stands for, imported, and its dotted path."""
    path = TABLES[group].get(name)
    if path is None:
        points = [point for point in _entry_points(group) if point.name == name]
        if not points:
            raise _unknown(name, group)
        if len(points) > 1:
            raise _clash(name, [_owner(point) for point in points])
        path = points[0].value
    module, _, attribute = path.partition(":")
    try:
        return getattr(import_module(module), attribute), path
    except Exception as error:
        cause = f"'{name}' ({path}) cannot be imported: {type(error).__name__}: {error}"
        raise RegistryError("E-BLOCK-IMPORT", cause, MEND) from error


def _unknown(name: str, group: str) -> RegistryError:
    known = names(group)
    near = closest_match(name, known)
    what = group.rsplit(".", 1)[1].removesuffix("s")
    fix = f"did you mean {near}?" if near else f"`diffbotctl blocks` lists them: {', '.join(known)}"
    return RegistryError("E-BLOCK-UNKNOWN", f"there is no {what} called '{name}'", fix)


def _clash(name: str, packages: list[str]) -> RegistryError:
    cause = f"the name '{name}' is claimed by {' and by '.join(packages)}"
    return RegistryError("E-BLOCK-CLASH", cause, "uninstall all but one of these packages")


def _owner(point: Any) -> str:
    return str(point.dist.name if point.dist else point.value)


def _entry_points(group: str) -> list[Any]:
    from importlib.metadata import entry_points

    return list(entry_points(group=group))
