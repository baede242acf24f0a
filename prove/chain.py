"""The calibration chain on robots with hidden truth: what it finds, and how they drive after it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from math import degrees, hypot, pi
from pathlib import Path
from random import Random
from statistics import median, pstdev
from tempfile import TemporaryDirectory
from typing import NamedTuple

from diffbotctl.calibrate import autonomous_drive, umbmark
from diffbotctl.calibrate.autonomous_drive import DEFAULT_STYLE, DriveStyle
from diffbotctl.calibrate.dead_reckoning import EndError, Geometry, wrap_angle
from diffbotctl.calibrate.runner import open_session
from diffbotctl.calibrate.steps.squares import corners
from diffbotctl.config.load import load_robot
from diffbotctl.plant.chassis import Chassis
from diffbotctl.testing.calibration_robots import Chained, Wiring, chained, drawn
from diffbotctl.testing.trials.row import Row, printed

CHAIN = ("encoders", "motors", "distance", "geometry")
# A count is 4.7 degrees of heading: a nearer goal could not be reached by counting.
NAIVE = DriveStyle(tolerance=0.02, heading_tolerance=0.09, method="count")
SPEEDS = (0.05, 0.10, 0.15, 0.20, 0.25)  # m/s at which the feed-forward is judged
SAG = 0.04  # of robots/book_2wd.yaml
TOUR = 2.5  # m, side of the square that is toured
BEYOND = 2.0  # times the tour's diagonal: a robot on wrong geometry is not stopped on the way
MM = 1000.0


# --- UMBmark with exact encoders ---

NOMINAL = Geometry(0.065, 0.065, 0.125)
SIDE, RUNS = 1.0, 5
SLICE = 0.01  # m of a wheel's way: slip is drawn so often
TAPE = 0.001  # m, standard deviation of a reading


def umbmark_rows(seed: int, robots: int) -> Iterator[Row]:
    """One and two rounds of squares on bodies whose wheels turn exactly as odometry believes."""
    once, twice, tracks, ratios = [], [], [], []
    for number in range(robots):
        chance = Random(f"umbmark {seed} {number}")
        true = Geometry(
            NOMINAL.right * (1 + chance.uniform(-0.005, 0.005)),
            NOMINAL.left * (1 + chance.uniform(-0.005, 0.005)),
            NOMINAL.track * (1 + chance.uniform(-0.03, 0.03)),
        )
        first = umbmark.fit_umbmark(_driven(NOMINAL, true, chance), NOMINAL)
        second = umbmark.fit_umbmark(
            _driven(first.geometry, true, chance), first.geometry, weight=0.5
        )
        # All three are scored by the same luck.
        before, *after = (
            _systematic(_driven(each, true, Random(f"score {seed} {number}")))
            for each in (NOMINAL, first.geometry, second.geometry)
        )
        once.append(before / after[0])
        twice.append(before / after[1])
        tracks.append(
            abs(first.geometry.track / first.geometry.mean / (true.track / true.mean) - 1)
        )
        ratios.append(abs(first.geometry.ratio / true.ratio - 1))
    what = f"UMBmark, {robots} robots, 1 m squares"
    gain = median(once)
    yield Row(f"{what}: E_max,syst better", f"{gain:.1f} times", ">= 10", gain >= 10.0)
    yield Row(
        f"{what}: after two rounds",
        f"{median(twice):.1f} times",
        ">= 0.95 of one",
        median(twice) >= 0.95 * gain,
    )
    yield Row(
        f"{what}: track over diameter",
        f"{100 * median(tracks):.3f} %",
        "<= 0.15 %",
        median(tracks) <= 0.0015,
    )
    yield Row(
        f"{what}: ratio of the wheels",
        f"{100 * median(ratios):.3f} %",
        "<= 0.05 %",
        median(ratios) <= 0.0005,
    )


def _driven(used: Geometry, true: Geometry, chance: Random) -> umbmark.SquareErrors:
    ways = []
    for clockwise in (True, False):
        ways.append([_square(used, true, clockwise, chance) for _ in range(RUNS)])
    return umbmark.SquareErrors(SIDE, ways[0], ways[1])


def _square(used: Geometry, true: Geometry, clockwise: bool, chance: Random) -> EndError:
    """Where one square really ends that odometry believes to be perfect."""
    body = Chassis(
        true.track, true.left / 2, true.right / 2, 0.0005, Random(chance.getrandbits(64))
    )
    left = right = 0.0
    turn = (-1 if clockwise else 1) * pi / 2 * used.track / 2
    for _ in range(4):
        for a, b in ((SIDE, SIDE), (-turn, turn)):
            slices = round(max(abs(a), abs(b)) / SLICE)
            for _ in range(slices):
                left += a / slices / (used.left / 2)
                right += b / slices / (used.right / 2)
                body.roll(left, right)
    return EndError(
        body.x + chance.gauss(0.0, TAPE), body.y + chance.gauss(0.0, TAPE), float("nan")
    )


def _systematic(driven: umbmark.SquareErrors) -> float:
    return umbmark.systematic_error(driven.clockwise, driven.counter)


# --- faults ---


class Judged(NamedTuple):
    """One robot with planted faults: what was wrong in its calibration."""

    planted: int
    unnamed: tuple[str, ...]
    scale: float
    ahead: float
    lag: float
    worst: float


def judged(seed: int, port: str, folder: Path) -> Judged:
    """The chain on one robot; what only a hand mends is mended when it was named."""
    wiring = drawn(Random(f"faults {seed}"))
    planted = wiring.faults()
    repaired = wiring.repaired()
    worst = 0.0
    if repaired != wiring:
        found = chained(wiring, seed, folder, CHAIN[:1], port)
        unnamed = _unnamed(planted, found)
        worst = found.worst
        found.session.close()
        planted_after = repaired.faults()
        found = chained(repaired, seed, folder, CHAIN, port)
        unnamed += _unnamed(planted_after, found)
    else:
        found = chained(wiring, seed, folder, CHAIN, port)
        unnamed = _unnamed(planted, found)
    scale, ahead, lag = _errors(found)
    found.session.close()
    return Judged(len(planted), unnamed, scale, ahead, lag, max(worst, found.worst))


def _unnamed(planted: set[str], found: Chained) -> tuple[str, ...]:
    """Faults that were not named, and names of faults that were not there."""
    said = found.named()
    missing = [fault for fault in planted if not any(fault in line for line in said)]
    words = ("swapped", "reversed", "dead", "floating", " slots instead of ")
    false = [
        line
        for line in said
        if any(word in line for word in words) and not any(fault in line for fault in planted)
    ]
    return (*missing, *false)


def _errors(found: Chained) -> tuple[float, float, float]:
    """Largest relative errors of distance scale, feed-forward and lag."""
    plant = found.truths._plant
    body, drive = plant.chassis, found.session.file.robot.drive
    mean = (drive.left.wheel.diameter + drive.right.wheel.diameter) / 2
    scale = abs(mean / (body.left_radius + body.right_radius) - 1)
    ahead, lag = [], []
    for motor, side in zip(plant.motors, (drive.left, drive.right), strict=True):
        lag.append(abs(side.motor.lag / motor.lag - 1))
        for speed in SPEEDS:
            wheel = speed / (side.wheel.diameter / 2)
            duty = 0.5
            for _ in range(50):  # both wheels at about the same duty share the battery's sag
                duty = (motor.keep + wheel * (1 - motor.keep) / motor.speed) / (1 - SAG * duty)
            told = side.motor.loop.static + side.motor.loop.speed * wheel
            ahead.append(abs(told / duty - 1))
    return scale, max(ahead), max(lag)


def fault_rows(seed: int, robots: int, port: str) -> Iterator[Row]:
    """The whole chain on robots with faults."""
    with TemporaryDirectory() as folder:
        every = [judged(1000 * seed + each, port, Path(folder)) for each in range(robots)]
    what = f"chain, {robots} {'simulated' if port == 'sim' else 'emulated'}"
    planted = sum(each.planted for each in every)
    unnamed = [name for each in every for name in each.unnamed]
    yield Row(
        f"{what}: faults named",
        f"{planted - len(unnamed)} of {planted}",
        "all, and no other" + "".join(f"; {name}" for name in unnamed[:3]),
        not unnamed,
    )
    for name, values, most in (
        ("distance scale", [each.scale for each in every], 0.005),
        ("feed-forward", [each.ahead for each in every], 0.05),
        ("lag", [each.lag for each in every], 0.10),
    ):
        yield Row(
            f"{what}: {name}, worst",
            f"{100 * max(values):.2f} %",
            f"<= {100 * most:g} %",
            max(values) <= most,
        )
    worst = max(each.worst for each in every)
    yield Row(f"{what}: of the announced bound", f"{100 * worst:.0f} %", "<= 100 %", worst <= 1.0)


def stock_rows(seed: int, robots: int) -> Iterator[Row]:
    """What `motors` finds of a board with the book's firmware, which tells of no command when it
    took hold. Nothing was asked of it: the figures are printed to be known."""
    lags, dead = [], []
    with TemporaryDirectory() as folder:
        for each in range(robots):
            found = chained(
                Wiring(), 1000 * seed + each, Path(folder), ("motors",), robot="book_2wd_stock"
            )
            plant = found.truths._plant
            motor, link = found.session.file.robot.drive.left.motor, found.session.file.robot.link
            lags.append(motor.lag / (sum(each.lag for each in plant.motors) / 2) - 1)
            dead.append(link.command_delay - plant.board.model.command_delay * 1e-9)
            found.session.close()
    what = f"motors, {robots} robots with stock firmware"
    yield Row(f"{what}: lag, sd", f"{100 * pstdev(lags):.1f} %", "(none)", True)
    yield Row(
        f"{what}: time to take a command, sd", f"{1000 * pstdev(dead):.1f} ms", "(none)", True
    )


# --- driving afterwards ---


class Short(NamedTuple):
    """A metre ahead and a quarter turn: how far it truly ended to the left (m), and how far it
    truly turned too much (rad) in either."""

    lateral: float
    metre: float
    turn: float


class Driven(NamedTuple):
    """One calibrated robot's drives: true errors in m and rad."""

    plain: Short
    learnt: Short
    """with its discs learnt, after the next power-on"""
    before: float
    after: float


