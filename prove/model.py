"""The URDF of every shipped robot, as two parsers that know nothing of us read it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from math import cos, sin
from pathlib import Path
from typing import Any

from diffbotctl.config import lookup
from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import Robot
from diffbotctl.model.frames import ON_ROBOT
from diffbotctl.model.urdf import urdf
from tests.support.trials.row import Row, printed

MOST = 1e-9  # m, and of a rotation's matrix


def by_yourdfpy(path: Path) -> dict[str, Any]:
    """Every link's place above the ground, as 4 x 4 matrices."""
    import yourdfpy

    read = yourdfpy.URDF.load(str(path), load_meshes=False)
    if not read.validate():
        raise ValueError(str(read.errors))
    return {link: read.get_transform(link, "base_footprint") for link in read.link_map}


def by_urchin(path: Path) -> dict[str, Any]:
    """The same by another parser."""
    import urchin

    return {link.name: place for link, place in urchin.URDF.load(str(path)).link_fk().items()}


PARSERS = (by_yourdfpy, by_urchin)


def expected(robot: Robot) -> Iterator[tuple[str, tuple[float, float, float], float]]:
    """Place (m, over the ground) and heading of each wheel and sensor, straight from the file."""
    drive = robot.drive
    left, right = drive.left.wheel.diameter / 2, drive.right.wheel.diameter / 2
    axle = (left + right) / 2
    yield "left_wheel_link", (0.0, drive.track / 2, left), 0.0
    yield "right_wheel_link", (0.0, -drive.track / 2, right), 0.0
    for name, sensor in robot.sensors.items():
        if sensor.type in ON_ROBOT:
            at = sensor.at
            yield f"{name}_sensor_link", (at.x, at.y, axle + at.z), at.heading


def error(places: dict[str, Any], robot: Robot) -> float:
    """The largest difference of any number of any wheel's or sensor's place."""
    most = 0.0
    for name, position, heading in expected(robot):
        place = places[name]
        turned = ((cos(heading), -sin(heading)), (sin(heading), cos(heading)))
        for i in range(3):
            most = max(most, abs(place[i][3] - position[i]))
        for i in range(2):
            most = max(most, *(abs(place[i][j] - turned[i][j]) for j in range(2)))
    return most


def rows() -> Iterator[Row]:
    """Accepted by both, and how far off at most."""
    accepted, most, names = 0, 0.0, lookup.names("robots")
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            robot = load_robot(name).robot
            path = Path(folder) / f"{name}.urdf"
            path.write_text(urdf(robot, name))
            for parse in PARSERS:
                try:
                    most = max(most, error(parse(path), robot))
                except Exception as refusal:
                    print(f"{parse.__name__} refuses {name}: {refusal}")
                else:
                    accepted += 1
    wants = len(names) * len(PARSERS)
    yield Row(
        f"URDF of {len(names)} robots accepted by 2 parsers",
        f"{accepted} of {wants}",
        f"{wants}",
        accepted == wants,
    )
    yield Row("URDF: wheel and sensor poses off the file's", f"{most:.1e}", "<= 1e-9", most <= MOST)


if __name__ == "__main__":
    raise SystemExit(printed(rows()) > 0)
