"""Goals of the book's robot with its real firmware: how smoothly it drives to them.

The motors are those of torque; the driver shorts them ideally, or an L298N takes its 1.4 V.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from math import degrees, radians
from pathlib import Path
from random import Random
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.messages import Goal
from diffbotctl.trials.random_robots import yaml_text
from prove.motion import OPEN_FLOOR, Trip, goals_within, share, trip
from tests.support.matrix_case import EQUATIONS
from tests.support.trials.row import Row
from tests.support.trials.section import drawn
from tests.support.trials.wheel_loop import PULSED_DRIVERS

MM = 1000
# Places (m, m, deg), from 2.2 m to 5 cm, and turns of 170 and 5 deg: each is driven to twice.
PLACES: tuple[tuple[float, float, float | None], ...] = (
    (2.2, 0.0, None),
    (1.2, -0.9, -90),
    (1.0, 0.5, 90),
    (-0.5, 0.3, 0),
    (0.3, 0.0, 0),
    (0.0, 0.2, 90),
    (0.1, 0.0, None),
    (0.05, 0.0, 0),
    (0.0, 0.0, 170),
    (0.0, 0.0, 5),
)
DRAWN_RATIO = 3  # of all goals; the others are those places
LEAST_BOUND = 0.4  # s; of a shorter motion the time over the shortest one has no meaning
# Most of what is short: place, and seconds that 90 % of the trips may take.
SHORT_GOALS = {
    "5 cm ahead": ((0.05, 0.0, None), 2.0),
    "5 cm behind": ((-0.05, 0.0, None), 3.0),
    "turn of 5 deg": ((0.0, 0.0, 5), 1.5),
    "turn of 170 deg": ((0.0, 0.0, 170), 3.0),
}


class Smoothness(NamedTuple):
    """Time over the shortest, extra turning (deg) and stops: medians; 95 % of the times."""

    ratio: float
    turning: float
    stops: float
    most_ratio: float

    def text(self) -> str:
        """The figures of a row."""
        times = f"{self.ratio:.2f} ({self.most_ratio:.2f})"
        return f"{times}, {self.turning:.0f} deg, {self.stops:g} stops"


# Targets of pulses on the inputs, and those that issue 42 had.
SMOOTH = {
    "ideal short": Smoothness(1.15, 8, 1, 1.6),
    "drop of 1.4 V": Smoothness(1.4, 15, 2, 2.5),
}
OBEYING = {"ideal short": (1.3, 15), "drop of 1.4 V": (2.0, 35)}
ERROR_BEFORE = (4.9, 30)  # mm; median and 95 % of the firmware that pulsed enable alone


def goal(place: tuple[float, float, float | None]) -> Goal:
    """The goal at a place (m, m, deg)."""
    x, y, heading = place
    return Goal(0, 0, x, y, None if heading is None else radians(heading))


def robot(
    folder: Path, driver: str, pulses: str = "inputs", equations: str = "torque", **changes: object
) -> Configuration:
    """The pipeline `goal` with the book's robot; `changes` of its simulation."""
    file = folder / f"robot_{len(list(folder.iterdir()))}.yaml"
    tree = {
        "format": 1,
        "kind": "robot",
        "include": "book_2wd",
        "drive": {
            "polarity": "checked_by_hand",
            "motor": {"driver": driver, "pulses": pulses},
        },
        "simulation": {"equations": equations, **changes},
    }
    file.write_text(yaml_text(tree))
    return load("goal", str(file), OPEN_FLOOR)


def smooth_rows(seed: int, goals: int) -> Iterator[Row]:
    """The list of places and drawn goals, with both kinds of pulses and both kinds of shorts."""
    with TemporaryDirectory() as folder:
        for what, driver in PULSED_DRIVERS.items():
            for pulses in ("inputs", "enable"):
                setup = robot(Path(folder), driver, pulses)
                yield from _smooth_rows(what, pulses, trips_to(setup, seed, goals))


