"""Travel of a wheel with a fine encoder: its counts, with the directions that the motor gave them.

A disc with more than some 60 slots needs no model of its motor to be exact, only the directions:
one channel does not measure them. A wheel turns with its drive. After the drive has reversed the
wheel rolls on, ever slower, stops, and turns back ever faster; so the edges are slowest where it
turned. Lengths are pitches, times seconds.
"""

from __future__ import annotations

from math import exp, pi, radians, sqrt

from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.control.speed_loop import speed_gains
from diffbotctl.estimation.count_faults import CountFaults
from diffbotctl.estimation.explained_edges import ExplainedEdges
from diffbotctl.estimation.unexplained_edges import EdgeGaps, UndrivenEdges
from diffbotctl.estimation.wheel_frame import BoardFrame, CountSign, MotorDuty
from diffbotctl.estimation.wheel_side import LinkTiming, SideConfig

UNIFORM_VARIANCE = 1.0 / 12.0
# Pitches2; after a reversal the next edge may be either edge of the slot.
REVERSAL_VARIANCE = 0.25
# Standard deviation of the play between wheel and encoder: fine encoders sit on the motor's shaft,
# behind its gears.
BACKLASH_SD = radians(1.0)
LAG_FACTOR = 2.0  # the slowest plausible motor against the stated lag
FEW_EDGES = 3  # in a frame; fewer show no trend
TURN_SHARE_SD = 0.3  # of the edges in the frame of the turn
CREEP = 0.094  # rad/s; without drive, friction stops a slower wheel
MODEL_SD, DRIFT_SD = 0.3, 0.1  # of a change of the speed that is predicted, and of the speed
ROUNDING_SD = 0.41  # pitches; of the difference of two counts
EDGE_SD = 0.05  # pitches; the same with edge times
HIDDEN_SDS = 2.0  # of the speed; fewer edges than its uncertainty explains have cancelled
ROUNDING_MAX = 1.5  # edges; of two counts


