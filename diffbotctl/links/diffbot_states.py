"""States of the link to a board with our firmware, and their transitions."""

from __future__ import annotations

from enum import StrEnum, auto

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
