"""By how much a lidar's times are late, and its declared place is wrong: scans against wheels.

A scan that is later than stated by d was seen at another heading than the odometry gives for it:
while the robot turns at w, by d w. So from one scan to the next the pose of odom in the map turns
by -d (w2 - w1). That is a least squares over what the map's process has matched; the place of the
lidar is `lidar_mount`.
"""

from __future__ import annotations

from cmath import exp
from math import degrees, hypot, remainder, sqrt, tau

from diffbotctl.estimation.lidar_mount import LidarMountFit
from diffbotctl.geometry.deskew import PlanePose, compose
from diffbotctl.messages import MapUpdate, Odometry
from diffbotctl.time import SECOND

HEADING_SD = 0.006  # rad, of a matched heading against the one before
RATE_CHANGE_MIN = 0.05  # rad/s; from a smaller one the lag does not show
TURN_OUTLIER = 0.25  # rad: a corrected loop, not a lag
LAG_SD = 0.005  # s, at which the lag is corrected
LAG_REPORTED = 0.03  # s
LAG_MAX = 0.5  # s
JUMP = 0.15  # m, from scan to scan: a corrected loop
HEADING_REPORTED, PLACE_REPORTED = 0.026, 0.02  # rad, m: twice what a bracket of plastic is off
SURE = 4.0  # standard deviations


class ScanAlignment:
    """Takes the answers to scans. `lag` in s."""

    def __init__(self) -> None:
        self.lag = 0.0
        self.last: tuple[Odometry, MapUpdate] | None = None
        self.rates = self.turns = 0.0  # sums of squares and products, of rates and turns
        self.mount = LidarMountFit()
        self.reported_lag = 0.0
        self.reported = False, False  # whether heading and place of the lidar are

    def take(self, update: MapUpdate, at: Odometry | None) -> None:
        """Take the answer to a scan, and the odometry with which it was sent."""
        if at is None or update.state not in ("mapping", "localised"):
            self.last = self.mount.begin = None
            return
        seen = compose((update.x, update.y, update.heading), (at.x, at.y, at.heading))
        if self.last is not None and at.time > self.last[0].time:
            self._add_turn(*self.last, at, update)
            last = self.last[1]
            before = compose((last.x, last.y, last.heading), (at.x, at.y, at.heading))
            if hypot(seen[0] - before[0], seen[1] - before[1]) > JUMP:
                self.mount.begin = None
        self.last = at, update
        self.mount.add((at.x, at.y, at.heading), seen)

    def findings(self, stated: PlanePose) -> list[str]:
        """What a person should know, once. `stated`: the lidar in base_link, by the robot file."""
        texts = []
        if abs(self.lag - self.reported_lag) > LAG_REPORTED:
            self.reported_lag = self.lag
            texts.append(
                f"scans are {1e3 * self.lag:.0f} ms later than the wheels; that is corrected"
            )
        text = self._mount_text(stated)
        return [*texts, text] if text else texts

    def _mount_text(self, stated: PlanePose) -> str:
        """What is known and new of the lidar's place; the rest is as stated."""
        mount = self.mount.mount()
        if mount is None:
            return ""
        place, heading = complex(*stated[:2]), stated[2]
        seen = mount.place + exp(1j * mount.heading) * place
        is_turned = abs(mount.heading) > max(HEADING_REPORTED, SURE * mount.heading_sd)
        is_moved = abs(seen - place) > max(PLACE_REPORTED, SURE * mount.place_sd)
        if not (is_turned > self.reported[0] or is_moved > self.reported[1]):
            return ""
        self.reported = is_turned, is_moved
        found = seen if is_moved else place, heading + (mount.heading if is_turned else 0.0)
        return (
            f"by what it sees, the lidar is at {_at(*found)}, not at {_at(place, heading)} "
            "as the robot file states: correct `at` there"
        )

    def _add_turn(self, before: Odometry, last: MapUpdate, at: Odometry, update: MapUpdate) -> None:
        change = at.angular - before.angular
        turn = remainder(update.heading - last.heading, tau)
        if abs(change) < RATE_CHANGE_MIN or abs(turn) > TURN_OUTLIER:
            return
        if at.time - before.time > SECOND:
            return
        self.rates += change * change
        self.turns -= change * turn
        if HEADING_SD / sqrt(self.rates) < LAG_SD:
            self.lag = min(max(self.lag + self.turns / self.rates, -0.1), LAG_MAX)
            self.rates = self.turns = 0.0


def _at(place: complex, heading: float) -> str:
    turn = degrees(remainder(heading, tau))
    return (
        f"{{x: {100 * place.real:.1f} cm, y: {100 * place.imag:.1f} cm, heading: {turn:.1f} deg}}"
    )
