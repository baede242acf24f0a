"""Parts of common kits that a robot file cannot name: what comes nearest, and what to write.

The rows are in parts/unsupported.yaml. A misspelt name is recognised too, unless an allowed value
is nearer.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher
from functools import cache
from typing import NamedTuple

from diffbotctl import parts

NAME_CUTOFF = 0.75  # similarity of a misspelt name


class UnsupportedPart(NamedTuple):
    """A part that is not supported: why, and what to write."""

    cause: str
    fix: str


@cache
def unsupported_parts() -> dict[str, dict[str, UnsupportedPart]]:
    """By the last part of the field's path, and the name in small letters without punctuation."""
    return {
        field: {name: UnsupportedPart(**row) for name, row in named.items()}
        for field, named in parts.rows("unsupported").items()
    }


def unsupported_part(field: str, written: str, allowed: Iterable[str]) -> UnsupportedPart | None:
    """The part that `written` names in a field of a robot file, such as `imu.type`."""
    known_parts = unsupported_parts().get(field)
    if known_parts is None:
        return None
    name = _normal(written)
    values = [_normal(value) for value in allowed]
    without_maker = name.removeprefix("arduino").removeprefix("raspberrypi")
    if without_maker in values or any(value.startswith(name) for value in values):
        return None
    # Part numbers have suffixes: GP2Y0A21YK0F.
    for known, part in known_parts.items():
        if name.startswith(known) or (len(name) > 3 and known.startswith(name)):
            return part
    # A misspelt one with a suffix is compared without what exceeds the known name.
    similarity = {known: _similarity(name[: len(known)], known) for known in known_parts}
    similarity |= {value: _similarity(name, value) for value in values}
    nearest = max(similarity, key=lambda known: similarity[known])
    return known_parts.get(nearest) if similarity[nearest] >= NAME_CUTOFF else None


def _normal(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower()[:80]).removeprefix("sharp")


def _similarity(one: str, other: str) -> float:
    return SequenceMatcher(None, one, other).ratio()
