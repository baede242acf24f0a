"""Checks of the encoders' channels."""

from __future__ import annotations

from diffbotctl.config.board_pins import SIMULATED
from diffbotctl.config.checks.context import CheckContext, check
from diffbotctl.config.robot import SIDES

CODE = "E-ENCODER-CHANNELS"


@check("drive.left.encoder.channels", "drive.right.encoder.channels")
def check_channels(context: CheckContext, left: int, right: int) -> None:
    """Compare the number of channels with the stated pins, the other side and the firmware."""
    if left != right:
        if 0 in (left, right):
            return  # a wheel without an encoder has a check of its own
        place = context.error_place("drive.right.encoder.channels", "drive.left.encoder.channels")
        one, two = ("left", "right") if left < right else ("right", "left")
        cause = f"the {one} encoder has one channel, the {two} one has two"
        context.error(CODE, place, cause, "write the same number for both encoders")
        return
    has_two = left == 2
    for side in SIDES:
        _check_pin(context, side, has_two)
    if has_two:
        _check_two(context)


def _check_pin(context: CheckContext, side: str, has_two: bool) -> None:
    assert context.robot is not None
    pin_b = getattr(getattr(context.robot.drive, side).encoder, "pin_b", None)
    if context.values("board.type") in (None, (SIMULATED,)):
        return
    place = context.error_place(f"drive.{side}.encoder.pin_b", f"drive.{side}.encoder.channels")
    if has_two and pin_b is None:
        cause = f"the {side} encoder has two channels, and pin_b, that of channel B, is missing"
        fix = f"add pin_b: and the board's pin; {_suitable_for_b(context)} is suitable"
        context.error(CODE, place, cause, fix)
    elif not has_two and pin_b is not None:
        cause = f"pin_b of the {side} encoder is stated, but channels is 1"
        context.error(CODE, place, cause, "write channels: 2, or pin_b: none")


def _suitable_for_b(context: CheckContext) -> str:
    board = context.board
    if board is None or board.counts_of_slot == 1:
        return "any digital pin"
    return f"any from {board.interrupts[0]} to {board.interrupts[-1]}"


def _check_two(context: CheckContext) -> None:
    if context.values("link.protocol") == ("rosserial",):
        place = context.error_place("drive.encoder.channels", "link.protocol")
        cause = "the book's firmware reads one channel of each encoder"
        fix = "write channels: 1, or flash our firmware: link: {protocol: diffbot}"
        context.error(CODE, place, cause, fix)
    for side in SIDES:
        if context.values(f"drive.{side}.encoder.edge") == ("falling",):
            place = context.error_place(f"drive.{side}.encoder.edge", "drive.encoder.edge")
            cause = "two channels count where channel A rises going forward, and falls going back"
            context.error(CODE, place, cause, "leave edge: out, or write rising")
            return
