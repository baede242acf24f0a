"""The shipped robots on both plants, with faults one at a time, and straight drives by hand."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from pathlib import Path
from random import Random
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from diffbotctl.config.load import load
from diffbotctl.trials.random_robots import yaml_text
from prove.motion import OPEN_FLOOR, TOLERANCES, Trip, goals_within, share, trip
from tests.support.matrix_case import EQUATIONS
from tests.support.trials.row import Row
from tests.support.trials.section import drawn
from tests.support.trials.straight import straight_drive

LAG = 0.3  # s
MM = 1000


def robot_file(folder: Path, base: str, plant: int, changes: dict[str, object]) -> str:
    """A robot file like `base`, on a plant, with changes of its simulation."""
    file = folder / f"{base}_{plant}_{len(list(folder.iterdir()))}.yaml"
    tree = {"format": 1, "kind": "robot", "include": base, "drive": {"polarity": "checked_by_hand"}}
    file.write_text(yaml_text(tree | {"simulation": {"equations": EQUATIONS[plant], **changes}}))
    return str(file)


def trips(
    folder: Path, base: str, plant: int, seed: int, number: int, **changes: Any
) -> list[Trip]:
    """`number` goals within 2 m, each of another robot."""
    file = robot_file(folder, base, plant, changes)
    kind = "stock" if base.endswith("stock") else "edges"
    setup = load("goal", file, [*OPEN_FLOOR, *TOLERANCES.get(kind, ())])
    rng = Random(f"{seed} {base} {plant} {sorted(changes)}")
    return [trip(setup, goals_within(0.05, 2.0, rng), rng.getrandbits(32)) for _ in range(number)]


def rows(seed: int, goals: int, plants: int = len(EQUATIONS)) -> Iterator[Row]:
    """All rows of the plants; `goals` goals for each."""
    chosen = drawn(EQUATIONS.items(), plants, seed)
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for plant, equations in chosen:
            yield from _goal_rows(folder, plant, f"plant {plant} ({equations})", seed, goals)
        for plant, equations in chosen:
            yield from _drive_rows(folder, plant, f"plant {plant} ({equations})", seed, goals)


def _goal_rows(folder: Path, plant: int, name: str, seed: int, number: int) -> Iterator[Row]:
    yield _healthy_row(name, trips(folder, "book_2wd", plant, seed, number))
    missing = trips(folder, "book_2wd", plant, seed, number, encoder={"missed": 0.01})
    errors = [one.true_error * MM for one in missing]
    reporting = sum(one.output.find("missing") >= 0 or "unsure" in one.output for one in missing)
    half, most = median(errors), share(errors, 0.95)
    yield Row(
        f"{name}: 1 % missed edges, true median, p95; reported",
        f"{half:.0f}, {most:.0f} mm; {reporting} of {number}",
        "<= 15, 60 mm; all that are off",
        half <= 15 and most <= 60 and reporting > 0,
    )
    step = {"faults": [{"fault": "battery_step", "at": 1.5, "size": 0.85}]}
    for what, changes in (
        ("battery -15 % under way", step),
        ("sag 0.30", {"battery": {"sag": 0.3}}),
    ):
        found = trips(folder, "book_2wd", plant, seed, number, **changes)
        heading = median(degrees(one.true_heading_error) for one in found)
        reached = sum(one.reached for one in found)
        yield Row(
            f"{name}: {what}: true heading, median",
            f"{heading:.2f} deg, {reached} of {number}{_unsure(found)}",
            "<= 0.8 deg",
            heading <= 0.8 and reached >= 0.97 * number,
        )
    slow = trips(folder, "book_2wd", plant, seed, number, motor={"lag": [LAG, LAG]})
    ratio = median(one.seconds / (one.bound + 6 * LAG) for one in slow)
    yield Row(
        f"{name}: motor lag 300 ms: time over bound + 6 lags",
        f"{ratio:.2f}, {sum(one.reached for one in slow)} of {number}{_unsure(slow)}",
        "<= 1.30",
        ratio <= 1.3 and sum(one.reached for one in slow) >= 0.97 * number,
    )
    stock = trips(folder, "book_2wd_stock", plant, seed, number)
    errors = [one.true_error * MM for one in stock]
    figures = (median(errors), share(errors, 0.95), max(errors))
    yield Row(
        f"{name}: book_2wd_stock, true median, p95, worst",
        ", ".join(f"{figure:.0f}" for figure in figures) + f" mm, {sum(t.reached for t in stock)}",
        "<= 20, 60, 120 mm",
        all(figure <= target for figure, target in zip(figures, (20, 60, 120), strict=True)),
    )


def _healthy_row(name: str, found: list[Trip]) -> Row:
    errors = [one.true_error * MM for one in found]
    heading = median(degrees(one.true_heading_error) for one in found)
    ratio = median(one.ratio for one in found)
    half, most = median(errors), share(errors, 0.95)
    met = half <= 7 and most <= 22 and heading <= 0.33 and ratio <= 1.24
    return Row(
        f"{name}: book_2wd, true median, p95, heading, time",
        f"{half:.1f}, {most:.0f} mm; {heading:.2f} deg; {ratio:.2f}",
        "<= 7, 22 mm; 0.33 deg; 1.24",
        met,
    )


def _drive_rows(folder: Path, plant: int, name: str, seed: int, number: int) -> Iterator[Row]:
    rng = Random(f"{seed} drive {plant}")
    for spread in (0.0, 0.01):
        file = robot_file(folder, "book_2wd", plant, {"geometry": {"diameter_spread": spread}})
        drives = [straight_drive(file, rng.getrandbits(31)) for _ in range(number)]
        reported = [abs(drive.estimated) for drive in drives]
        if not spread:
            yield Row(
                f"{name}: drive 6 s: heading by odometry, median, worst",
                f"{median(reported):.2f}, {max(reported):.1f} deg",
                "<= 1, 4 deg",
                median(reported) <= 1.0 and max(reported) <= 4.0,
            )
        beyond = [abs(drive.actual) - abs(drive.diameters) for drive in drives]
        limit = 1.0 if spread else 1.5
        bound = max(abs(drive.diameters) for drive in drives)
        yield Row(
            f"{name}: drive 6 s: true heading beyond bound {bound:.1f} deg",
            f"{median(beyond):.2f}, {max(beyond):.1f} deg",
            f"<= {limit} deg (diameters +-{100 * spread:g} %)",
            max(beyond) <= limit,
        )


def _unsure(found: list[Trip]) -> str:
    """How many of the goals were reached with an uncertain pose."""
    number = sum(one.is_unsure for one in found)
    return f" ({number} unsure)" if number else ""
