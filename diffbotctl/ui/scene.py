"""What a map draws that does not change during a run, as the control socket's `scene` tells it."""

from __future__ import annotations

from typing import Any, NamedTuple


class Outline(NamedTuple):
    """The robot from above, in metres from the middle of its axle; wheels and limits beside it."""

    front: float
    back: float
    width: float
    track: float
    left_diameter: float
    right_diameter: float
    speed: float  # m/s
    turn_rate: float  # rad/s


class Beam(NamedTuple):
    """A distance sensor in base_link: metres and radians, and the topic that has its distances."""

    topic: str
    x: float
    y: float
    heading: float
    reach: float


class Scene(NamedTuple):
    """Walls are (x1, y1, x2, y2), round obstacles (x, y, radius), metres in the pose's frame.

    `field`: the corners of a field that is always shown whole; empty: what matters is shown.
    """

    title: str
    simulated: str
    walls: tuple[tuple[float, ...], ...] = ()
    rounds: tuple[tuple[float, ...], ...] = ()
    robot: Outline | None = None
    beams: tuple[Beam, ...] = ()
    field: tuple[tuple[float, float], ...] = ()


def scene_of(said: dict[str, Any]) -> Scene:
    """The scene from the answer of the verb."""
    robot = said["robot"]
    return Scene(
        said["title"],
        said["simulated"],
        tuple(tuple(wall) for wall in said["walls"]),
        tuple(tuple(thing) for thing in said["rounds"]),
        None if robot is None else Outline(**robot),
        tuple(Beam(**beam) for beam in said["sensors"]),
        tuple((x, y) for x, y in said.get("field", ())),
    )
