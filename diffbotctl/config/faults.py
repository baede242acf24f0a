"""Faults of a simulated robot: what goes wrong in it, when, for how long, on which side, how much.

The rows of faults.yaml declare every fault once: the checks, the schema, the reference and the
plant read them. Times and sizes may be ranges, from which the seed of the robot draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import yaml

from diffbotctl.config.section_reader import read_setting
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem
from diffbotctl.params import Choice, Declaration, Param, Section, Spread

FaultSide = Literal["left", "right", "both", "either"]


class FaultKind(NamedTuple):
    """A fault: its sentence, its size if it has one, and whether it is of one wheel.

    `lasts`: how long (s) it usually acts; None: until the end of the run. `needs`: what a robot
    must have for it. `is_of_shipped_plant`: whether a plant of one's own cannot have it.
    """

    help: str
    size: Declaration | None = None
    has_side: bool = False
    lasts: float | None = None
    needs: Sequence[str] = ()
    is_of_shipped_plant: bool = False


def _size(unit: str, usual: float, maximum: float, help: str) -> Declaration:
    default = Spread(usual, usual)
    declared: Any = Param(
        Spread, unit=unit, default=default, help=help, key="size", minimum=0.0, maximum=maximum
    )
    return cast(Declaration, declared)


def _read_faults() -> dict[str, FaultKind]:
    text = Path(__file__).with_name("faults.yaml").read_text(encoding="utf-8")
    rows = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return {
        name: FaultKind(**row | ({"size": _size(*row["size"])} if "size" in row else {}))
        for name, row in rows.items()
    }


FAULTS = _read_faults()


class FaultEntry(Section):
    """A fault that begins, and may end, while the simulated robot runs."""

    fault = Param(str, choices=tuple(FAULTS), help="What goes wrong.")
    at = Param(
        Spread,
        unit="s",
        minimum=0.0,
        default=Spread(0.0, 0.0),
        help="Begins at this time, or between [earliest, latest].",
    )
    duration: Spread | None = Param(
        Spread,
        unit="s",
        above=0.0,
        none=True,
        default=None,
        key="for",
        help="Ends after this time, or between [shortest, longest]; none: never.",
    )
    side: FaultSide | None = Choice(
        FaultSide, None, "Which wheel; `either`: the seed draws one; none: both."
    )
    sensor: str | None = Param(
        str,
        none=True,
        default=None,
        help="Name of the distance sensor of a fault range_...; none: all of the robot.",
    )
    program: str | None = Param(
        str,
        none=True,
        default=None,
        help="Name of the program of a fault program_...; none: all of the pipeline.",
    )
    size: Any = Param(
        object,
        none=True,
        default=None,
        help="How much, or between [least, greatest]: see the fault; none: its usual size.",
    )


def read_sizes(
    entries: Sequence[FaultEntry | None], values: Sequence[Value], problems: list[Problem]
) -> None:
    """Convert the sizes of `entries`, which are in `values`, as their faults declare them."""
    for entry, value in zip(entries or (), values, strict=False):
        if entry is None or entry.fault not in FAULTS:
            continue
        kind, written = FAULTS[entry.fault], value.entries.get("size")
        if written is None or entry.size is None:
            continue
        if kind.size is None:
            entry.size = None
            cause = f"the fault {entry.fault} has no size"
            problems.append(Problem("E-FAULT", written.name_place, cause, "remove it"))
        else:
            entry.size = read_setting(written, kind.size, problems)
