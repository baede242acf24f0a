"""The picture in docs/kinematics.md: the robot on a quarter of a circle, to scale."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from pathlib import Path

from diffbotctl.config.load import load_robot
from diffbotctl.config.robot import Robot
from diffbotctl.estimation.pose_filter import arc
from diffbotctl.geometry.footprint import out_of_frame
from diffbotctl.render.robot_drawing import (
    Dimension,
    DrawingOutline,
    DrawingView,
    drawing_svg,
    top_view,
)

PAGE = Path(__file__).parents[3] / "docs" / "kinematics.svg"
RADIUS = 0.3  # m
STEPS = 45  # of the drawn paths
SHOWN = (0.0, 1.0)  # shares of the way at which the robot is drawn


def pose_at(robot: Robot, share: float) -> tuple[float, float, float]:
    """Where the robot is after `share` of the quarter circle."""
    half, turn = robot.drive.track / 2, share * pi / 2
    return arc(0, 0, 0, (RADIUS - half) * turn, (RADIUS + half) * turn, robot.drive.track)


def outlines(robot: Robot) -> Iterator[DrawingOutline]:
    """The paths of both wheels and of the middle between them, and the robot at both ends."""
    for share in SHOWN:
        pose = pose_at(robot, share)
        for part in top_view(robot).outlines:
            if part.closed:
                yield part._replace(points=tuple(out_of_frame(list(part.points), *pose)))
    half = robot.drive.track / 2
    poses = [pose_at(robot, step / STEPS) for step in range(STEPS + 1)]
    for name, aside in (("left wheel's way", half), ("middle's way", 0.0), ("right's", -half)):
        points = tuple(out_of_frame([(0.0, aside)], *pose)[0] for pose in poses)
        yield DrawingOutline(name, "red" if not aside else "grey", points, closed=False)
    corner = 0.01  # m; a small cross at the centre of rotation
    yield DrawingOutline("ICC", "red", ((-corner, RADIUS), (corner, RADIUS)), closed=False)
    yield DrawingOutline("ICC", "red", ((0, RADIUS - corner), (0, RADIUS + corner)), closed=False)


def picture() -> str:
    """The picture as SVG."""
    robot = load_robot("book_2wd").robot
    radius = Dimension((0.0, 0.0), (0.0, RADIUS), f"R = {RADIUS * 1000:.0f} mm")
    view = DrawingView("a quarter of a circle about the ICC", tuple(outlines(robot)), (radius,))
    return drawing_svg("book_2wd", [view])


if __name__ == "__main__":
    PAGE.write_text(picture())