def driven(seed: int, folder: Path) -> Driven:
    """Metre, quarter turn and tour after the chain, and metre and turn again with learnt discs."""
    before = _toured_before(seed, folder)
    found = chained(Wiring(), seed, folder, CHAIN)
    plain = _short(found)
    after = _tour(found.session, found.truths, DEFAULT_STYLE)
    found.run("discs")
    found.switch_off_and_on(Random(f"power {seed}"))
    learnt = _short(found)
    found.session.close()
    return Driven(plain, learnt, before, after)


def _short(found: Chained) -> Short:
    lateral, heading = _true(found, [(1.0, 0.0, None)])
    _, turned = _true(found, [(0.0, 0.0, pi / 2)])
    return Short(lateral, heading, wrap_angle(turned - pi / 2))


def _true(found: Chained, places: list[autonomous_drive.Waypoint]) -> tuple[float, float]:
    """How far to the left it truly ended, and how far it truly turned."""
    begun = found.truths.truth.pose
    autonomous_drive.drive_to(found.session, places, 3.0, DEFAULT_STYLE)
    found.truths._mark = found.truths._mark._replace(pose=begun)
    return found.truths._value("left"), found.truths._value("facing")


def _toured_before(seed: int, folder: Path) -> float:
    """The tour of a robot nobody calibrated, which takes each count for a slot's pitch."""
    robot = folder / "before.yaml"
    robot.write_text(Wiring().text() + "drive: {polarity: checked_by_hand}\n")
    made, truths = open_session(load_robot(str(robot)), "sim", seed)
    made.connect()
    try:
        return _tour(made, truths, NAIVE)
    finally:
        made.close()


