"""What the map draws: walls, path, trail, beams, uncertainty, robot and goal; a robot's drawing."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin, sqrt

from rich.text import Text

from diffbotctl.geometry.footprint import arc_motion
from diffbotctl.messages import Goal, MapPose, Odometry, Path, Range, Scan
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.render.map_scene import Scene, SceneBeam
from diffbotctl.render.robot_drawing import DrawingView
from diffbotctl.time import SECOND
from diffbotctl.ui.map.canvas import (
    DOTS_ACROSS,
    DOTS_DOWN,
    Camera,
    MapCanvas,
    MapLayer,
    Point,
    fit_camera,
    scale_bar,
)
from diffbotctl.ui.map.state import MapState
from diffbotctl.ui.run_text import newest_message, newest_odometry

OUTLINE_MIN_DOTS = 8.0  # a robot that is drawn smaller is an arrow only
ELLIPSE_SIGMAS = 3.0  # the ellipse contains the true position in 99 of 100 cases
ELLIPSE_CORNERS = 32
BEAM_HALF_ANGLE = 0.09  # rad; the Sharp sensors' beam is about 10 degrees wide (data sheet)
HEADING_LINE_CHARACTERS = 6.0  # length of the line that shows a goal's heading
REWIND_MAX = SECOND // 2  # of a pose to the time of a scan; earlier velocities are not known
START_MARGIN_M = 0.1  # floor kept in view around the start


def overview_camera(state: MapState, width: int, height: int) -> Camera:
    """The camera that has robot, trail and goal in view."""
    scene, margin = state.scene, START_MARGIN_M
    if scene.field:
        return fit_camera(scene.field, width, height)
    points: list[Point] = [*state.trail.points, (-margin, -margin), (margin, margin)]
    odometry, goal = newest_odometry(state.snapshot), newest_message(state.snapshot, Goal)
    if odometry is not None:
        points += robot_corners(scene, odometry)
    points += mapped_points(state)
    if goal is not None and goal.number:
        points.append((goal.x, goal.y))
    return fit_camera(points, width, height)


def draw_map(
    state: MapState, camera: Camera, width: int, height: int, plain: bool = False
) -> MapCanvas:
    """The map in a window of `width` x `height` characters. Without UTF-8 (`plain`) in letters."""
    scene, snapshot, turtle = state.scene, state.snapshot, state.turtle
    background = "" if turtle.canvas is None else turtle.canvas.background
    canvas = MapCanvas(camera, width, height, plain, background)
    for wall in scene.walls:
        canvas.line((wall[0], wall[1]), (wall[2], wall[3]), MapLayer.WALL)
    for x, y, radius in scene.rounds:
        canvas.circle((x, y), radius, MapLayer.WALL)
    for point in mapped_points(state):
        canvas.point(point, MapLayer.MAP)
    if turtle.canvas is None:
        canvas.lines(state.trail.points, MapLayer.TRAIL)
    for line in turtle.lines:
        canvas.wide_line(line.start, line.end, MapLayer.TRAIL, line.width, line.colour)
    for place, heading in turtle.others:
        canvas.arrow(place, heading, "bold yellow")
    odometry = newest_odometry(snapshot)
    _draw_goals(canvas, snapshot, odometry)
    if odometry is not None and turtle.has_first:
        for beam in scene.beams:
            message = snapshot.messages.get(beam.topic)
            if isinstance(message, Scan):
                _draw_scan(canvas, odometry, beam, message)
            elif isinstance(message, Range):
                _draw_beam(canvas, odometry, beam, message)
        _draw_uncertainty(canvas, odometry)
        _draw_robot(canvas, scene, odometry)
    walls = f"   {'#' if plain else '▐'} wall" if scene.walls or scene.rounds else ""
    canvas.write(0, height - 1, scale_bar(camera, width, plain) + walls)
    return canvas


def mapped_points(state: MapState) -> list[Point]:
    """The occupied cells of the robot's map, in odom."""
    pose = newest_message(state.snapshot, MapPose)
    if pose is None:
        return []
    x, y, heading = pose.odom
    c, s = cos(heading), sin(heading)
    return [
        (c * (px - x) + s * (py - y), c * (py - y) - s * (px - x))
        for px, py in state.tiles.occupied()
    ]


def robot_corners(scene: Scene, pose: Odometry) -> list[Point]:
    """The robot's outline in odom, closed, starting at the front left corner."""
    body = scene.robot
    if body is None:
        return [(pose.x, pose.y)]
    side = body.width / 2
    corners = [(body.front, side), (body.front, -side), (-body.back, -side), (-body.back, side)]
    return [to_odom(pose, *corner) for corner in (*corners, corners[0])]


def to_odom(pose: Odometry, forward: float, left: float) -> Point:
    """A position in base_link, transformed to odom."""
    c, s = cos(pose.heading), sin(pose.heading)
    return pose.x + c * forward - s * left, pose.y + s * forward + c * left


def pose_at(pose: Odometry, time: int) -> Odometry:
    """The pose at a time shortly before `pose`, had the velocity been the same since then."""
    since = min(max(pose.time - time, 0), REWIND_MAX) / SECOND
    x, y, turn = arc_motion(pose.linear, pose.angular, -since)
    place = to_odom(pose, x, y)
    return pose._replace(time=time, x=place[0], y=place[1], heading=pose.heading + turn)


def _draw_robot(canvas: MapCanvas, scene: Scene, pose: Odometry) -> None:
    body = scene.robot
    if body is not None and (body.front + body.back) * canvas.camera.scale >= OUTLINE_MIN_DOTS:
        canvas.lines(robot_corners(scene, pose), MapLayer.ROBOT)
        canvas.line(to_odom(pose, 0, 0), to_odom(pose, body.front, 0), MapLayer.ROBOT)
    canvas.arrow((pose.x, pose.y), pose.heading, "bold green")


