"""The calibration chain on simulated robots: errors of its results, and of the drives after it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from math import degrees, hypot, pi
from multiprocessing import Pool
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
from tests.support.calibration_robots import Chained, Wiring, chained, drawn
from tests.support.trials.row import Row

CHAIN = ("encoders", "motors", "distance", "geometry")
# A count is 4.7 degrees of heading: counting cannot meet a smaller tolerance.
NAIVE = DriveStyle(tolerance=0.02, heading_tolerance=0.09, method="count")
SPEEDS = (0.05, 0.10, 0.15, 0.20, 0.25)  # m/s at which the feed-forward is judged
SAG = 0.04  # of robots/book_2wd.yaml
TOUR = 2.5  # m, side of the square of the tour
BEYOND = 2.0  # factor of the limit of the distance: a robot with wrong geometry is not stopped
MM = 1000.0


# --- UMBmark with exact encoders ---

NOMINAL = Geometry(0.065, 0.065, 0.125)
SIDE, RUNS = 1.0, 5
SLICE = 0.01  # m of a wheel's path for which one value of slip is drawn
TAPE = 0.001  # m, standard deviation of a reading


def umbmark_rows(seed: int, robots: int) -> Iterator[Row]:
    """One and two rounds of squares on robots whose wheels turn exactly as odometry assumes."""
    once, twice, tracks, ratios = [], [], [], []
    for number in range(robots):
        rng = Random(f"umbmark {seed} {number}")
        true = Geometry(
            NOMINAL.right * (1 + rng.uniform(-0.005, 0.005)),
            NOMINAL.left * (1 + rng.uniform(-0.005, 0.005)),
            NOMINAL.track * (1 + rng.uniform(-0.03, 0.03)),
        )
        rounds = [(NOMINAL, _driven(NOMINAL, true, rng))]
        first = umbmark.fit_squares(rounds)
        rounds.append((first.geometry, _driven(first.geometry, true, rng)))
        second = umbmark.fit_squares(rounds)
        # All three are scored with the same random numbers.
        before, *after = (
            _systematic(_driven(geometry, true, Random(f"score {seed} {number}")))
            for geometry in (NOMINAL, first.geometry, second.geometry)
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


def _driven(used: Geometry, true: Geometry, rng: Random) -> umbmark.SquareErrors:
    clockwise, counter = (
        [_square(used, true, is_clockwise, rng) for _ in range(RUNS)]
        for is_clockwise in (True, False)
    )
    return umbmark.SquareErrors(SIDE, clockwise, counter)


def _square(used: Geometry, true: Geometry, clockwise: bool, rng: Random) -> EndError:
    """The actual end of a square that is perfect according to odometry."""
    body = Chassis(true.track, true.left / 2, true.right / 2, 0.0005, Random(rng.getrandbits(64)))
    left = right = 0.0
    turn = (-1 if clockwise else 1) * pi / 2 * used.track / 2
    for _ in range(4):
        for a, b in ((SIDE, SIDE), (-turn, turn)):
            slices = round(max(abs(a), abs(b)) / SLICE)
            for _ in range(slices):
                left += a / slices / (used.left / 2)
                right += b / slices / (used.right / 2)
                body.roll(left, right)
    return EndError(body.x + rng.gauss(0.0, TAPE), body.y + rng.gauss(0.0, TAPE), float("nan"))


def _systematic(driven: umbmark.SquareErrors) -> float:
    return umbmark.systematic_error(driven.clockwise, driven.counter)


# --- faults ---


class Judged(NamedTuple):
    """One robot with planted faults: the errors of its calibration."""

    planted: int
    unnamed: tuple[str, ...]
    scale: float
    ahead: float
    lag: float
    worst: float


def judged(seed: int, port: str, folder: Path, steps: Sequence[str]) -> Judged:
    """Run the chain on one robot; repair the faults that only a person can repair when reported."""
    wiring = drawn(Random(f"faults {seed}"))
    planted = wiring.faults()
    repaired = wiring.repaired()
    worst = 0.0
    if repaired != wiring:
        calibrated = chained(wiring, seed, folder, steps[:1], port)
        unnamed = _unnamed(planted, calibrated)
        worst = calibrated.worst
        calibrated.session.close()
        planted_after = repaired.faults()
        calibrated = chained(repaired, seed, folder, steps, port)
        unnamed += _unnamed(planted_after, calibrated)
    else:
        calibrated = chained(wiring, seed, folder, steps, port)
        unnamed = _unnamed(planted, calibrated)
    scale, ahead, lag = _errors(calibrated)
    calibrated.session.close()
    return Judged(len(planted), unnamed, scale, ahead, lag, max(worst, calibrated.worst))


def _unnamed(planted: set[str], calibrated: Chained) -> tuple[str, ...]:
    """Faults that were not reported, and reports of faults that do not exist."""
    reported = calibrated.named()
    missing = [fault for fault in planted if not any(fault in line for line in reported)]
    words = ("swapped", "reversed", "dead", "floating", " slots instead of ")
    false = [
        line
        for line in reported
        if any(word in line for word in words) and not any(fault in line for fault in planted)
    ]
    return (*missing, *false)


def _errors(calibrated: Chained) -> tuple[float, float, float]:
    """Largest relative errors of distance scale, feed-forward and lag."""
    plant = calibrated.truths._plant
    body, drive = plant.chassis, calibrated.session.file.robot.drive
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
            assert side.motor.loop.speed is not None
            commanded = side.motor.loop.static + side.motor.loop.speed * wheel
            ahead.append(abs(commanded / duty - 1))
    return scale, max(ahead), max(lag)


def fault_rows(seed: int, robots: int, steps: int, port: str) -> Iterator[Row]:
    """The first `steps` steps of the chain on robots with faults."""
    with TemporaryDirectory() as folder:
        trials = [
            judged(1000 * seed + number, port, Path(folder), CHAIN[:steps])
            for number in range(robots)
        ]
    what = f"chain, {robots} {'simulated' if port == 'sim' else 'emulated'}"
    planted = sum(trial.planted for trial in trials)
    unnamed = [name for trial in trials for name in trial.unnamed]
    yield Row(
        f"{what}: faults named",
        f"{planted - len(unnamed)} of {planted}",
        "all, and no other" + "".join(f"; {name}" for name in unnamed[:3]),
        not unnamed,
    )
    for name, values, limit in (
        ("distance scale", [trial.scale for trial in trials], 0.005),
        ("feed-forward", [trial.ahead for trial in trials], 0.05),
        ("lag", [trial.lag for trial in trials], 0.10),
    ):
        yield Row(
            f"{what}: {name}, worst",
            f"{100 * max(values):.2f} %",
            f"<= {100 * limit:g} %",
            max(values) <= limit,
        )
    worst = max(trial.worst for trial in trials)
    yield Row(f"{what}: of the announced bound", f"{100 * worst:.0f} %", "<= 100 %", worst <= 1.0)


def stock_rows(seed: int, robots: int) -> Iterator[Row]:
    """Errors of `motors` on a board with the book's firmware; the figures have no target.

    This firmware does not report when a command took effect.
    """
    lags, dead = [], []
    with TemporaryDirectory() as folder:
        for number in range(robots):
            calibrated = chained(
                Wiring(), 1000 * seed + number, Path(folder), ("motors",), robot="book_2wd_stock"
            )
            plant = calibrated.truths._plant
            robot = calibrated.session.file.robot
            motor, link = robot.drive.left.motor, robot.link
            lags.append(motor.lag / (sum(plant_motor.lag for plant_motor in plant.motors) / 2) - 1)
            dead.append(link.command_delay - plant.board.model.command_delay * 1e-9)
            calibrated.session.close()
    what = f"motors, {robots} robots with stock firmware"
    yield Row(f"{what}: lag, sd", f"{100 * pstdev(lags):.1f} %", "(none)", True)
    yield Row(f"{what}: delay of a command, sd", f"{1000 * pstdev(dead):.1f} ms", "(none)", True)


# --- driving afterwards ---


class Short(NamedTuple):
    """Actual errors of a metre ahead and of a quarter turn.

    `lateral` is the offset to the left after the metre (m), `metre` and `turn` are the errors of
    the heading (rad), positive counter-clockwise.
    """

    lateral: float
    metre: float
    turn: float


class Driven(NamedTuple):
    """The drives of one calibrated robot: actual errors in m and rad."""

    plain: Short
    before: float
    after: float


def driven(seed: int, steps: Sequence[str]) -> Driven:
    """Metre, quarter turn and tour after the chain."""
    with TemporaryDirectory() as name:
        before = _toured_before(seed, Path(name))
        calibrated = chained(Wiring(), seed, Path(name), steps)
        plain = _short(calibrated)
        after = _tour(calibrated.session, calibrated.truths, DEFAULT_STYLE)
        calibrated.session.close()
    return Driven(plain, before, after)


def _short(calibrated: Chained) -> Short:
    lateral, heading = _true(calibrated, [(1.0, 0.0, None)])
    _, turned = _true(calibrated, [(0.0, 0.0, pi / 2)])
    return Short(lateral, heading, wrap_angle(turned - pi / 2))


def _true(calibrated: Chained, places: list[autonomous_drive.Waypoint]) -> tuple[float, float]:
    """The actual offset to the left (m) and the actual turn (rad) of a drive."""
    start = calibrated.truths.truth.pose
    autonomous_drive.drive_to(calibrated.session, places, 3.0, DEFAULT_STYLE)
    calibrated.truths._mark = calibrated.truths._mark._replace(pose=start)
    return calibrated.truths._value("left"), calibrated.truths._value("facing")


def _toured_before(seed: int, folder: Path) -> float:
    """The tour of an uncalibrated robot, whose odometry counts slots."""
    robot = folder / "before.yaml"
    robot.write_text(Wiring().text() + "drive: {polarity: checked_by_hand}\n")
    session, truths = open_session(load_robot(str(robot)), "sim", seed)
    session.connect()
    try:
        return _tour(session, truths, NAIVE)
    finally:
        session.close()


def _tour(session: object, truths: object, style: DriveStyle) -> float:
    """Actual distance (m) from start to end of a square tour of ten metres."""
    start = truths.truth.pose  # type: ignore[attr-defined]
    autonomous_drive.drive_to(session, corners(TOUR, clockwise=False), BEYOND * TOUR * 2, style)  # type: ignore
    end = truths.truth.pose  # type: ignore[attr-defined]
    return hypot(end.x - start.x, end.y - start.y)


def driving_rows(seed: int, robots: int, steps: int = len(CHAIN)) -> Iterator[Row]:
    """Errors of drives after the chain."""
    with Pool() as pool:
        one = partial(driven, steps=CHAIN[:steps])
        trials = [*pool.imap(one, range(1000 * seed, 1000 * seed + robots))]
    what = f"after the chain, {robots} robots"
    yield from _short_rows(what, [trial.plain for trial in trials], 6.0)
    before = median(trial.before for trial in trials) * MM
    after = median(trial.after for trial in trials) * MM
    yield Row(
        f"{what}: 10 m tour",
        f"{before:.0f} -> {after:.0f} mm",
        f"{before / after:.1f} times better, >= 7, and <= 60 mm",
        before >= 7 * after and after <= 60.0,
    )


def _short_rows(what: str, drives: list[Short], limit: float) -> Iterator[Row]:
    lateral = pstdev(drive.lateral for drive in drives) * MM
    yield Row.at_most(f"{what}: metre, lateral sd", lateral, limit, "mm")
    metres, turns = [drive.metre for drive in drives], [drive.turn for drive in drives]
    for name, values in (("metre", metres), ("turn", turns)):
        sd = degrees(pstdev(values))
        yield Row.at_most(f"{what}: {name}, heading sd", sd, 0.8, "deg", ".2f")


def rows(seed: int, robots: int, steps: int = len(CHAIN)) -> Iterator[Row]:
    """The chain on simulated robots with faults, and with the book's firmware."""
    yield from fault_rows(seed, robots, steps, "sim")
    yield from stock_rows(seed, robots)


def emulated_rows(seed: int, robots: int, steps: int = len(CHAIN)) -> Iterator[Row]:
    """The chain on emulated boards with faults."""
    yield from fault_rows(seed, robots, steps, "emulated")
