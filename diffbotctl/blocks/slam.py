"""SLAM: sends scans to the process that builds the map, and publishes the pose in it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import pi

from diffbotctl.block import Block, FromRobot, In, Out, action
from diffbotctl.estimation.map_localization import MapLocalization
from diffbotctl.estimation.scan_alignment import ScanAlignment
from diffbotctl.geometry.deskew import PoseHistory, deskew
from diffbotctl.geometry.footprint import Footprint, MountedDevice, sensor_mount
from diffbotctl.messages import MapPose, MapRequest, MapTask, MapUpdate, Odometry, Scan, ScanPoints
from diffbotctl.params import Param
from diffbotctl.time import SECOND

LATE_TIME = 2 * SECOND  # without an answer to a scan; then the pose is by odometry alone
SENT_MAX = 64  # scans that wait for their answer
MAP_NAME_MAX = 60  # characters


class Slam(Block):
    """Locate the robot in a map that grows while it drives (SLAM).

    It corrects each scan for the motion of the robot, and sends it to the source `map`, a process
    of its own that matches it with the map. `pose` is the pose in the map: the newest answer of
    that process, and the odometry since then. odom never jumps; what is corrected is the pose of
    odom in the map (REP-105). Without answers the covariance grows with the odometry's. No motion
    depends on this block.

    blocks:
      slam: {block: slam, in: {scan: robot.scan, odometry: odometry.odometry, update: map.update}}
    sources:
      map: {driver: map_builder, in: {scan: slam.points, request: slam.request}, timeout: 10 s}
    """

    sensor = Param(str, default="scan", help="Name of the lidar in the robot file.")
    lag: float | None = Param(
        float,
        unit="s",
        none=True,
        default=None,
        minimum=-0.1,
        maximum=0.5,
        help="By how much the times of scans are later than those of the wheels; none: estimated.",
    )
    clear_distance = Param(
        float,
        unit="m",
        default=3.0,
        minimum=0.0,
        maximum=100.0,
        help="How far a ray that meets nothing clears the map; glass and black objects return no "
        "ray, too.",
    )
    sensors: Mapping[str, MountedDevice] = FromRobot("sensors")
    front: float = FromRobot("body.front")
    back: float = FromRobot("body.back")
    width: float = FromRobot("body.width")

    scan = In(Scan, help="The scan of the lidar.")
    odometry = In(Odometry, help="Motion of the robot.")
    update = In(MapUpdate, help="The answers of the map's process.")
    points = Out(ScanPoints, help="The corrected scan.")
    request = Out(MapRequest, help="What the map is asked to do.")
    pose = Out(MapPose, help="The robot in the map.")

    def reset(self) -> None:
        self.mount = sensor_mount(self.sensors, self.sensor)
        self.outline = Footprint(self.front, self.back, 0.5 * self.width)
        self.history = PoseHistory()
        self.localization = MapLocalization()
        self.alignment = ScanAlignment()
        self.last_scan: Scan | None = None
        self.last_update: MapUpdate | None = None
        self.waiting: Scan | None = None  # for the odometry up to its end
        self.requests: list[MapRequest] = []
        self.asked: list[MapRequest] = []  # that wait for their answer
        self.sent: deque[Odometry] = deque(maxlen=SENT_MAX)
        self.since = 0  # ns, of the first scan that was sent
        self.number = 0
        self.is_order_reported = False
        self.reported = ""

    @action
    def save(self, now: int, name: str) -> int:
        """Save the map under a name. Returns the number of the request."""
        return self._ask(now, "save", name)

    @action
    def load(self, now: int, name: str) -> int:
        """Load the map of that name, and search for the robot in it."""
        return self._ask(now, "load", name)

    @action
    def clear(self, now: int) -> int:
        """Begin an empty map where the robot stands."""
        return self._ask(now, "clear")

    @action(x="m", y="m", heading="rad", heading_sd="rad")
    def place(
        self, now: int, x: float, y: float, heading: float = 0.0, heading_sd: float = 0.2
    ) -> int:
        """State where the robot is in the map; `heading_sd` of pi: its heading is not known."""
        return self._ask(now, "place", x=x, y=y, heading=heading, heading_sd=heading_sd)

    def react(
        self, now: int, scan: Scan | None, odometry: Odometry | None, update: MapUpdate | None
    ) -> tuple[ScanPoints | None, MapRequest | None, MapPose | None]:
        if odometry is None:
            return None, None, None
        self.history.add(odometry)
        if scan is not None and scan is not self.last_scan:
            self._take_scan(scan)
        if update is not None and update is not self.last_update:
            self._take_update(update)
        points = self._points(odometry)
        request = self.requests.pop(0) if self.requests else None
        if request is not None:
            self.asked.append(request)
        return points, request, self.localization.pose(odometry, self._why_late(now))

    def _ask(
        self,
        now: int,
        task: MapTask,
        name: str = "",
        x: float = 0.0,
        y: float = 0.0,
        heading: float = 0.0,
        heading_sd: float = 0.2,
    ) -> int:
        if task in ("save", "load") and not is_map_name(name):
            raise ValueError(f"a map's name has letters, digits, - and _; not {name[:20]!r}")
        self.number += 1
        self.requests.append(MapRequest(now, self.number, task, name, x, y, heading, heading_sd))
        return self.number

    def _take_scan(self, scan: Scan) -> None:
        if self.last_scan is not None and scan.time <= self.last_scan.time:
            if not self.is_order_reported:
                self.is_order_reported = True
                self.log.warning("scans are out of order, and left out: do two lidars send here?")
            return
        self.last_scan = self.waiting = scan

    def _take_update(self, update: MapUpdate) -> None:
        self.last_update = update
        at = next((each for each in self.sent if each.time == update.time), None)
        self.localization.take(update, at)
        self.alignment.take(update, at)
        for text in self.alignment.findings(self.mount):
            self.log.warning(text)
        while self.asked and self.asked[0].number <= update.request:
            done = self.asked.pop(0)
            result = update.refusal if done.number == update.request else ""
            self.log.info(f"{done.task} {done.name}".rstrip() + f": {result or 'done'}")
        text = f"{update.state}: {update.cause}" if update.cause else update.state
        if text != self.reported:
            self.reported = text
            self.log.info(text)

    def _points(self, odometry: Odometry) -> ScanPoints | None:
        """The scan that waits, once the odometry up to its end is known."""
        scan = self.waiting
        if scan is None:
            return None
        lag = round(SECOND * (self.alignment.lag if self.lag is None else self.lag))
        end = scan.time - lag
        if odometry.time < end:
            return None
        self.waiting = None
        corrected = deskew(scan, lag, self.mount, self.outline, self.history, self.clear_distance)
        at = corrected.at
        self.since = self.since or at.time
        self.sent.append(at)
        return ScanPoints(
            at.time,
            at.x,
            at.y,
            at.heading,
            at.covariance,
            corrected.origin,
            corrected.points,
            corrected.clear,
        )

    def _why_late(self, now: int) -> str:
        """Why the pose is by odometry alone; empty while scans come and are answered."""
        if self.last_scan is None or now - self.last_scan.time > LATE_TIME:
            return "no scan comes from the lidar"
        newest = self.last_update.time if self.last_update is not None else self.since
        if now - newest > LATE_TIME:
            return f"the map's process has not answered for {(now - newest) // SECOND} s"
        return ""


def place_arguments(x: float, y: float, heading: float | None) -> dict[str, float]:
    """The arguments of the action `place`; m, and rad or None where the heading is not known."""
    known = {"heading_sd": pi} if heading is None else {"heading": heading}
    return {"x": x, "y": y, **known}


def is_map_name(name: str) -> bool:
    """Whether a map may be called so: it becomes the name of a file."""
    plain = name.replace("-", "").replace("_", "")
    return plain.isalnum() and plain.isascii() and len(name) <= MAP_NAME_MAX and name[0] != "-"
