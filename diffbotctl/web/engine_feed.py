"""The picture of a running engine, polled once for all pages."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator, Mapping, Set
from math import degrees, isfinite
from typing import Any

from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.client import AsyncControlClient
from diffbotctl.control_socket.protocol import Fields, RefusalError
from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.geometry.map_tiles import Place, tile_places
from diffbotctl.messages import (
    Battery,
    Goal,
    GoalState,
    Imu,
    Link,
    MapPose,
    MapUpdate,
    Odometry,
    Path,
    Range,
    Scan,
    Text,
)
from diffbotctl.processes.screen import RunSnapshot
from diffbotctl.time import SECOND
from diffbotctl.ui import run_text
from diffbotctl.ui.dash.state import REQUESTS, Request, RunView
from diffbotctl.ui.map.layers import covariance_ellipse, pose_at
from diffbotctl.ui.run_text import odometry_topic

MILLIMETRES = 1000
Row = tuple[str, str, bool]  # name, text, whether it needs attention


class RunPicture:
    """Follows the replies of the engine. `whole` is everything, `changes` what is new."""

    def __init__(self) -> None:
        self.view = RunView()
        self.scene: Fields = {}
        self.held: Fields | None = None
        self.new_points: list[tuple[float, float]] = []
        self.is_trail_new = True
        self.scan_times: dict[str, int] = {}
        self.new_tiles: dict[Place, str] = {}

    def take(self, request: Request, reply: Fields) -> None:
        """Update with the reply to `request`."""
        if request == "scene":
            self.scene = {name: value for name, value in reply.items() if name not in ("id", "ok")}
        points = self.view.trail.points
        last = points[-1] if points else None
        self.view.take_reply(request, reply)
        if points and points[-1] is not last:
            self.is_trail_new |= len(points) == 1
            self.new_points.append(points[-1])

    def take_trail(self, reply: Fields) -> None:
        """Take the trail from before this server was attached, in a reply to `read_history`."""
        self.view.take_trail(reply)
        self.new_points, self.is_trail_new = list(self.view.trail.points), True

    def take_map(self, reply: Fields) -> bool:
        """Take tiles of the map. True when there are more."""
        tiles = self.view.tiles
        self.new_tiles = {} if reply["map"] != tiles.map else self.new_tiles
        has_more = self.view.take_map(reply)
        self.new_tiles |= {place: tiles.tiles[place] for place in tile_places(reply["places"])}
        return has_more

    def changes(self) -> Fields:
        """What is new since the last call."""
        scans = {
            wire: scan for wire, scan in self._scans() if self.scan_times.get(wire, -1) < scan.time
        }
        self.scan_times |= {wire: scan.time for wire, scan in scans.items()}
        fields = {
            **self._present(),
            "scans": {wire: self._scan_fields(scan) for wire, scan in scans.items()},
            "trail": _points(self.new_points),
            "trail_begins": self.is_trail_new,
        }
        if self.new_tiles:
            fields["map"] = self._map_fields(self.new_tiles)
        self.new_points, self.is_trail_new, self.new_tiles = [], False, {}
        return fields

    def whole(self) -> Fields:
        """Everything, for a page that has just been opened or has fallen behind."""
        return {
            **self._present(),
            "scene": self.scene,
            "scans": {wire: self._scan_fields(scan) for wire, scan in self._scans()},
            "trail": _points(list(self.view.trail.points)),
            "trail_begins": True,
            "map": self._map_fields(self.view.tiles.tiles),
        }

    def _map_fields(self, tiles: Mapping[Place, str]) -> Fields:
        """Number of the map, side of a cell (m), and column, row and text of each tile."""
        whole = self.view.tiles
        rows = [[*place, text] for place, text in tiles.items()]
        return {"number": whole.map, "resolution": whole.resolution, "tiles": rows}

    def _scans(self) -> Iterator[tuple[str, Scan]]:
        for wire, message in self.view.snapshot.messages.items():
            if isinstance(message, Scan):
                yield wire, message

    def _scan_fields(self, scan: Scan) -> Fields:
        """The pose in the middle of the turn, and distances in whole mm, 0: nothing measured."""
        middle = scan.time - round(0.5 * SECOND * scan.duration)
        odometry = run_text.newest_odometry(self.view.snapshot)
        return {
            "pose": None if odometry is None else _place_fields(pose_at(odometry, middle)),
            "start": scan.start,
            "step": scan.step,
            "mm": [
                round(distance * MILLIMETRES) if isfinite(distance) else 0
                for distance in scan.distances
            ],
        }

    def _present(self) -> Fields:
        snapshot = self.view.snapshot
        odometry = run_text.newest_odometry(snapshot)
        goal = run_text.newest_message(snapshot, Goal)
        path = run_text.newest_message(snapshot, Path)
        stop = self.view.held
        place = run_text.newest_message(snapshot, MapPose)
        return {
            "odom": None if place is None else [round(value, 5) for value in place.odom],
            "asks_place": self.view.asks_place,
            "candidates": [] if place is None else _candidates(snapshot),
            "time": snapshot.time / SECOND,
            "pose": None if odometry is None else _pose_fields(odometry),
            "goal": None if goal is None or not goal.number else _goal_fields(goal),
            "path": [] if path is None else [[each.x, each.y] for each in path.goals],
            "ranges": {
                wire: [message.state, _finite(message.distance)]
                for wire, message in snapshot.messages.items()
                if isinstance(message, Range)
            },
            "facts": list(_facts(self.view)),
            "stop": None if stop is None else _stop_fields(stop),
        }


def _place_fields(odometry: Odometry) -> list[float]:
    """x, y and heading."""
    place = (odometry.x, odometry.y, odometry.heading)
    return [round(value, 4) if isfinite(value) else 0.0 for value in place]


def _candidates(snapshot: RunSnapshot) -> list[float]:
    """x, y and heading in the map of each place where the robot may be; none when it is known."""
    update = run_text.newest_message(snapshot, MapUpdate)
    return [] if update is None else [round(value, 3) for value in update.candidates]


def _pose_fields(odometry: Odometry) -> list[Any]:
    """x, y, heading, and the ellipse of the position: half axes and direction."""
    pose = [odometry.x, odometry.y, odometry.heading, *covariance_ellipse(odometry.covariance)]
    return [round(value, 4) if isfinite(value) else 0.0 for value in pose]


def _goal_fields(goal: Goal) -> list[float | None]:
    return [goal.x, goal.y, goal.heading]


def _points(points: list[tuple[float, float]]) -> list[float]:
    """x and y of one point after the other, to the mm."""
    return [round(value, 3) for point in points for value in point]


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _stop_fields(stop: Fields) -> Fields:
    end = "waits for `resume`" if stop["latched"] else "ends by itself"
    return {**{name: stop[name] for name in ("code", "cause", "latched")}, "end": end}


def _facts(view: RunView) -> Iterator[Row]:
    """The rows of values: the names and the words of the other screens."""
    snapshot = view.snapshot
    odometry = run_text.newest_odometry(snapshot)
    if odometry is not None:
        yield "pose", run_text.pose_text(odometry), False
        speed = f"{odometry.linear:+z.3f} m/s {odometry.angular:+z.2f} rad/s"
        yield "body", speed, False
    yield from _goal_rows(view)
    if (place := run_text.newest_message(snapshot, MapPose)) is not None:
        yield "map", run_text.map_pose_text(place), place.state not in ("mapping", "localised")
    if (wheels := run_text.commanded_wheels(snapshot)) is not None:
        yield "wheels", run_text.wheel_speeds_text(wheels, None), False
    if (imu := run_text.newest_message(snapshot, Imu)) is not None:
        yield "imu", imu_text(imu), imu.state != "working"
    for message in snapshot.messages.values():
        if isinstance(message, Range):
            yield "range", run_text.range_text(message), message.state == "fault"
    if (battery := run_text.newest_message(snapshot, Battery)) is not None:
        yield "supply", f"{battery.volts:.1f} V", battery.low
    if (link := run_text.newest_message(snapshot, Link)) is not None:
        yield "link", run_text.link_text(link), link.state != "up"
    for wire, message in snapshot.messages.items():
        if isinstance(message, Text):
            yield wire.partition(".")[0], message.text, False


def _goal_rows(view: RunView) -> Iterator[Row]:
    goal = run_text.newest_message(view.snapshot, Goal)
    state = run_text.newest_message(view.snapshot, GoalState)
    if goal is not None and goal.number:
        heading = "" if goal.heading is None else f"  heading {degrees(goal.heading):z.0f} deg"
        yield "goal", f"x {goal.x:z.3f} m  y {goal.y:z.3f} m{heading}", False
    if state is not None and state.state != "idle":
        is_bad = state.state in ("reached_unsure", "blocked", "stuck", "given_up", "cancelled")
        yield "state", run_text.goal_state_text(state), is_bad


PICTURE_PERIOD_S = 0.1
IDLE_PERIOD_S = 0.2  # without a page: only the trail is kept
TOPICS_PERIOD_S = 2.0  # topics may appear, and their types are needed


def encode(fields: Fields) -> str:
    return json.dumps(fields, separators=(",", ":"), allow_nan=False)


class EngineFeed:
    """Polls the engine while it runs. `publish` takes each picture as JSON, when there are pages.

    `has_pages`: whether any page is open.
    """

    def __init__(self, publish: Callable[[str], None], has_pages: Callable[[], bool]) -> None:
        self.publish = publish
        self.has_pages = has_pages
        self.picture = RunPicture()
        self.ended = asyncio.Event()
        self.client = AsyncControlClient(lambda line: None, self.ended.set)

    async def connect(self, engine: EngineAddress) -> None:
        """Connect, and ask for what does not change. Raises RunError when nothing answers."""
        await self.client.connect(engine, "web page")
        await self._poll("scene", "list_topics", "snapshot")
        topic = odometry_topic(self.picture.view.snapshot)
        if topic is not None:
            self.picture.take_trail(await self._history(topic))

    async def run(self) -> None:
        """Read what pages may plot of the past, then poll until the run has ended."""
        for topic in self.topics:
            self.picture.view.take_history(topic, await self._history(topic))
        polls = 0
        while not self.ended.is_set():
            period = PICTURE_PERIOD_S if self.has_pages() else IDLE_PERIOD_S
            await asyncio.sleep(period)
            try:
                await self._poll("snapshot")
                await self._read_map()
                polls += 1
                if polls % round(TOPICS_PERIOD_S / PICTURE_PERIOD_S) == 0:
                    await self._poll("list_topics")
            except RefusalError:
                continue  # the engine is late, or has ended
            if self.has_pages():
                self.publish(encode(self.picture.changes()))

    def whole(self) -> str:
        return encode(self.picture.whole())

    @property
    def topics(self) -> Set[str]:
        return self.picture.view.rates.keys()

    def history(self, name: str) -> list[tuple[float, float]]:
        """Time (s) and value of a field, `block.port.field`, as the pictures had them."""
        return list(self.picture.view.numbers.get(name, ()))

    async def status(self) -> Fields:
        """The engine's status. Raises RefusalError."""
        return await self.client.request("status")

    async def _history(self, topic: str) -> Fields:
        try:
            return await self.client.request("read_history", topic=topic)
        except RefusalError:  # the run has ended
            return {"times": [], "fields": {}, "trail": []}

    async def _read_map(self) -> None:
        while (fields := self.picture.view.map_request) is not None:
            reply = await self.client.request("read_map", **fields)
            if not self.picture.take_map(reply):
                return

    async def _poll(self, *requests: Request) -> None:
        for request in requests:
            self.picture.take(request, await self.client.request(request, **REQUESTS[request]))
