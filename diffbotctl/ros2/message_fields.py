"""Fills ROS messages from nested dictionaries."""

from __future__ import annotations

from typing import Any

from diffbotctl.ros2.conversion import Fields
from diffbotctl.ros2.stamps import seconds_and_nanoseconds


def fill(message: Any, fields: Fields) -> Any:
    """Set the fields of a ROS message; those that are not named keep their values."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def fill_header(message: Any, stamp: int, frame: str) -> Any:
    """Set stamp (ns) and frame of a message with a header."""
    header = message.header
    header.stamp.sec, header.stamp.nanosec = seconds_and_nanoseconds(stamp)
    header.frame_id = frame
    return message


def nanoseconds(stamp: Any) -> int:
    """A builtin_interfaces/Time in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