class FineWheelOdometer:
    """A wheel whose travel is its edges times the pitch."""

    def __init__(self, side: SideConfig, time: int, count: int, timing: LinkTiming) -> None:
        """Start at `time` (ns) with the board's `count`."""
        motor, counts = side.motor, side.encoder.counts
        self.pitch = pi * side.wheel.diameter / counts
        self.pitches_per_rad = 0.5 * counts / pi
        self.rated, self.static, self.lag = motor.rated, motor.loop.static, motor.lag
        self.creep = CREEP * self.pitches_per_rad
        self.time = time
        self.count = self.reported_count = count
        self.edge_time = time  # ns, of the last edge
        self.has_edge_times = timing.has_edge_times
        self.direction = self.drive_direction = 0
        self.count_sign = CountSign(timing.command_time, timing.is_published_firmware)
        self.is_mixed = False
        """whether edges of both signs may have been counted in the last frame"""
        self.span, self.decay = 0.0, 1.0  # s, of a frame; what remains of a speed after it
        self.rolled_for = 0.0  # s, against the drive
        self.undriven = UndrivenEdges(self.pitches_per_rad)
        self.rate = self.rate_before = 0.0  # edges/s in the last frames
        self.edges_before = 0
        self.signed_speed = 0.0
        self.speed_variance = 0.0
        self.position = 0.0  # signed edges
        self.beyond = 0.5  # pitches, from the last edge on
        self.reported = 0.5
        self.reversal_variance = 0.0
        self.added_since = self.added_variance = 0.0
        self.reversals = 0
        # Two to four edges of a slot are not at equal distances: their times show less.
        is_even = counts == side.encoder.slots
        is_hidden = timing.frame_time > 0.0 and not timing.has_edge_times
        self.faults = CountFaults(timing.has_edge_times and is_even, is_hidden)
        self.explained = ExplainedEdges(side)
        self.duty = MotorDuty(speed_gains(motor))
        self.gaps = EdgeGaps(motor.rated * self.pitches_per_rad)
        self.lost_since = 0.0  # pitches2, in gaps, since the last report
        self.travel = self.start_correction = 0.0
        self.lost_share, self.lost_text = 0.0, ""  # of every second edge
        self.disagreement = 0.0

    @property
    def speed(self) -> float:
        """m/s"""
        return self.signed_speed * self.pitch

    @property
    def variance(self) -> float:
        """Variance of the travel since the start, m2."""
        return self.pitches_variance * self.pitch * self.pitch

    @property
    def pitches_variance(self) -> float:
        """Variance of the travel since the start by the phase and the backlash, pitches2."""
        if not self.direction:
            return 0.0
        pitches = UNIFORM_VARIANCE
        if self.reversals:
            pitches += (BACKLASH_SD * self.pitches_per_rad) ** 2
        return pitches

    @property
    def end_variance(self) -> float:
        """Variance of the present position in the slot, m2."""
        return UNIFORM_VARIANCE * self.pitch * self.pitch if self.direction else 0.0

    @property
    def fault_share(self) -> float:
        """Share of the edges that were missed or counted twice."""
        return max(self.faults.share, self.lost_share)

    @property
    def fault(self) -> str:
        """Why its travel is known less well than usual, or an empty text."""
        texts = self.undriven.text, self.lost_text, self.gaps.text, self.faults.text
        return "; ".join(filter(None, texts))

    @property
    def pushed_travel(self) -> float:
        """Standard deviation (m) of what it was turned without a command since the pose was set, if
        that is reported."""
        return self.undriven.sd * self.pitch

    def pose_is_set(self) -> None:
        """What happened before does not matter any more."""
        self.undriven.pose_is_set()
        self.gaps.pose_is_set()

    @property
    def coasting_travel(self) -> float:
        """m, without sign, that it travels until it rests when it is released now."""
        return abs(self.speed) * self.lag

    def update(self, frame: BoardFrame) -> None:
        time, count, edge_time, command, since, is_duty = frame[:6]
        self.undriven.is_other_driven = frame.is_other_driven
        steps = count - self.count
        self.count = count
        span = (time - self.time) * 1e-9
        sign = (command > 0.0) - (command < 0.0)
        speed = settled_speed(command, self.static, self.rated) if is_duty else command
        board_sign = self.count_sign.sign
        self.is_mixed = self.count_sign.update(self.time, command, since, steps)
        is_signed_anew = self.count_sign.sign != board_sign
        edge = time if edge_time is None or not steps else edge_time
        edge_span = (edge - self.edge_time) * 1e-9
        predicted, mean = self._predicted(speed * self.pitches_per_rad, sign, span)
        edges = abs(steps)
        if self.is_mixed:
            edges += self._hidden_edges(edges, abs(mean) * span, span)
        net = self._net(edges, sign, span, predicted, is_signed_anew)
        self.position += net
        if edges or not self.has_edge_times:
            self.edge_time = edge
            self.faults.add(edge_span, edges, self.direction if self.rolled_for == 0.0 else 0)
        commanded = 0.0 if self.rolled_for else speed * self.pitches_per_rad
        self.lost_since += self.gaps.update(span, edges, commanded)
        self._explain(span, abs(steps), frame)
        self._update_speed(predicted, mean, net, edges, span, edge_span)
        self._place_between_edges(time, edges, span)
        self.edges_before, self.rate_before = edges, self.rate
        self.rate = edges / span if span > 0.0 else self.rate

    def _explain(self, span: float, edges: int, frame: BoardFrame) -> None:
        """Compare the edges of a frame with those that the duty of the motor explains."""
        duty = self.duty.update(frame.commands, frame.is_duty, frame.reported_duty)[-1]
        if span > 0.0:
            self.explained.add(span, edges, duty if frame.command else 0.0)

    def _hidden_edges(self, edges: int, expected: float, span: float) -> int:
        """Edges that cancel in the board's count of a frame in which it has changed the sign."""
        missing = max(expected - edges, 0.0)
        is_clear = missing >= HIDDEN_SDS * sqrt(self.speed_variance) * span
        pairs = int(0.5 * missing) if is_clear else 0
        # Without a whole pair, none of them to all.
        self.added_since += (0.5 * pairs) ** 2 if pairs else missing * missing / 3.0
        return 2 * pairs

    def _predicted(self, drive: float, sign: int, span: float) -> tuple[float, float]:
        """Speed (pitches/s) at the end of the frame and on average, by the motor's lag."""
        if span != self.span:
            self.span, self.decay = span, exp(-span / self.lag)
        speed, decay = self.signed_speed, self.decay
        if not sign:
            drive = 0.0
        change = (drive - speed) * (1.0 - decay)
        mean = drive + (speed - drive) * self.lag * (1.0 - decay) / span if span > 0.0 else speed
        self.speed_variance = (
            self.speed_variance * decay * decay
            + (MODEL_SD * change) ** 2
            + (DRIFT_SD * speed) ** 2
            + self.creep**2
        )
        return speed + change, mean

    def _net(
        self, edges: int, sign: int, span: float, predicted: float, is_signed_anew: bool
    ) -> float:
        """Signed travel of the edges of one frame."""
        self.undriven.add(span, edges, is_driven=sign != 0)
        if sign:
            self.drive_direction = sign
        if not self.direction:
            if not self.drive_direction:
                return float(edges)
            self.direction = self.drive_direction
        if self.drive_direction == self.direction:
            self.rolled_for = 0.0
            return float(self.direction * edges)
        return self._net_against(edges, span, predicted, is_signed_anew)

    def _net_against(
        self, edges: int, span: float, predicted: float, is_signed_anew: bool
    ) -> float:
        """The same while the drive is against the last direction."""
        self.rolled_for += span
        old = self.direction
        rolls_on = predicted * old > 0.0 and self.rolled_for < LAG_FACTOR * self.lag
        if edges == 0:
            if not (self.is_mixed and rolls_on):  # else edges of both signs may have cancelled
                self._turn()
            return 0.0
        if edges < FEW_EDGES:
            if rolls_on:
                return float(old * edges)
            self._turn()
            self.added_since += edges * edges
            return float(-old * edges)
        slowest = self.rate * exp(-span / (LAG_FACTOR * self.lag)) * span
        if span <= 0.0 or is_signed_anew or edges - ROUNDING_MAX <= slowest:
            return float(old * edges)
        rate = edges / span
        # Where the speed passed zero between the middles of the frames before and this one.
        turn = 2.0 * self.rate_before / (self.rate_before + rate)  # frames from there
        self._turn()
        if turn < 1.5:  # in the frame before
            share = min(max(turn - 0.5, 0.0), 1.0)
            path = self.edges_before
            self.added_since += (TURN_SHARE_SD * path) ** 2
            return old * (path * _net_share(share) - path - edges)
        share = min(turn - 1.5, 1.0)
        self.added_since += (TURN_SHARE_SD * edges) ** 2
        return old * edges * _net_share(share)

    def _turn(self) -> None:
        self.direction = -self.direction
        self.rolled_for = 0.0
        self.reversals += 1
        self.added_since += REVERSAL_VARIANCE
        if self.signed_speed * self.direction < 0.0:
            self.signed_speed = 0.0

    def _place_between_edges(self, time: int, edges: int, span: float) -> None:
        """Place the wheel at `time` (ns) beyond its last edge; without edge times it is unknown.

        From one edge to the next it moves with its speed, in either direction, and by one pitch at
        most: a wheel that reverses does not jump.
        """
        self.time = time
        if not self.has_edge_times or not self.direction:
            return
        if edges:
            age = (time - self.edge_time) * 1e-9
            passed = min(abs(self.signed_speed) * age, 1.0)
            self.beyond = passed if self.direction > 0 else 1.0 - passed
        else:
            self.beyond = min(max(self.beyond + self.signed_speed * span, 0.0), 1.0)

    def _update_speed(
        self, predicted: float, mean: float, net: float, edges: int, span: float, edge_span: float
    ) -> None:
        if span <= 0.0:
            return
        if self.has_edge_times and edges and edge_span > 0.0:
            measured, sd = net / edge_span, EDGE_SD / edge_span
        else:
            measured, sd = net / span, ROUNDING_SD / span
            if not edges and abs(mean) * span < 1.0:
                self.signed_speed = predicted if self.drive_direction else 0.0
                return
        gain = self.speed_variance / (self.speed_variance + sd * sd)
        self.signed_speed = predicted + gain * (measured - mean)
        self.speed_variance *= 1.0 - gain

    def unobserved_travel(self, count: int) -> float:
        """Metres to `count` after a gap in the telemetry."""
        return (count - self.count) * self.pitch

    def report(self) -> None:
        """Set `travel` to its value since the last call."""
        added = self.added_since + self.undriven.take_variance() + self.lost_since
        self.added_since = self.lost_since = 0.0
        self.added_variance = added * self.pitch * self.pitch
        self.reversal_variance += added
        place = self.position + self.beyond
        self.travel = (place - self.reported) * self.pitch
        self.reported = place


