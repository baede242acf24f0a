"""What stands and moves on the map: walls, way, trail, beam, doubt, robot and goal.

A robot's drawing in characters, on the same dots as the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin, sqrt

from rich.text import Text

from diffbotctl.messages import Goal, Odometry, Path, Range, Scan
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene, SceneBeam
from diffbotctl.render.robot_views import DrawingView
from diffbotctl.ui import run_text
from diffbotctl.ui.map.canvas import (
    ACROSS,
    DOWN,
    Camera,
    MapCanvas,
    MapLayer,
    Point,
    fit_camera,
    scale_bar,
)
from diffbotctl.ui.map.trail import TurtleTrail

OUTLINE_MIN_DOTS = 8.0  # dots; a robot that is drawn smaller is an arrow only
SIGMAS = 3.0  # the ellipse of doubt holds 99 of 100 true positions
BEAM_HALF_ANGLE = 0.09  # rad; the Sharp sensors' beam is about 10 degrees wide (data sheet)
HEADING_LINE_CHARACTERS = 6.0  # characters of the line that shows a goal's heading
START_MARGIN_M = 0.1  # m of floor kept in view about the start


def overview_camera(
    scene: Scene, picture: RunSnapshot, trail: Sequence[Point], width: int, height: int
) -> Camera:
    """The camera that has robot, trail and goal in view."""
    seen: list[Point] = [
        *trail,
        (-START_MARGIN_M, -START_MARGIN_M),
        (START_MARGIN_M, START_MARGIN_M),
    ]
    if scene.field:
        return fit_camera([*scene.field], width, height)
    odometry, goal = run_text.newest_odometry(picture), run_text.newest_message(picture, Goal)
    if odometry is not None:
        seen += robot_corners(scene, odometry)
    if isinstance(goal, Goal) and goal.number:
        seen.append((goal.x, goal.y))
    return fit_camera(seen, width, height)


def draw_map(
    scene: Scene,
    picture: RunSnapshot,
    trail: Sequence[Point],
    camera: Camera,
    width: int,
    height: int,
    plain: bool = False,
    sheet: TurtleTrail | None = None,
) -> MapCanvas:
    """The map of a picture. Without UTF-8 (`plain`) in letters.

    `sheet`: what a turtle has drawn, in place of the trail.
    """
    looks = sheet.looks if sheet is not None else None
    drawing = MapCanvas(camera, width, height, plain, looks.background if looks else "")
    for wall in scene.walls:
        drawing.line((wall[0], wall[1]), (wall[2], wall[3]), MapLayer.WALL)
    for x, y, radius in scene.rounds:
        drawing.round((x, y), radius, MapLayer.WALL)
    if sheet is not None and looks is not None:
        for start, end, ink in sheet.lines:
            drawing.stroke(start, end, ink)
        for place, heading in sheet.turtles:
            drawing.arrow(place, heading, "bold yellow")
    else:
        drawing.lines(trail, MapLayer.TRAIL)
    odometry = run_text.newest_odometry(picture)
    _goal(drawing, picture, odometry)
    if odometry is not None:
        for beam in scene.beams:
            _beam(drawing, odometry, beam, picture.messages.get(beam.topic))
        _doubt(drawing, odometry)
        _robot(drawing, scene, odometry)
    drawing.write(0, height - 1, scale_bar(camera, width, plain))
    return drawing


def robot_corners(scene: Scene, pose: Odometry) -> list[Point]:
    """The robot's outline in odom, closed, from the front left corner on."""
    body = scene.robot
    if body is None:
        return [(pose.x, pose.y)]
    side = body.width / 2
    around = [(body.front, side), (body.front, -side), (-body.back, -side), (-body.back, side)]
    return [to_odom(pose, *corner) for corner in (*around, around[0])]


def to_odom(pose: Odometry, forward: float, left: float) -> Point:
    """A place of base_link in odom."""
    c, s = cos(pose.heading), sin(pose.heading)
    return pose.x + c * forward - s * left, pose.y + s * forward + c * left


def _robot(drawing: MapCanvas, scene: Scene, pose: Odometry) -> None:
    body = scene.robot
    if body is not None and (body.front + body.back) * drawing.camera.scale >= OUTLINE_MIN_DOTS:
        drawing.lines(robot_corners(scene, pose), MapLayer.ROBOT)
        drawing.line(to_odom(pose, 0, 0), to_odom(pose, body.front, 0), MapLayer.ROBOT)
    drawing.arrow((pose.x, pose.y), pose.heading, "bold green")


def _goal(drawing: MapCanvas, picture: RunSnapshot, pose: Odometry | None) -> None:
    path = run_text.newest_message(picture, Path)
    if isinstance(path, Path):
        drawing.lines([(goal.x, goal.y) for goal in path.goals], MapLayer.WAY, every=2)
        for each in path.goals:
            drawing.mark((each.x, each.y), "+", "magenta")
    goal = run_text.newest_message(picture, Goal)
    if not isinstance(goal, Goal) or not goal.number:
        return
    if pose is not None:
        drawing.line((pose.x, pose.y), (goal.x, goal.y), MapLayer.WAY, every=4)
    mark_goal(drawing, (goal.x, goal.y), goal.heading)


