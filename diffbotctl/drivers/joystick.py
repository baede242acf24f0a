"""Driver of joysticks and gamepads through the kernel's event interface (evdev)."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import struct
from pathlib import Path
from typing import Literal

from diffbotctl.block import Out
from diffbotctl.device import DeviceDriver, DeviceError, Reading
from diffbotctl.messages import Twist
from diffbotctl.params import Choice, Param
from diffbotctl.time import MILLISECOND, SECOND

# linux/input.h: seconds, microseconds, type, code, value; on 32-bit systems shorter.
EVENT = struct.Struct("llHHi")
EVENTS_AT_ONCE = 64
SYN, KEY, ABS = 0, 1, 3  # types of events
SYN_DROPPED = 3  # the kernel's queue was full: events were lost
AXIS_INFO = struct.Struct("6i")  # value, minimum, maximum, fuzz, flat, resolution
AXIS_RANGE = (-32768, 32767)  # of a recorded stream of events, which has no ranges
PUBLISH_PERIOD = 50 * MILLISECOND

AxisName = Literal["left_x", "left_y", "right_x", "right_y", "trigger_left", "trigger_right"]
ButtonName = Literal[
    "left_shoulder", "right_shoulder", "south", "east", "north", "west", "trigger", "thumb"
]
AXES: dict[AxisName, int] = {
    "left_x": 0,
    "left_y": 1,
    "trigger_left": 2,
    "right_x": 3,
    "right_y": 4,
    "trigger_right": 5,
}
BUTTONS: dict[ButtonName, int] = {
    "trigger": 0x120,
    "thumb": 0x121,
    "south": 0x130,
    "east": 0x131,
    "north": 0x133,
    "west": 0x134,
    "left_shoulder": 0x136,
    "right_shoulder": 0x137,
}


class Joystick(DeviceDriver):
    """Drive with a joystick or gamepad while its dead-man button is held.

    Forward drives forward, left turns left. Nothing is published while the button is not held; the
    last message is zero. A button that is held when the device is opened, or when events were lost,
    counts only when it is pressed again. The same holds after `silence_max` without any event: a
    wireless gamepad out of range looks like one whose stick is held still.

    sources:
      joystick: {driver: joystick, timeout: 0.3 s, with: {speed: 0.2 m/s}}
    """

    device = Param(
        str, default="auto", help="Path below /dev/input; auto: the first joystick that is found."
    )
    dead_man: ButtonName = Choice(
        ButtonName, default="left_shoulder", help="Button that is held to drive."
    )
    forward: AxisName = Choice(AxisName, default="left_y", help="Axis of the speed.")
    turn: AxisName = Choice(AxisName, default="left_x", help="Axis of the turn rate.")
    speed = Param(
        float, unit="m/s", default=0.2, above=0.0, maximum=2.0, help="Speed at full deflection."
    )
    turn_rate = Param(
        float, unit="rad/s", default=1.0, above=0.0, maximum=10.0, help="Turn rate at full."
    )
    dead_zone = Param(
        float, unit="1", default=0.1, minimum=0.0, maximum=0.5, help="Deflection that counts as 0."
    )
    silence_max = Param(
        float,
        unit="s",
        default=1.0,
        minimum=0.2,
        maximum=5.0,
        help="Time without any event after which the button counts as released.",
    )

    twist = Out(Twist, help="The velocity, 20 times a second while the button is held.")

    poll_period = PUBLISH_PERIOD / SECOND
    is_on_demand = True

    def __init__(self, **values: object) -> None:
        super().__init__(**values)
        self.path = self.device
        self.file = -1
        self.ranges: dict[int, tuple[int, int]] = {}
        self.rest = b""
        self.is_held = False
        self.values: dict[int, int] = {}  # of the axes
        self.publish_due = self.last_event = 0

    def device_name(self) -> str:
        return self.path

    def open(self) -> int:
        """Open the event device; nothing is held."""
        self.path = find_joystick(Path("/dev/input")) if self.device == "auto" else self.device
        self.file = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        if not has_events(self.file):
            fix = "name an event device, such as `device: /dev/input/event5`"
            raise DeviceError("it is not an input device", fix)
        self.ranges = {axis: axis_range(self.file, axis) for axis in AXES.values()}
        self.rest, self.is_held, self.publish_due = b"", False, 0
        self.values.clear()
        return self.file

    def read(self, now: int) -> list[Reading]:
        """The velocity when it is due, and a zero at once when the button is released."""
        was_held = self.is_held
        self._read_events(now)
        if self.is_held and now - self.last_event > self.silence_max * SECOND:
            self.is_held = False
            self.log.warning(f"no event for {self.silence_max:g} s: press the button again")
        if was_held and not self.is_held:
            return [Reading("twist", Twist(now, 0.0, 0.0)), Reading("twist", None)]
        if not self.is_held or now < self.publish_due:
            return []
        self.publish_due = now + PUBLISH_PERIOD - MILLISECOND  # the next poll may be early by that
        linear = -self.speed * self._deflection(AXES[self.forward])
        angular = -self.turn_rate * self._deflection(AXES[self.turn])
        return [Reading("twist", Twist(now, linear + 0.0, angular + 0.0))]

    def close(self) -> None:
        if self.file >= 0:
            os.close(self.file)
        self.file = -1

    def _read_events(self, now: int) -> None:
        while True:
            try:
                data = os.read(self.file, EVENTS_AT_ONCE * EVENT.size)
            except BlockingIOError:
                return
            if not data:
                raise OSError(errno.ENODEV, "")
            self.last_event = now
            self.rest += data
            whole = len(self.rest) // EVENT.size * EVENT.size
            for _, _, kind, code, value in EVENT.iter_unpack(self.rest[:whole]):
                self._take(kind, code, value)
            self.rest = self.rest[whole:]

    def _take(self, kind: int, code: int, value: int) -> None:
        if kind == SYN and code == SYN_DROPPED:
            self.is_held = False
        elif kind == KEY and code == BUTTONS[self.dead_man]:
            self.is_held = value == 1 or (value == 2 and self.is_held)  # 2 is a repetition
        elif kind == ABS:
            self.values[code] = value

    def _deflection(self, axis: int) -> float:
        """-1 to 1; an axis without an event yet is in its middle."""
        minimum, maximum = self.ranges[axis]
        if axis not in self.values:
            return 0.0
        share = 2.0 * (self.values[axis] - minimum) / (maximum - minimum) - 1.0
        share = min(max(share, -1.0), 1.0)
        beyond = max(abs(share) - self.dead_zone, 0.0) / (1.0 - self.dead_zone)
        return beyond if share > 0 else -beyond


def find_joystick(folder: Path) -> str:
    """The first event device that udev calls a joystick. Raises DeviceError."""
    found = sorted(folder.glob("by-id/*-event-joystick")) or sorted(
        folder.glob("by-path/*-event-joystick")
    )
    if not found:
        fix = "plug one in, or name its device: `device: /dev/input/event5`"
        raise DeviceError(f"there is no joystick below {folder}", fix)
    return str(found[0])


def has_events(file: int) -> bool:
    """Whether it has a version of evdev (EVIOCGVERSION), or is a pipe of recorded events."""
    if stat.S_ISFIFO(os.fstat(file).st_mode):
        return True
    try:
        fcntl.ioctl(file, 2 << 30 | 4 << 16 | ord("E") << 8 | 0x01, bytes(4))
    except OSError:
        return False
    return True


def axis_range(file: int, axis: int) -> tuple[int, int]:
    """Minimum and maximum of an axis, as the kernel knows them (EVIOCGABS)."""
    request = 2 << 30 | AXIS_INFO.size << 16 | ord("E") << 8 | 0x40 + axis
    try:
        data = fcntl.ioctl(file, request, bytes(AXIS_INFO.size))
    except OSError:  # no such axis, or a recorded stream of events
        return AXIS_RANGE
    _, minimum, maximum, *_ = AXIS_INFO.unpack(data)
    return (minimum, maximum) if minimum < maximum else AXIS_RANGE
