"""The board's dead-man's time outlasts the gap between two commands."""

from __future__ import annotations

from diffbotctl.config.case import Case

SAFE = 3  # commands; two in a row may be lost to noise without a stop


def check(case: Case) -> None:
    """Compare the dead-man's time with the time from one command to the next."""
    known = case.known("board.deadman", "board.telemetry", "link.protocol")
    if known is None or known[2] != "diffbot":
        return  # the book's firmware has none; `run` says so
    deadman, rate, _ = known
    commands = deadman * rate
    place = case.blame("board.deadman", "board.telemetry")
    cause = (
        f"commands go out with each frame, every {1000 / rate:.0f} ms; "
        f"the board stops {deadman * 1000:.0f} ms after the last"
    )
    fix = "raise board.telemetry, or board.deadman up to 500 ms"
    if commands <= 1:
        case.error("E-DEADMAN", place, f"{cause}, so it would stop between any two", fix)
    elif commands < SAFE:
        case.warn("W-DEADMAN", place, f"{cause}, so two lost ones stop it", fix)
