"""What changes while a simulated robot runs: its supply, friction, grip and encoders of its
wheels, its button."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import NamedTuple

from diffbotctl.config.simulation import Disturbance
from diffbotctl.time import NEVER, SECOND


class DisturbanceState(NamedTuple):
    """What acts at one time: factor of the supply, drag of the wheels (duty), shares of their turns
    by which they slide, encoders that lose every second slot or all, the stop button."""

    supply: float
    left_drag: float
    right_drag: float
    left_slide: float
    right_slide: float
    left_halved: bool
    right_halved: bool
    left_silent: bool
    right_silent: bool
    button: bool


class DisturbanceSchedule:
    """The disturbances of one run. `due`: when the next one begins or ends, ns."""

    def __init__(self, disturbances: Sequence[Disturbance]) -> None:
        self._spans = [
            (
                round(disturbance.start * SECOND),
                NEVER if disturbance.end is None else round(disturbance.end * SECOND),
                disturbance,
            )
            for disturbance in disturbances
        ]
        self.due = self._next(-1)

    def update(self, now: int) -> DisturbanceState:
        """What acts from `now` on."""
        active = [disturbance for start, end, disturbance in self._spans if start <= now < end]
        self.due = self._next(now)
        return DisturbanceState(
            prod(disturbance.supply for disturbance in active),
            sum(disturbance.left_drag for disturbance in active),
            sum(disturbance.right_drag for disturbance in active),
            max((disturbance.left_slide for disturbance in active), default=0.0),
            max((disturbance.right_slide for disturbance in active), default=0.0),
            any(disturbance.left_halved for disturbance in active),
            any(disturbance.right_halved for disturbance in active),
            any(disturbance.left_silent for disturbance in active),
            any(disturbance.right_silent for disturbance in active),
            any(disturbance.button for disturbance in active),
        )

    def _next(self, now: int) -> int:
        """The first beginning or end after `now`."""
        times = [time for start, end, _ in self._spans for time in (start, end)]
        return min((time for time in times if time > now), default=NEVER)
