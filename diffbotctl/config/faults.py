"""Faults of a simulated robot: what goes wrong in it, when, for how long, on which side, how much.

The table FAULTS declares every fault once: the checks, the schema, the reference and the plant read
it. Times and sizes may be ranges, from which the seed of the robot draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, cast

from diffbotctl.config.section_reader import read_setting
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import Problem
from diffbotctl.params import Choice, Declaration, Param, Section, Spread

FaultSide = Literal["left", "right", "both", "either"]


def _size(
    unit: str, default: float, help: str, minimum: float = 0.0, maximum: float | None = None
) -> Declaration:
    """The declaration of a fault's size."""
    declared: Any = Param(
        Spread,
        unit=unit,
        default=Spread(default, default),
        help=help,
        key="size",
        minimum=minimum,
        maximum=maximum,
    )
    return cast(Declaration, declared)


class FaultKind(NamedTuple):
    """A fault: its sentence, its size if it has one, and whether it is of one wheel.

    `lasts`: how long (s) it usually acts; None: until the end of the run.
    """

    help: str
    size: Declaration | None = None
    has_side: bool = False
    lasts: float | None = None


FAULTS: dict[str, FaultKind] = {
    "edges_missed": FaultKind(
        "Pulses of an encoder of one channel do not reach the board.",
        _size("1", 0.05, "Share of the slots.", maximum=1.0),
        has_side=True,
    ),
    "edges_doubled": FaultKind(
        "Edges of an encoder of one channel are followed by a second one.",
        _size("1", 0.03, "Share of the edges.", maximum=1.0),
        has_side=True,
    ),
    "edges_halved": FaultKind(
        "An encoder of one channel gives a pulse for every second slot only.", has_side=True
    ),
    "edges_silent": FaultKind("An encoder of one channel gives no pulses.", has_side=True),
    "edges_chatter": FaultKind(
        "Each edge of an encoder of one channel bounces.",
        _size("s", 0.003, "Longest time of a bounce.", maximum=0.01),
        has_side=True,
    ),
    "encoder_dead": FaultKind("The level of an encoder's wire does not change.", has_side=True),
    "encoder_floating": FaultKind(
        "An encoder's wire is off, and picks up the mains.", has_side=True
    ),
    "encoder_reversed": FaultKind(
        "The two channels of an encoder are exchanged, so that it counts backwards.", has_side=True
    ),
    "encoders_exchanged": FaultKind("The plugs of both encoders are exchanged."),
    "motor_dead": FaultKind("A wire of a motor is off.", has_side=True),
    "motor_reversed": FaultKind("The leads of a motor are reversed.", has_side=True),
    "motors_exchanged": FaultKind("The leads of both motors are exchanged."),
    "wheel_blocked": FaultKind("A wheel cannot turn.", has_side=True),
    "wheel_drag": FaultKind(
        "A wheel has more friction.",
        _size("1", 0.15, "Duty that overcomes it; more than 1 blocks.", maximum=10.0),
        has_side=True,
    ),
    "wheel_slip": FaultKind(
        "The floor is slippery: a wheel slips at random.",
        _size("m", 0.005, "Standard deviation after 1 m of its way.", maximum=0.1),
        has_side=True,
    ),
    "wheel_slide": FaultKind(
        "A wheel slides on the floor.",
        _size("1", 1.0, "Share of its turn; 1: it spins in place.", maximum=1.0),
        has_side=True,
    ),
    "wheel_lifted": FaultKind("A wheel is off the floor, and turns freely.", has_side=True),
    "robot_pushed": FaultKind(
        "The robot is pushed sideways, to the left unless `side` is right; its wheels slide.",
        _size("m", 0.05, "Way that it is pushed.", maximum=1.0),
        has_side=True,
        lasts=0.5,
    ),
    "robot_moved": FaultKind(
        "The robot is lifted and put down elsewhere, at a heading that the seed draws.",
        _size("m", 0.3, "Distance to that place, in a direction that the seed draws.", maximum=5.0),
    ),
    "battery_step": FaultKind(
        "The voltage of the battery changes.",
        _size("1", 0.85, "Factor of the voltage.", maximum=2.0),
    ),
    "battery_sag": FaultKind(
        "The battery is weak: its voltage drops under load.",
        _size("1", 0.3, "Share of the voltage lost at full duty of both motors.", maximum=0.9),
    ),
    "battery_cut": FaultKind("The motors have no supply."),
    "board_reset": FaultKind("The board restarts."),
    "stop_button": FaultKind("The stop button is pressed."),
    "link_cut": FaultKind("The link carries nothing in either direction."),
    "link_loss": FaultKind(
        "The link loses frames and commands.", _size("1", 0.2, "Share of them.", maximum=1.0)
    ),
    "link_delay": FaultKind(
        "The link is late in both directions.", _size("s", 0.1, "Further delay.", maximum=5.0)
    ),
    "link_damage": FaultKind(
        "Bytes of the link are damaged, in both directions.",
        _size("1", 0.01, "Share of the bytes.", maximum=1.0),
    ),
    "range_stuck": FaultKind("A distance sensor repeats its last reading."),
    "range_silent": FaultKind("A distance sensor gives no voltage, or does not answer."),
    "range_endless": FaultKind("The echo of an ultrasonic sensor does not end."),
    "lidar_zero": FaultKind("A laser scanner measures 0 in all directions."),
    "lidar_late": FaultKind(
        "The turns of a laser scanner come late.", _size("s", 0.5, "Delay.", maximum=10.0)
    ),
    "lidar_blocked": FaultKind("A laser scanner cannot turn: nothing comes from it."),
    "imu_silent": FaultKind("The IMU does not answer."),
    "imu_bus_held": FaultKind("The bus of the IMU is held low."),
    "imu_stuck": FaultKind("The rate that the IMU measures does not change."),
    "imu_biased": FaultKind(
        "The gyro measures a rate at rest.",
        _size("rad/s", 0.1, "That rate.", maximum=5.0),
    ),
    "imu_upside_down": FaultKind("The IMU has come off, and hangs upside down."),
    "obstacle_appears": FaultKind(
        "A round obstacle of 0.2 m stands ahead of the robot.",
        _size("m", 0.4, "Distance from the front of the robot to it.", maximum=5.0),
    ),
    "program_crash": FaultKind("A program of the pipeline is killed."),
    "program_hang": FaultKind("A program of the pipeline is suspended."),
    "program_flood": FaultKind("What a program sends comes 2,000 times.", lasts=1.0),
    "operator_stop": FaultKind("The operator stops the robot, and resumes at the end."),
}


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
