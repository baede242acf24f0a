"""One account of what a wheel's edges were: which flank of which slot, going forward or backward.

Going forward a rising edge comes at each whole z, going backward at each whole z plus the open
share of the pitch. After a reversal more than one flank may have been passed; then the account
splits. Times are integer nanoseconds, lengths pitches.
"""

from __future__ import annotations

from math import log, sqrt

from diffbotctl.estimation.wheel_kalman import Priors, WheelKalman, normal_cdf

OPEN = 0.5  # share of the pitch that lies open, the middle of all discs
UNLIKELY = 8.0  # a split's branch so far below the best (natural logarithm) is not taken up
LEAST_SHARE = 1e-6  # no direction is quite impossible
ROLLING = 3.0  # times the speed that friction ends; slower than this a wheel hardly rolls out
OUTSIDE = 0.08  # mass beyond a bound from which on it is believed; less says nothing new at rest
SURE = 0.001  # the same while moving, when each frame says something new
# The same while moving, of a board that will tell when the edge came: that says all that its
# absence did, which would be taken in twice. Only an overdue edge tells of a wheel that is held.
OVERDUE = 0.6


class EdgeHypothesis:
    """The motion of one wheel, and the flank that was passed last."""

    __slots__ = (
        "count",
        "drive",
        "heading",
        "motion",
        "passed",
        "slot",
        "time",
        "turned_back",
    )

    def __init__(self, spread: Priors, time: int, count: int, slots: int) -> None:
        """`slots` of the disc, whose errors are learnt when the board tells edges' times."""
        self.motion = WheelKalman(spread, slots)
        self.time = time
        self.count = count
        self.drive = 0.0
        self.heading = 0  # direction of the last drive: 1, -1, or 0 before the first
        self.slot = 0  # the slot whose flank was passed last
        self.passed = 0  # direction in which it was passed
        self.turned_back = False  # driven the other way since then

    @property
    def where(self) -> tuple[int, int, bool]:
        """The flank that was passed last, and how."""
        return self.slot, self.passed, self.turned_back

    @property
    def account(self) -> tuple[tuple[int, int, bool], bool | None]:
        """What tells this account from another."""
        return self.where, self.motion.dry

    def copy(self) -> EdgeHypothesis:
        """The same account, to go its own way from now on."""
        twin = object.__new__(EdgeHypothesis)
        twin.motion = self.motion.copy()
        twin.time, twin.count, twin.drive, twin.heading = (
            self.time,
            self.count,
            self.drive,
            self.heading,
        )
        twin.slot, twin.passed, twin.turned_back = self.slot, self.passed, self.turned_back
        return twin

    @property
    def place(self) -> float:
        """z of the flank passed last, as nominally cut."""
        return self.slot + (OPEN if self.passed < 0 else 0.0)

    def frame(
        self, time: int, count: int, edge: int | None, drive: float, since: int | None
    ) -> list[EdgeHypothesis]:
        """Take one frame: `count` at `time`, the last edge's time if the board tells it, and the
        `drive` (pitches/s wanted) in force, `since` when if known. Returns this account, or those
        into which it has split."""
        steps = abs(count - self.count)
        self.count = count
        begun = self.time
        marked = edge is not None and steps != 0
        changes = drive != self.drive
        switch = self._clamp(since, time) if changes else time
        passed = self._clamp(edge, time) if marked else time
        if changes and switch <= passed:
            self._advance(switch)
            self._turn(drive)
            changes = False
        self._advance(passed)
        tracks = [self]
        if steps:
            window = 0.0 if marked else abs(self.motion.speed) * (time - begun) * 1e-9
            tracks = self._pass(steps, window)
        for track in tracks:
            if marked:
                track.motion.see_edge(track.place, track.slot, track.passed > 0)
            if changes:
                track._advance(switch)
                track._turn(drive)
            track._advance(time)
            track._see_bounds(
                not marked and (steps != 0 or abs(track.motion.speed) > track.motion.spread.creep)
            )
        return tracks

    def rolling_out(self, drive: float) -> list[EdgeHypothesis]:
        """Split over how friction ends the motion, the first time that `drive` leaves off."""
        motion = self.motion
        if motion.dry is not None or drive * motion.speed > 0.0 or not motion.rolls(ROLLING):
            return [self]
        twin = self.copy()
        motion.dry, twin.motion.dry = False, True
        return [self, twin]

    def _see_bounds(self, moving: bool) -> None:
        if self.passed:
            low, high = bounds(self.place, self.passed, self.turned_back)
            least = OVERDUE if self.motion.spread.timed else SURE
            self.motion.see_bounds(low, high, least if moving else OUTSIDE)

    def likely_edge(self, time: int, steps: int) -> int:
        """When the last of `steps` edges came that a frame at `time` counts, as the motor's model
        has it (ns)."""
        span = (time - self.time) * 1e-9
        speed = self.motion.speed
        if not self.motion.rolls(ROLLING):
            return time - int(0.5e9 * span)
        heading = -1 if speed < 0.0 else 1
        beyond = heading * (self.motion.z + speed * span - self.place) - abs(steps)
        ago = min(max(beyond / abs(speed), 0.0), span, 1.0 / abs(speed))
        return time - int(ago * 1e9)

    def _clamp(self, moment: int | None, time: int) -> int:
        return self.time if moment is None else min(max(moment, self.time), time)

    def _advance(self, time: int) -> None:
        """Let the motor run on to `time` under the drive in force."""
        span = time - self.time
        if span > 0:
            self.time = time
            self.motion.run(span * 1e-9, self.drive)

    def _turn(self, drive: float) -> None:
        """The command changes to `drive`."""
        self.motion.turn(drive - self.drive)
        self.drive = drive
        if drive == 0.0:
            return
        heading = 1 if drive > 0.0 else -1
        if self.heading == 0 and self.passed == 0:
            self.passed = heading
            if heading < 0:  # the phase is as unknown against the flanks that come going backward
                self.motion.shift(-OPEN)
                self.slot = 0
        self.heading = heading
        if heading != self.passed:
            self.turned_back = True

    def _pass(self, steps: int, window: float) -> list[EdgeHypothesis]:
        """`steps` edges have been passed (the board's sign is not believed), the last of them just
        now, or somewhere in the last `window` pitches of the way."""
        if not self.turned_back:
            heading = self.passed or self.heading or 1
            self._take(heading, self.slot + heading * steps)
            return [self]
        branches = self._branches(steps, window)
        best = max(fit for fit, *_ in branches)
        taken = [branch for branch in branches if branch[0] > best - UNLIKELY]
        tracks = [self, *(self.copy() for _ in taken[1:])]
        for track, (_, prior, heading, slot) in zip(tracks, taken, strict=True):
            track.motion.evidence += prior
            track._take(heading, slot)
        return tracks

    def _branches(self, steps: int, window: float) -> list[tuple[float, float, int, int]]:
        """Which flank it may have been: (how well it fits, log of its direction's probability,
        direction, slot)."""
        motion = self.motion
        # A speed is never known better than to a creep when the direction hangs on it.
        forward = normal_cdf(motion.speed / sqrt(motion.speed_variance + motion.spread.creep**2))
        branches = []
        for heading, share in ((1, forward), (-1, 1.0 - forward)):
            prior = log(max(share, LEAST_SHARE))
            variance = motion.flank_variance(heading > 0) + window * window / 12.0
            for slot in (self.slot + heading * steps, self.slot + heading * (steps - 1)):
                place = slot + (OPEN if heading < 0 else 0.0)
                away = motion.z - place - 0.5 * heading * window
                branches.append((prior - 0.5 * away * away / variance, prior, heading, slot))
        return branches

    def _take(self, heading: int, slot: int) -> None:
        """The flank of `slot` was passed in direction `heading`."""
        self.passed, self.slot = heading, slot
        self.turned_back = self.heading != heading


def bounds(place: float, passed: int, turned_back: bool) -> tuple[float, float]:
    """Where z can lie when the last edge stood at `place` and was `passed` forward (1) or backward.

    Turned back since, the next edge may come from either flank of the slot, so both count.
    """
    if passed > 0:
        return place - (1.0 - OPEN if turned_back else 0.0), place + 1.0
    return place - 1.0, place + (1.0 - OPEN if turned_back else 0.0)


def sort_hypotheses(
    tracks: list[EdgeHypothesis],
    time: int,
    count: int,
    edge: int | None,
    drive: float,
    since: int | None,
) -> list[EdgeHypothesis]:
    """All accounts that come of `tracks` with one more frame, as `WheelTrack.frame` takes it."""
    if tracks[0].motion.dry is None:
        tracks = [twin for track in tracks for twin in track.rolling_out(drive)]
    return [branch for track in tracks for branch in track.frame(time, count, edge, drive, since)]
