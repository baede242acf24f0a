"""States of the link to a board with our firmware, their transitions, and the faults it reports."""

from __future__ import annotations

from enum import StrEnum, auto

from diffbotctl.errors import join_words
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.messages import LinkState


class HostState(StrEnum):
    """State of the link to one board."""

    CLOSED = auto()  # no port
    OPENING = auto()  # port open, no baud rate tried yet
    SEARCHING = auto()  # a board with our firmware has not answered yet
    SETTLING = auto()  # it has, but does not use the robot's settings
    UP = auto()
    STALE = auto()  # no frames for 250 ms


class HostEvent(StrEnum):
    """What changes the state."""

    PORT_OPENED = auto()
    PORT_CLOSED = auto()
    SETTINGS_MATCH = auto()  # the board uses the robot's settings
    SETTINGS_DIFFER = auto()  # it uses others, or none
    SETTINGS_REJECTED = auto()  # it cannot use them, or not now
    VERSION_DIFFERS = auto()  # another version of the protocol, or another type of board
    FRAME = auto()  # a state frame
    SILENCE = auto()  # frames have been missing for the time that the state allows
    TIMEOUT = auto()  # the search or the settling takes too long; it goes on


_ANY_STATE = {
    HostEvent.PORT_OPENED: HostState.OPENING,
    HostEvent.PORT_CLOSED: HostState.CLOSED,
}
_OPEN = _ANY_STATE | {
    HostEvent.SETTINGS_MATCH: HostState.UP,
    HostEvent.SETTINGS_DIFFER: HostState.SETTLING,
}
_SEARCH = _OPEN | {
    HostEvent.VERSION_DIFFERS: HostState.SEARCHING,
    HostEvent.TIMEOUT: HostState.SEARCHING,
}
_ANSWERED = _OPEN | {
    HostEvent.VERSION_DIFFERS: HostState.SETTLING,
    HostEvent.SETTINGS_REJECTED: HostState.SETTLING,
}
TRANSITIONS: dict[HostState, dict[HostEvent, HostState]] = {
    HostState.CLOSED: _ANY_STATE,
    HostState.OPENING: _SEARCH,
    HostState.SEARCHING: _SEARCH,
    HostState.SETTLING: _ANSWERED
    | {HostEvent.SILENCE: HostState.SEARCHING, HostEvent.TIMEOUT: HostState.SETTLING},
    HostState.UP: _ANSWERED | {HostEvent.SILENCE: HostState.STALE},
    HostState.STALE: _ANSWERED
    | {HostEvent.FRAME: HostState.UP, HostEvent.SILENCE: HostState.SEARCHING},
}
LINK_STATES: dict[HostState, LinkState] = {
    HostState.CLOSED: "lost",
    HostState.OPENING: "opening",
    HostState.SEARCHING: "negotiating",
    HostState.SETTLING: "negotiating",
    HostState.UP: "up",
    HostState.STALE: "stale",
}


STALLS = {"left": frames.FLAG_LEFT_STALL, "right": frames.FLAG_RIGHT_STALL}
STORMS = {"left": frames.FLAG_LEFT_STORM, "right": frames.FLAG_RIGHT_STORM}
STALL_CAUSE = "a motor had power and its encoder gave no edges: {sides}"
STORM_CAUSE = "an encoder's pin changes faster than its wheel can turn: {sides}"
STORM_FIX = "check its wire, its supply and its ground"
GYRO_CAUSES = {
    frames.FLAG_GYRO_SILENT: "the IMU does not answer at its I2C address",
    frames.FLAG_GYRO_BUS: "the I2C bus of the IMU is held low, or has no pull-up resistors",
    frames.FLAG_GYRO_STUCK: "the rate that the IMU measures does not change",
    frames.FLAG_GYRO_RANGE: f"the robot turned faster than the {frames.GYRO_MAXIMUM} deg/s that "
    "the IMU measures",
    frames.FLAG_GYRO_GRAVITY: "by gravity the axis of the IMU that the robot file states as "
    "pointing up does not: the IMU is upside down or on its side, or the robot has tipped over",
}
_GYRO_FIX = (
    "check its supply, its wires SDA and SCL, and the address (AD0) in the robot file; without it: "
    "imu: {type: none}"
)
_GRAVITY_FIX = (
    "state the printed axis that points up, such as imu: {axes: -z}: `diffbotctl calibrate imu` "
    "finds it; or screw the IMU down as stated"
)
BATTERY_CAUSE = "the battery is low{volts}; charge it"
BATTERY_STOP_TEXT = "the robot stops when it stays low for 10 s"
BUTTON_CAUSE = "the stop button is pressed"
UNKNOWN_CAUSE = "a wheel fault; see the wiring of motors and encoders"


def wheel_fault_cause(flags: int) -> str:
    causes = []
    for sides, cause in ((STALLS, STALL_CAUSE), (STORMS, STORM_CAUSE)):
        faulty = _sides(flags, sides)
        if faulty:
            causes.append(cause.format(sides=join_words(faulty, "and")))
    if _sides(flags, STORMS):
        causes.append(STORM_FIX)
    return "; ".join(causes) or UNKNOWN_CAUSE


def gyro_fix(cause: str) -> str:
    """What to do about a cause of GYRO_CAUSES."""
    if GYRO_CAUSES[frames.FLAG_GYRO_GRAVITY] in cause:
        return _GRAVITY_FIX
    return _GYRO_FIX


def gyro_cause(flags: int) -> str:
    """Why the gyro's turn is wrong, from the board's flags."""
    causes = [cause for flag, cause in GYRO_CAUSES.items() if flags & flag]
    return "; ".join(causes) or "the board reports a fault of the IMU"


def storm_text(flags: int) -> str:
    """Warning about encoders that cannot be used while the robot stands; empty without any."""
    noisy = _sides(flags, STORMS)
    if not noisy:
        return ""
    cause = STORM_CAUSE.format(sides=join_words(noisy, "and"))
    return f"{cause}; {STORM_FIX}; the robot does not drive until it is quiet"


def _sides(flags: int, sides: dict[str, int]) -> list[str]:
    return [side for side, flag in sides.items() if flags & flag]
