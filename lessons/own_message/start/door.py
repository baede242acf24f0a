from typing import Annotated, Literal, NamedTuple

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Field, Float64, Time


class Sensor(Block):
    """What is known of a door from its angle."""

    angle = In(Float64, help="Angle of the door in rad.")

    def react(self, now, angle):
        return None


class Alarm(Block):
    """How far the door is open."""

    opening = Out(Float64, help="Its angle in rad while it is open, else 0.")

    def react(self, now):
        return None
