"""Kits that `diffbotctl new robot --kit` writes a robot file for."""

from __future__ import annotations

from typing import NamedTuple


class KitFile(NamedTuple):
    """A kit: what it is, its template, and what of it is not supported, if anything."""

    title: str
    template: str
    unsupported: str = ""


KITS = {
    "book_2wd": KitFile("Mega 2560, L298N, slotted discs, HC-05, Sharp sensor", "robot.yaml"),
    "uno_tb6612": KitFile("Uno, TB6612, slotted discs, Sharp sensor", "kit_uno_tb6612.yaml"),
    "nano_l298n_hc05": KitFile(
        "Nano, L298N, slotted discs, HC-05, Sharp sensor", "kit_nano_l298n_hc05.yaml"
    ),
    "ros_car": KitFile(
        "Mega 2560, TB6612, Hall encoders, MPU6050, HC-SR04, HC-05", "kit_ros_car.yaml"
    ),
    "four_wheels": KitFile(
        "four wheels in skid steering: Uno, L298N, slotted discs", "kit_four_wheels.yaml"
    ),
    "romi_32u4": KitFile(
        "chassis and encoders of a Romi",
        "kit_romi_32u4.yaml",
        "our firmware does not run on the Romi's board (32U4); the file has a Nano and two DRV8838 "
        "in its place",
    ),
    "xrp": KitFile(
        "chassis and encoders of an XRP",
        "kit_xrp.yaml",
        "our firmware does not run on the XRP's board (RP2040, RP2350); the file has an Uno and a "
        "DRV8835 in its place",
    ),
    "pico_tc1508s": KitFile(
        "Pico, TC1508S, slotted discs, Sharp sensor",
        "kit_pico_tc1508s.yaml",
    ),
}
