"""Travel of a wheel whose encoder shows the direction: its signed counts.

Two channels need neither the motor's model nor the command: a wheel that is pushed, or turned by
hand, counts as it turns. The model of the motor is only used for the speed between two edges.
"""

from __future__ import annotations

from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.estimation.fine_wheel import FineWheelOdometer


class DirectedWheelOdometer(FineWheelOdometer):
    """A wheel whose travel is its signed counts times the pitch."""

    def update(
        self,
        time: int,
        count: int,
        edge_time: int | None,
        command: float,
        is_duty: bool,
        command_since: int,
        reported_duty: float | None = None,
    ) -> None:
        """Apply one frame. `command`, in effect since `command_since` (ns), is a duty or rad/s;
        `reported_duty`: that of the motor at its end, if the board reports it."""
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
        self._explain(span, abs(steps), command, is_duty, reported_duty)
        self._update_speed(predicted, mean, steps, abs(steps), span, edge_span)
        self._place_between_edges(time, steps, span)

    def _set_direction(self, direction: int) -> None:
        """Both directions count at the same places of the disc: a reversal adds no uncertainty but
        the play between wheel and encoder."""
        if self.direction == -direction:
            self.reversals += 1
        self.direction = direction
