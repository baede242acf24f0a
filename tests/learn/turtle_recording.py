"""Recordings of a turtle that is driven as by keys, in simulated time."""

from diffbotctl.config.load import load
from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import Twist
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run

PERIOD = 100_000_000  # ns between two commands


class DrivenRun(Run):
    """A run of the turtle with `legs`: (seconds, linear, angular), one after the other."""

    def __init__(self, path, legs):
        self.legs, self.sent = list(legs), -PERIOD
        duration = sum(seconds for seconds, _, _ in legs) - 0.2
        options = RunOptions(fast=True, duration=duration, stay=True, record=path)
        super().__init__(load("turtle"), options, tell=lambda text: None)

    def _idle(self):
        idle = super()._idle()

        def drive():
            if idle is not None:
                idle()
            now = self.engine.last_instant
            if now - self.sent >= PERIOD:
                self.sent = now
                self.operator.outbox.append(Delivery("operator.twist", self._twist(now)))
                self.operator.outbox_due = now + 1

        return drive

    def _twist(self, now):
        left = now / 1e9
        for seconds, linear, angular in self.legs:
            if left < seconds:
                return Twist(now, linear, angular)
            left -= seconds
        return Twist(now, 0.0, 0.0)


TURNS = [(3.0, 1.0, 0.0), (3.0, 0.2, 1.5), (3.0, 0.2, -1.5), (1.0, 0.0, 0.0)]


def record(path, legs=TURNS):
    """Record a turtle that drives `legs`."""
    DrivenRun(path, legs).go()