def _net_share(share: float) -> float:
    """Net travel over path of a motion with constant acceleration that turns after `share` of the
    time."""
    forward, backward = share * share, (1.0 - share) ** 2
    return (forward - backward) / (forward + backward)


class DirectedWheelOdometer(FineWheelOdometer):
    """A wheel whose travel is its signed counts times the pitch.

    Two channels need neither the motor's model nor the command: a wheel that is pushed, or turned
    by hand, counts as it turns. The model of the motor is only used for the speed between edges.
    """

    def update(self, frame: BoardFrame) -> None:
        time, count, edge_time, command, _, is_duty = frame[:6]
        steps = count - self.count
        self.count = count
        span = (time - self.time) * 1e-9
        edge = time if edge_time is None or not steps else edge_time
        edge_span = (edge - self.edge_time) * 1e-9
        sign = self.drive_direction = (command > 0.0) - (command < 0.0)
        speed = settled_speed(command, self.static, self.rated) if is_duty else command
        predicted, mean = self._predicted(speed * self.pitches_per_rad, sign, span)
        if steps:
            self._set_direction(1 if steps > 0 else -1)
        self.position += steps
        if steps or not self.has_edge_times:
            self.edge_time = edge
            self.faults.add(edge_span, abs(steps), self.direction)
        commanded = speed * self.pitches_per_rad
        self.lost_since += self.gaps.update(span, abs(steps), commanded)
        self._explain(span, abs(steps), frame)
        self._update_speed(predicted, mean, steps, abs(steps), span, edge_span)
        self._place_between_edges(time, steps, span)

    def _set_direction(self, direction: int) -> None:
        """Both directions count at the same places of the disc: a reversal adds no uncertainty but
        the play between wheel and encoder."""
        if self.direction == -direction:
            self.reversals += 1
        self.direction = direction


class CountWheelOdometer(FineWheelOdometer):
    """A wheel whose travel is the count of the board times the pitch, with the board's sign."""

    def report(self) -> None:
        """Set `travel` to its value since the last call."""
        before = self.reported_count
        super().report()
        self.reported_count = self.count
        self.travel = (self.count - before) * self.pitch