def trips_to(setup: Configuration, seed: int, goals: int) -> list[Trip]:
    """A third of the goals from the list, the others drawn; each with another robot."""
    rng = Random(f"smooth {seed}")
    places = [goal(PLACES[number % len(PLACES)]) for number in range(goals // DRAWN_RATIO)]
    todo = places + [goals_within(0.05, 2.0, rng) for _ in range(goals - len(places))]
    return [trip(setup, each, rng.getrandbits(31), port="emulated") for each in todo]


def _smooth_rows(what: str, pulses: str, trips: list[Trip]) -> Iterator[Row]:
    name = f"{what}, pulses on {pulses}, {len(trips)} goals"
    reached = sum(one.reached for one in trips)
    unsure = sum(one.is_unsure for one in trips)
    errors = [one.true_error * MM for one in trips]
    half, most = median(errors), share(errors, 0.95)
    yield Row(
        f"{name}: true error, median, 95 %, worst",
        f"{half:.1f}, {most:.0f}, {max(errors):.0f} mm; {reached} reached, {unsure} of them unsure",
        "<= {}, {} mm".format(*ERROR_BEFORE) if pulses == "inputs" else "(none)",
        pulses == "enable" or (half <= ERROR_BEFORE[0] and most <= ERROR_BEFORE[1]),
    )
    ratios = [one.ratio for one in trips if one.bound >= LEAST_BOUND]
    turning = median(degrees(one.extra_turning) for one in trips)
    stops = median(one.stops for one in trips)
    found = Smoothness(median(ratios), turning, stops, share(ratios, 0.95))
    figure = f"{found.text()}, 95 % {share([one.stops for one in trips], 0.95)}"
    text = f"{name}: time over the shortest (95 %), extra turning, stops on the way"
    if pulses == "enable":
        yield Row(text, figure, "(none)", True)
        return
    ratio, degrees_extra = OBEYING[what]
    yield Row(
        f"{name}: time, extra turning of a motor that obeys",
        figure,
        f"<= {ratio}, {degrees_extra} deg",
        found.ratio <= ratio and turning <= degrees_extra,
    )
    target = SMOOTH[what]
    met = all(figure <= limit for figure, limit in zip(found, target, strict=True))
    yield Row(text, figure, f"<= {target.text()}", met)


def short_rows(seed: int, trials: int) -> Iterator[Row]:
    """Short ways and pure turns, pulses on the inputs: time until the goal is reached."""
    with TemporaryDirectory() as folder:
        for what, driver in PULSED_DRIVERS.items():
            setup = robot(Path(folder), driver)
            for name, (place, limit) in SHORT_GOALS.items():
                rng = Random(f"short {seed} {name}")
                trips = [
                    trip(setup, goal(place), rng.getrandbits(31), port="emulated")
                    for _ in range(trials)
                ]
                times = sorted(one.seconds if one.reached else 99.0 for one in trips)
                most = times[(9 * len(times) - 1) // 10]
                yield Row(
                    f"{what}: {name}, {trials} robots: 90 % reached within",
                    f"{most:.1f} s (median {median(times):.1f}, worst {times[-1]:.1f})",
                    f"<= {limit:g} s",
                    most <= limit,
                )


WEAKNESSES = ("weak", "unequal", "stiff")
REACHED_MIN, FARTHER_MAX = 0.95, 0.050  # share, m


def weak_rows(seed: int, runs: int) -> Iterator[Row]:
    """Motors that are weaker or stiffer than their robot file states, on both plants."""
    rng = Random(f"weak {seed}")
    found: dict[str, list[Trip]] = {name: [] for name in WEAKNESSES}
    slower: list[tuple[str, Trip]] = []
    with TemporaryDirectory() as folder:
        for number in range(runs):
            name = WEAKNESSES[number % len(WEAKNESSES)]
            equations = drawn(EQUATIONS.values(), len(EQUATIONS), seed)[number // 3 % 2]
            side = rng.choice(("left", "right"))
            setup = weak_robot(Path(folder), equations, name, side, rng.uniform(0.5, 0.75))
            one = trip(setup, goals_within(0.3, 2.0, rng), rng.getrandbits(31), port="emulated")
            found[name].append(one)
            if name == "unequal":
                slower.append((side, one))
    trips = [one for ones in found.values() for one in ones]
    sure = {
        name: sum(one.reached and not one.is_unsure for one in ones) for name, ones in found.items()
    }
    unsure = sum(one.is_unsure for one in trips)
    part = sum(sure.values()) / len(trips)
    yield Row(
        f"weak, unequal, stiff motors, {runs} runs: reached",
        f"{part:.0%} ({', '.join(f'{sure[name]} of {len(found[name])}' for name in WEAKNESSES)}), "
        f"{unsure} unsure; error {median(one.true_error for one in trips) * MM:.0f} mm, worst "
        f"{max(one.true_error for one in trips) * MM:.0f}",
        f">= {REACHED_MIN:.0%}",
        part >= REACHED_MIN,
    )
    farther = max(one.farther for one in trips)
    yield Row(
        "the same: most ever farther than at the start",
        f"{farther * MM:.0f} mm",
        f"<= {FARTHER_MAX * MM:.0f} mm",
        farther <= FARTHER_MAX,
    )
    named = sum(f"the {side} wheel" in one.output for side, one in slower)
    yield Row.counted("the same: the weak wheel of unequal motors named", named, len(slower))


def weak_robot(folder: Path, equations: str, name: str, side: str, factor: float) -> Configuration:
    """The book's robot, whose simulated motors differ from the robot file."""
    stiff: dict[str, Any] = {"motor": {"start_duty": [0.16, 0.32]}} if name == "stiff" else {}
    setup = robot(folder, "l298n", equations=equations, **stiff)
    setup = replace(setup, nominal=deepcopy(setup.nominal))
    assert setup.nominal is not None
    drive = setup.nominal.drive
    for each in (drive.left, drive.right):
        if name == "weak":
            each.motor.rated *= factor
    if name == "unequal":
        getattr(drive, side).motor.rated *= 0.6
    return setup
