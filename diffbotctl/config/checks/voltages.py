"""Wiring: voltages that a part does not stand, and pins that something else pulls at."""

from __future__ import annotations

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.check_context import CheckContext
from diffbotctl.config.drive_sides import SIDES
from diffbotctl.config.harness import has_radio

# V at the input of a linear regulator of 5 V (Mega's VIN; 78M05 of an L298N board): it needs 2 V
# more than it gives, and 12 V at 0.2 A are 1.4 W of heat, the most that its bare case sheds.
LEAST_SUPPLY, MOST_SUPPLY = 7.0, 12.0
MOST_DRIVER = 35.0  # V; the L298N board's supply (data sheet of the module)
LIGHT = "13"  # the pin of the light L, on all boards here


def check_wiring(case: CheckContext) -> None:
    """Warn of what the wiring would make of a robot whose pins and ports are right."""
    _check_radio(case)
    _check_light(case)
    _check_supply(case)


def _check_radio(case: CheckContext) -> None:
    known = case.known("link.uart", "link.level", "board.type")
    if known is None or case.robot is None or not has_radio(case.robot):
        return
    uart, level, kind = known
    if level == "direct":
        cause = "the board's 5 V go straight into the HC-05's RXD, which is made for 3.3 V"
        fix = "put 1 kOhm into the wire and 2 kOhm from RXD to GND, and say level: divider"
        case.warn("W-WIRING-LEVEL", case.blame("link.level"), cause, fix)
    if uart == 0:
        others = [str(each) for each in BOARDS[kind].links["diffbot"] if each]
        cause = "the HC-05 shares pins 0 and 1 with the USB port: flashing fails while it is there"
        fix = f"use uart: {others[0]}" if others else "unplug it before you plug in the USB cable"
        case.warn("W-WIRING-SHARED", case.blame("link.radio", "link.uart"), cause, fix)


def _check_light(case: CheckContext) -> None:
    for side in SIDES:
        pin = case.known(f"drive.{side}.motor.enable")
        if pin is not None and str(pin[0]) == LIGHT:
            cause = (
                "the board's light hangs on pin 13, and the bootloader blinks it at each start: "
                f"the {side} wheel will jerk"
            )
            place = case.robot_place("drive", side, "motor", "enable")
            case.warn("W-WIRING-LIGHT", place, cause, "give the motor another pin with PWM")
    button = case.known("board.stop_button")
    if button is not None and str(button[0]) == LIGHT:
        cause = "the board's light pulls pin 13 down, so the button may seem pressed for ever"
        place = case.robot_place("board", "stop_button")
        case.warn("W-WIRING-LIGHT", place, cause, "give the button another pin")


def _check_supply(case: CheckContext) -> None:
    known = case.known("battery.full", "board.supply")
    if known is None:
        return
    full, supply = known
    place = case.blame("battery.full", "board.supply")
    if full > MOST_DRIVER:
        cause = f"{full:g} V are more than the L298N stands ({MOST_DRIVER:g} V)"
        case.warn("W-WIRING-SUPPLY", place, cause, "take a battery of 7 to 12 V")
    elif supply != "usb" and not LEAST_SUPPLY <= full <= MOST_SUPPLY:
        who = "the board's VIN" if supply == "vin" else "the L298N's 5 V regulator"
        why = (
            "the board would restart whenever a motor starts"
            if full < LEAST_SUPPLY
            else "it would get too hot"
        )
        cause = f"{who} takes {LEAST_SUPPLY:g} to {MOST_SUPPLY:g} V, not {full:g} V: {why}"
        fix = "take two lithium cells (8.4 V), or feed the board from USB (board.supply: usb)"
        case.warn("W-WIRING-SUPPLY", place, cause, fix)
