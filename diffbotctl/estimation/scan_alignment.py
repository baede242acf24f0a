"""By how much a lidar's times are late, and its declared heading is wrong: scans against wheels.

A scan that is later than stated by d was seen at another heading than the odometry gives for it:
while the robot turns at w, by d w. So from one scan to the next the pose of odom in the map turns
by -d (w2 - w1). A lidar that points to the left of its declared heading by a moves, as the map sees
it, to the right where the wheels drive straight: by sin(a) of the way.
Both are least squares, over what the map's process has matched.
"""

from __future__ import annotations

from collections import deque
from math import degrees, hypot, remainder, sqrt, tau

from diffbotctl.estimation.map_localization import between
from diffbotctl.geometry.deskew import PlanePose, compose
from diffbotctl.messages import MapUpdate, Odometry
from diffbotctl.time import SECOND

REMEMBERED_MAX = 64  # scans that wait for their answer
HEADING_SD = 0.006  # rad, of a matched heading against the one before
RATE_CHANGE_MIN = 0.05  # rad/s; from a smaller one the lag does not show
TURN_OUTLIER = 0.25  # rad: a corrected loop, not a lag
LAG_SD = 0.005  # s, at which the lag is corrected
LAG_REPORTED = 0.03  # s
LAG_MAX = 0.5  # s
LEG = 0.3  # m, straight, of one look at the lidar's direction
LEG_TURN_MAX, LEG_RATE_MAX = 0.1, 0.1  # rad, rad/s
LEG_SD = 0.02  # rad, of one leg
MOUNT_SD = 0.007  # rad, at which the direction is reported
MOUNT_REPORTED = 0.026  # rad: 1.5 degrees, twice what a bracket of plastic is off


class ScanAlignment:
    """Takes the odometry of each scan, then the answer to it. `lag` in s."""

    def __init__(self) -> None:
        self.lag = 0.0
        self.remembered: deque[Odometry] = deque(maxlen=REMEMBERED_MAX)
        self.last: tuple[Odometry, MapUpdate] | None = None
        self.rates = self.turns = 0.0  # sums of squares and products, of rates and turns
        self.anchor: tuple[PlanePose, PlanePose] | None = None  # by the wheels, in the map
        self.legs, self.sides = 0, 0.0
        self.reported_lag = 0.0
        self.is_mount_reported = False

    def remember(self, at: Odometry) -> None:
        """Note the odometry with which a scan was sent."""
        self.remembered.append(at)

    def take(self, update: MapUpdate) -> None:
        """Take the answer to a scan."""
        at = next((each for each in self.remembered if each.time == update.time), None)
        if at is None or update.state not in ("mapping", "localised"):
            self.last = self.anchor = None
            return
        if self.last is not None and at.time > self.last[0].time:
            self._add_turn(*self.last, at, update)
        self.last = at, update
        if abs(at.angular) > LEG_RATE_MAX:
            self.anchor = None  # where the lag turns the pose
        else:
            self._add_way((at.x, at.y, at.heading), (update.x, update.y, update.heading))

    def findings(self) -> list[str]:
        """What a person should know, once."""
        texts = []
        if abs(self.lag - self.reported_lag) > LAG_REPORTED:
            self.reported_lag = self.lag
            texts.append(
                f"scans are {1e3 * self.lag:.0f} ms later than the wheels; that is corrected"
            )
        offset = self.mount_offset
        if offset is not None and abs(offset) > MOUNT_REPORTED and not self.is_mount_reported:
            self.is_mount_reported = True
            side = "left" if offset > 0 else "right"
            texts.append(
                f"the lidar points {degrees(abs(offset)):.1f} deg further to the {side} than "
                "at.heading in the robot file states: correct it there"
            )
        return texts

    @property
    def mount_offset(self) -> float | None:
        """Direction of the lidar against the declared one, rad; None while it is not known."""
        if not self.legs or LEG_SD / sqrt(self.legs) > MOUNT_SD:
            return None
        return self.sides / self.legs

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

    def _add_way(self, wheels: PlanePose, odom: PlanePose) -> None:
        seen = compose(odom, wheels)
        if self.anchor is None:
            self.anchor = wheels, seen
            return
        driven = between(self.anchor[0], wheels)
        moved = between(self.anchor[1], seen)
        length = hypot(driven[0], driven[1])
        if abs(driven[2]) > LEG_TURN_MAX:
            self.anchor = wheels, seen
        elif length > LEG:
            self.legs += 1
            self.sides += (driven[1] - moved[1]) / driven[0] if driven[0] else 0.0
            self.anchor = wheels, seen
