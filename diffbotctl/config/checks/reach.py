"""The robot stops within what its sensor sees."""

from __future__ import annotations

from typing import Any

from diffbotctl.block import robot_fields
from diffbotctl.blocks.obstacle_stop import ObstacleStop, reaction_time, stopping_distance
from diffbotctl.blocks.range_sensor import REACH
from diffbotctl.config.case import Case
from diffbotctl.errors import Place


def check(case: Case) -> None:
    """Compare the stopping distance at full speed with the reach of each guarding sensor."""
    for name, kind in case.kinds.items():
        if issubclass(kind, ObstacleStop) and name in case.values:
            _check_guard(case, name, kind)


def _check_guard(case: Case, name: str, kind: type[ObstacleStop]) -> None:
    values = case.values[name]
    fields = {each: case.known(path) for each, path in robot_fields(kind).items()}
    speed = case.known("limits.speed")
    if speed is None or None in fields.values() or any(each is None for each in _used(values)):
        return
    robot: dict[str, Any] = {each: found[0] for each, found in fields.items() if found}
    reaction = values["reaction"]
    if reaction is None:
        reaction = reaction_time(
            robot["telemetry"], values["debounce"], robot["command_delay"], robot["lag"]
        )
    needed = stopping_distance(speed[0], robot["braking"], reaction)
    mounted = case.known(f"sensors.{values['sensor'] or next(iter(robot['sensors']), '')}.at.x")
    seen = REACH - (robot["front"] - mounted[0] if mounted else 0.0)
    if needed + values["margin"] <= seen:
        return
    cause = (
        f"from {speed[0]:g} m/s it takes {needed * 100:.0f} cm to stop ({reaction * 1000:.0f} ms "
        f"to react, then braking); the sensor sees {seen * 100:.0f} cm ahead of the front"
    )
    fix = (
        f"at most {_most(seen - values['margin'], robot['braking'], reaction):g} m/s stops in time"
    )
    place = _place(case, name, values["sensor"] or next(iter(robot["sensors"]), ""))
    if needed > seen:
        case.error("E-STOP-REACH", place, cause, fix)
    else:
        nearer = f"it would stand closer than the margin of {values['margin'] * 100:.0f} cm"
        case.warn("W-STOP-REACH", place, f"{cause}: {nearer}", fix)


def _used(values: dict[str, Any]) -> tuple[Any, ...]:
    return values["debounce"], values["margin"]


def _place(case: Case, name: str, sensor: str) -> Place | str:
    given = [case.at("blocks", name, "with", each) for each in ("reaction", "margin", "debounce")]
    fields = ("limits.speed", "limits.braking", f"sensors.{sensor}.at.x", "board.telemetry")
    return case.blame(*fields, also=given)


def _most(free: float, braking: float, reaction: float) -> float:
    """The highest speed, in steps of 1 cm/s, that stops within `free` metres."""
    speed = 0.0
    while stopping_distance(speed + 0.01, braking, reaction) <= free:
        speed += 0.01
    return round(speed, 2)