def mark_goal(drawing: MapCanvas, at: Point, heading: float | None) -> None:
    """A goal, with a line towards its heading."""
    if heading is not None:
        length = HEADING_LINE_CHARACTERS * ACROSS / drawing.camera.scale
        drawing.line(
            at, (at[0] + length * cos(heading), at[1] + length * sin(heading)), MapLayer.GOAL
        )
    drawing.mark(at, "X" if drawing.plain else "◎", "bold magenta")


def _beam(drawing: MapCanvas, pose: Odometry, beam: SceneBeam, reading: object) -> None:
    if isinstance(reading, Scan):
        _scan(drawing, pose, beam, reading)
    if not isinstance(reading, Range):
        return
    length = reading.distance if reading.state == "measured" else beam.reach
    if reading.state in ("too_close", "fault"):
        length = 0.0
    start = to_odom(pose, beam.x, beam.y)
    heading = pose.heading + beam.heading
    ends = [
        (start[0] + length * cos(heading + turn), start[1] + length * sin(heading + turn))
        for turn in (-BEAM_HALF_ANGLE, BEAM_HALF_ANGLE)
    ]
    for end in ends:
        drawing.line(start, end, MapLayer.BEAM, every=2)
    if reading.state == "measured":
        drawing.line(ends[0], ends[1], MapLayer.SCAN)


def _scan(drawing: MapCanvas, pose: Odometry, eye: SceneBeam, scan: Scan) -> None:
    """A dot where each ray of a laser scanner met something."""
    x, y = to_odom(pose, eye.x, eye.y)
    first = pose.heading + eye.heading + scan.start
    for i, far in enumerate(scan.distances):
        if 0.0 < far <= eye.reach:
            turn = first + i * scan.step
            drawing.dot((x + far * cos(turn), y + far * sin(turn)), MapLayer.SCAN)


def _doubt(drawing: MapCanvas, pose: Odometry) -> None:
    """The ellipse that holds the true position, when it is large enough to be seen."""
    long, short, turn = covariance_ellipse(pose.covariance)
    if long * drawing.camera.scale < 1.0:
        return
    c, s = cos(turn), sin(turn)
    steps = 32
    around = [
        (long * cos(2 * pi * i / steps), short * sin(2 * pi * i / steps)) for i in range(steps + 1)
    ]
    drawing.lines(
        [
            (pose.x + c * along - s * aside, pose.y + s * along + c * aside)
            for along, aside in around
        ],
        MapLayer.DOUBT,
    )


def covariance_ellipse(covariance: Sequence[float]) -> tuple[float, float, float]:
    """Half axes (m, at SIGMAS) and direction (rad, odom) of a position's ellipse.

    `covariance` is the upper triangle of (x, y, heading) as `Odometry` has it; the axes are the
    square roots of the eigenvalues of its upper left 2x2 block.
    """
    xx, xy, yy = covariance[0], covariance[1], covariance[3]
    middle, half = (xx + yy) / 2, hypot((xx - yy) / 2, xy)
    long, short = sqrt(max(middle + half, 0.0)), sqrt(max(middle - half, 0.0))
    return SIGMAS * long, SIGMAS * short, atan2(2 * xy, xx - yy) / 2


ROBOT_VIEW_MAX_COLUMNS = 72  # characters; a robot drawn wider is no clearer
ROBOT_VIEW_MAX_ROWS = 22  # lines; both views then fit on most terminals
ROBOT_VIEW_BORDER_DOTS = 6  # dots that are kept free at the sides


def render_robot_view(view: DrawingView, width: int) -> Text:
    """`view` within `width` characters: its title, the drawing, and its lengths."""
    points = [point for outline in view.outlines for point in outline.points]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    wide, high = max(xs) - min(xs), max(ys) - min(ys)
    across = min(width - 2, ROBOT_VIEW_MAX_COLUMNS)
    scale = min(
        (across * ACROSS - ROBOT_VIEW_BORDER_DOTS) / wide,
        (ROBOT_VIEW_MAX_ROWS * DOWN - ROBOT_VIEW_BORDER_DOTS) / high,
    )
    rows = int(high * scale / DOWN) + 2
    camera = Camera((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2, scale)
    drawing = MapCanvas(camera, across, rows)
    for outline in view.outlines:
        line = outline.points + outline.points[:1] if outline.closed else outline.points
        drawing.lines(line, MapLayer.SCAN if outline.colour == "red" else MapLayer.TRAIL)
    lengths = ", ".join(dimension.label for dimension in view.dimensions)
    return Text.assemble((f"{view.title}: ", "bold"), lengths, "\n", drawing.text())