def _draw_goals(canvas: MapCanvas, snapshot: RunSnapshot, pose: Odometry | None) -> None:
    path, goal = newest_message(snapshot, Path), newest_message(snapshot, Goal)
    if path is not None:
        canvas.lines([(waypoint.x, waypoint.y) for waypoint in path.goals], MapLayer.PATH, every=2)
        for waypoint in path.goals:
            canvas.mark((waypoint.x, waypoint.y), "+", "magenta")
    if goal is None or not goal.number:
        return
    if pose is not None:
        canvas.line((pose.x, pose.y), (goal.x, goal.y), MapLayer.PATH, every=4)
    mark_goal(canvas, (goal.x, goal.y), goal.heading)


def mark_goal(canvas: MapCanvas, place: Point, heading: float | None) -> None:
    if heading is not None:
        length = HEADING_LINE_CHARACTERS * DOTS_ACROSS / canvas.camera.scale
        canvas.line(place, _ray(place, heading, length), MapLayer.GOAL)
    canvas.mark(place, "X" if canvas.plain else "◎", "bold magenta")


def _ray(start: Point, heading: float, length: float) -> Point:
    """The point `length` m from `start` in the direction of `heading`."""
    return start[0] + length * cos(heading), start[1] + length * sin(heading)


def _draw_beam(canvas: MapCanvas, pose: Odometry, beam: SceneBeam, reading: Range) -> None:
    match reading.state:
        case "measured":
            length = reading.distance
        case "too_close" | "fault":
            length = 0.0
        case "clear":
            length = beam.reach
    start, heading = to_odom(pose, beam.x, beam.y), pose.heading + beam.heading
    right, left = (
        _ray(start, heading + turn, length) for turn in (-BEAM_HALF_ANGLE, BEAM_HALF_ANGLE)
    )
    canvas.line(start, right, MapLayer.BEAM, every=2)
    canvas.line(start, left, MapLayer.BEAM, every=2)
    if reading.state == "measured":
        canvas.line(right, left, MapLayer.SCAN)


def _draw_scan(canvas: MapCanvas, pose: Odometry, scanner: SceneBeam, scan: Scan) -> None:
    """A dot where each ray of a laser scanner met something.

    From the pose in the middle of the turn: the robot has moved on since, what it met has not.
    """
    pose = pose_at(pose, scan.time - round(0.5 * SECOND * scan.duration))
    start, first = to_odom(pose, scanner.x, scanner.y), pose.heading + scanner.heading + scan.start
    for i, distance in enumerate(scan.distances):
        if 0.0 < distance <= scanner.reach:
            canvas.point(_ray(start, first + i * scan.step, distance), MapLayer.SCAN)


def _draw_uncertainty(canvas: MapCanvas, pose: Odometry) -> None:
    """The ellipse that contains the true position, when it is large enough to be seen."""
    major, minor, direction = covariance_ellipse(pose.covariance)
    if major * canvas.camera.scale < 1.0:
        return
    c, s = cos(direction), sin(direction)
    corners = []
    for i in range(ELLIPSE_CORNERS + 1):
        turn = 2 * pi * i / ELLIPSE_CORNERS
        along, across = major * cos(turn), minor * sin(turn)
        corners.append((pose.x + c * along - s * across, pose.y + s * along + c * across))
    canvas.lines(corners, MapLayer.UNCERTAINTY)


def covariance_ellipse(covariance: Sequence[float]) -> tuple[float, float, float]:
    """Half axes (m, at ELLIPSE_SIGMAS) and direction (rad, odom) of a position's ellipse.

    `covariance` is the upper triangle of (x, y, heading) as `Odometry` has it; the axes are the
    square roots of the eigenvalues of its upper left 2x2 block.
    """
    xx, xy, yy = covariance[0], covariance[1], covariance[3]
    middle, half = (xx + yy) / 2, hypot((xx - yy) / 2, xy)
    major, minor = sqrt(max(middle + half, 0.0)), sqrt(max(middle - half, 0.0))
    return ELLIPSE_SIGMAS * major, ELLIPSE_SIGMAS * minor, atan2(2 * xy, xx - yy) / 2


ROBOT_VIEW_MAX_COLUMNS = 72  # a robot drawn wider is no clearer
ROBOT_VIEW_MAX_ROWS = 22  # both views then fit on most terminals
ROBOT_VIEW_BORDER_DOTS = 6  # kept free at the sides


def render_robot_view(view: DrawingView, width: int) -> Text:
    """A drawing of the robot within `width` characters: its title, its lengths, the outlines."""
    xs, ys = zip(*(point for outline in view.outlines for point in outline.points), strict=True)
    x_span, y_span = max(xs) - min(xs), max(ys) - min(ys)
    columns = min(width - 2, ROBOT_VIEW_MAX_COLUMNS)
    scale = min(
        (columns * DOTS_ACROSS - ROBOT_VIEW_BORDER_DOTS) / x_span,
        (ROBOT_VIEW_MAX_ROWS * DOTS_DOWN - ROBOT_VIEW_BORDER_DOTS) / y_span,
    )
    camera = Camera((max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2, scale)
    canvas = MapCanvas(camera, columns, int(y_span * scale / DOTS_DOWN) + 2)
    for outline in view.outlines:
        corners = outline.points + outline.points[:1] if outline.closed else outline.points
        canvas.lines(corners, MapLayer.SCAN if outline.colour == "red" else MapLayer.TRAIL)
    lengths = ", ".join(dimension.label for dimension in view.dimensions)
    return Text.assemble((f"{view.title}: ", "bold"), lengths, "\n", canvas.text())
