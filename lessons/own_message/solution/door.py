from typing import Annotated, Literal, NamedTuple

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Field, Float64, Time


class Door(NamedTuple):
    """A door."""

    time: Time
    angle: Annotated[float, Field("rad", "Angle from the frame.")]
    state: Literal["open", "closed"]


class Sensor(Block):
    """What is known of a door from its angle."""

    angle = In(Float64, help="Angle of the door in rad.")
    door = Out(Door, help="The door.")

    def react(self, now, angle):
        if angle is None:
            return None
        return Door(angle.time, angle.data, "open" if angle.data >= 0.2 else "closed")


class Alarm(Block):
    """How far the door is open."""

    door = In(Door, help="The door.")
    opening = Out(Float64, help="Its angle in rad while it is open, else 0.")

    def react(self, now, door):
        if door is None:
            return None
        return Float64(door.time, door.angle if door.state == "open" else 0.0)
