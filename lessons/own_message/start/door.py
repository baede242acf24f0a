from typing import Annotated, Literal, NamedTuple

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Bool, Field, Float64, Time


class Sensor(Block):
    """What is known of a door from its angle."""

    angle = In(Float64, help="Angle of the door in rad.")

    def react(self, now, angle):
        return None


class Alarm(Block):
    """True while the door is open."""

    open = Out(Bool, help="Whether it is open.")

    def react(self, now):
        return None
