"""The udev rule that gives a port to its people, and keeps other programs off it."""

from __future__ import annotations

from diffbotctl.ports.tree import Usb

FILE = "/etc/udev/rules.d/70-diffbotctl.rules"  # below 73, where uaccess takes effect
RELOAD = "sudo udevadm control --reload && sudo udevadm trigger"


def rule(usb: Usb) -> str:
    """One line for one kind of USB device."""
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{usb.vendor:04x}", '
        f'ATTRS{{idProduct}}=="{usb.product:04x}", GROUP="dialout", MODE="0660", '
        'TAG+="uaccess", ENV{ID_MM_DEVICE_IGNORE}="1"'
    )
