"""What no picture of the wires shows, and a person must see to before the battery is connected."""

from __future__ import annotations

from collections.abc import Iterator

from diffbotctl.config.harness import HALVES, has_radio
from diffbotctl.config.robot import Robot


def notes(robot: Robot) -> Iterator[str]:
    """What no wire shows, in the order in which a person comes upon it."""
    yield (
        "Take the jumpers ENA and ENB off the L298N: with them on, the motors know no speed but "
        "full, and each fights its PWM pin."
    )
    if robot.board.supply == "regulator":
        yield "Leave the L298N's 5 V jumper on: its regulator feeds the board. At most 12 V then."
    else:
        yield "The L298N's 5 V terminal stays free: its regulator feeds the L298N alone."
    yield "One ground for all: battery, L298N and board. Without it no signal means anything."
    full = robot.battery.full
    battery = f"{full:g} V when full" if full is not None else "7 to 12 V"
    yield (
        f"Battery: {battery}. The L298N takes at most 35 V, loses about 2 V, and gives 2 A a "
        "motor; the kit's motors are made for 5 to 9 V."
    )
    if has_radio(robot) and robot.link.level == "divider":
        yield "The HC-05 runs on 5 V, but its RXD takes 3.3 V: 1 kOhm in the wire, 2 kOhm to GND."
    if robot.sensors:
        yield "Solder 10 uF across a Sharp sensor's VCC and GND: it draws its current in gulps."
    yield (
        "10 kOhm from ENA and from ENB to GND keep the motors still while the board is flashed, "
        "when its pins float."
    )
    for name in HALVES:
        if getattr(robot.drive, name).motor.reversed:
            first, second = HALVES[name][1:3]
            yield (
                f"The {name} motor is mounted mirrored (reversed: true): {first} low and {second} "
                "high drive it forward."
            )
