"""The serial line carries what the board wants to say."""

from __future__ import annotations

from math import floor

from diffbotctl.config import wire
from diffbotctl.config.boards import SIMULATED
from diffbotctl.config.case import Case


def check(case: Case) -> None:
    """Compare the telemetry's bytes a second with what the line carries."""
    known = case.known(
        "board.telemetry", "board.edge_times", "link.protocol", "link.baud", "link.uart"
    )
    if known is None or case.robot is None:
        return
    if case.robot.board.type == SIMULATED:
        return  # no line carries anything
    rate, has_edge_times, protocol, _, _ = known
    baud = wire.baud_of(case.robot.link)
    frame = wire.frame_bytes(protocol, has_edge_times)
    load, room = rate * frame, wire.capacity(baud)
    if load <= wire.COMFORTABLE * room:
        return
    cause = (
        f"{rate:g} frames of {frame} bytes are {load:.0f} bytes a second; "
        f"at {baud} baud the line carries {room:.0f}"
    )
    most = floor(wire.COMFORTABLE * room / frame)
    fix = f"at most {most} Hz leaves room for replies; or raise link.baud"
    if has_edge_times and protocol == "diffbot":
        fix += ", or set edge_times: false"
    place = case.blame("board.telemetry", "link.baud", "board.edge_times")
    if load > room:
        case.error("E-LINK-BUDGET", place, cause, fix)
    else:
        case.warn("W-LINK-BUDGET", place, f"{cause}: replies will be late", fix)