def _tour(made: object, truths: object, manner: DriveStyle) -> float:
    """How far from its start a square tour of ten metres truly ends."""
    begun = truths.truth.pose  # type: ignore[attr-defined]
    autonomous_drive.drive_to(made, corners(TOUR, clockwise=False), BEYOND * TOUR * 2, manner)  # type: ignore
    end = truths.truth.pose  # type: ignore[attr-defined]
    return hypot(end.x - begun.x, end.y - begun.y)


def driving_rows(seed: int, robots: int) -> Iterator[Row]:
    """What the chain is for."""
    with TemporaryDirectory() as folder:
        every = [driven(1000 * seed + each, Path(folder)) for each in range(robots)]
    what = f"after the chain, {robots} robots"
    yield from _short_rows(what, [each.plain for each in every], 6.0)
    yield from _short_rows(f"{what}, discs learnt", [each.learnt for each in every], 5.0)
    before = median(each.before for each in every) * MM
    after = median(each.after for each in every) * MM
    yield Row(
        f"{what}: 10 m tour",
        f"{before:.0f} -> {after:.0f} mm",
        f"{before / after:.1f} times better, >= 7, and <= 60 mm",
        before >= 7 * after and after <= 60.0,
    )


def _short_rows(what: str, drives: list[Short], most: float) -> Iterator[Row]:
    lateral = pstdev(each.lateral for each in drives) * MM
    yield Row(f"{what}: metre, lateral sd", f"{lateral:.1f} mm", f"<= {most:g} mm", lateral <= most)
    for name, values in (("metre", [e.metre for e in drives]), ("turn", [e.turn for e in drives])):
        sd = degrees(pstdev(values))
        yield Row(f"{what}: {name}, heading sd", f"{sd:.2f} deg", "<= 0.8 deg", sd <= 0.8)


def rows(seed: int, robots: int, faulty: int, emulated: int) -> Iterator[Row]:
    """Every row of this table."""
    yield from umbmark_rows(seed, 50)
    yield from fault_rows(seed, faulty, "sim")
    yield from fault_rows(seed, emulated, "emulated")
    yield from stock_rows(seed, faulty)
    yield from driving_rows(seed, robots)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", type=int, default=300)
    parser.add_argument("--faulty", type=int, default=30)
    parser.add_argument("--emulated", type=int, default=5)
    options = parser.parse_args()
    raise SystemExit(
        printed(rows(options.seed, options.robots, options.faulty, options.emulated)) > 0
    )


if __name__ == "__main__":
    main()
