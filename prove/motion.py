"""How well simulated robots reach their goals: the shipped pipeline, engine and all, by seed."""

from __future__ import annotations

from collections.abc import Iterator
from math import copysign, cos, degrees, hypot, pi, radians, sin
from pathlib import Path
from random import Random
from statistics import median, pstdev
from typing import NamedTuple

from diffbotctl.config.configuration import Configuration
from diffbotctl.config.load import load
from diffbotctl.control.motion_profile import MotionLimits, legs, rest_to_rest_time, shortest_turn
from diffbotctl.graph import Sink
from diffbotctl.messages import GOAL_EXIT_CODES, Goal, GoalState
from diffbotctl.runs.build_graph import wires_of
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.support.trials.row import Row

ROBOTS = {"edges": "book_2wd", "counts": "book_2wd_counts", "stock": "book_2wd_stock"}
IDEAL = str(Path(__file__).with_name("ideal_robot.yaml"))
# The goals whose time-optimal motions are published with the bound (m, m, deg).
KNOWN_GOALS = ((1.0, 0.0, 0), (1.0, 1.0, 90), (0.5, 0.5, 180), (-0.3, 0.4, -90), (0.0, 0.1, 0))
OPEN_FLOOR = ["world.walls=[]"]
# A stock board's counts cannot tell 10 mm: its row asks for 20 mm and 3 deg.
TOLERANCES = {"stock": ("follower.tolerance=20 mm", "follower.heading_tolerance=3 deg")}
LONGEST = 120.0  # s of simulated time for one goal
RESTING, MOVING = 0.1, 0.3  # rad/s; both wheels below, or one above
WIGGLE = radians(1)  # to either side, which is no turning


class Trip(NamedTuple):
    """One goal of one robot: pose errors in odom and in truth (m, rad), and times (s)."""

    reached: bool
    """also with an uncertain pose"""
    is_unsure: bool
    error: float
    heading_error: float
    true_error: float
    true_heading_error: float
    farther: float
    ratio: float
    x: float
    y: float
    seconds: float
    bound: float
    output: str
    """the end of the goal, its cause, and the log's lines"""
    extra_turning: float
    """rad, beyond the turns of the shortest motion forwards"""
    stops: int
    """on the way"""


def configuration(kind: str, *sets: str) -> Configuration:
    """The shipped goal pipeline for one kind of board, on an open floor."""
    return load("goal", ROBOTS[kind], [*OPEN_FLOOR, *TOLERANCES.get(kind, ()), *sets])


class TimedRun(Run):
    """A run that notes when its goal was reached first."""

    begun_at = reached_at = 0
    output = ""

    def _sinks(self) -> dict[str, list[Sink]]:
        sinks = super()._sinks()
        sinks["log"].append(lambda now, line: self._on_text(line.text))
        for wire in wires_of(self.assembly, GoalState):
            sinks[wire].append(self._on_goal_state)
        return sinks

    def _on_text(self, text: str) -> None:
        self.output += f"{text}\n"

    def _on_goal_state(self, now: int, state: GoalState) -> None:
        self.begun_at = self.begun_at or now
        if state.state in GOAL_EXIT_CODES:
            self._on_text(f"{state.state} {state.cause}")
        if state.state in ("reached", "reached_unsure") and not self.reached_at:
            self.reached_at = now

    def seconds_of_goal(self) -> float:
        """How long the goal was under way: from the first command to its end at the goal."""
        return ((self.reached_at or self.engine.last_instant) - self.begun_at) / 1e9


def trip(
    setup: Configuration, goal: Goal, seed: int, reverse: bool = False, port: str = "sim"
) -> Trip:
    """Run one goal on the robot that `seed` draws; `reverse`: the bound may drive backwards."""
    run = TimedRun(setup, RunOptions(port, (goal,), seed, fast=True, duration=LONGEST))
    start = hypot(goal.x, goal.y)
    farthest, is_moving, rests = [0.0], False, 0
    turned = facing = 0.0
    plant = run.plant
    assert plant is not None
    wire = run.engine.compiled  # the truth is looked at after each turn of the loop
    assert wire is not None

    def look() -> None:
        nonlocal is_moving, rests, turned, facing
        body = plant.chassis
        farthest[0] = max(farthest[0], hypot(goal.x - body.x, goal.y - body.y) - start)
        aside = body.heading - facing
        turn = max(abs(aside) - WIGGLE, 0.0)
        turned, facing = turned + turn, facing + copysign(turn, aside)
        speed = max(abs(wheel.speed) for wheel in plant.wheels)
        if speed < RESTING and is_moving and not run.reached_at:
            rests += 1
        is_moving = speed > (RESTING if is_moving else MOVING)

    run.engine.idle = look
    result = run.go()
    assert result.odometry is not None and result.truth is not None
    pose, at = result.odometry, result.truth.pose
    heading = goal.heading or 0.0
    assert setup.robot is not None
    limits = setup.robot.limits
    bound = rest_to_rest_time(
        goal.x,
        goal.y,
        goal.heading,
        MotionLimits(
            limits.speed,
            limits.turn_rate,
            limits.acceleration,
            limits.braking,
            setup.robot.drive.track,
        ),
        reverse=reverse,
    )
    return Trip(
        result.reached + run.operator.reached_unsure == 1,
        run.operator.reached_unsure == 1,
        hypot(goal.x - pose.x, goal.y - pose.y),
        abs(shortest_turn(heading - pose.heading)),
        hypot(goal.x - at.x, goal.y - at.y),
        abs(shortest_turn(heading - at.heading)),
        farthest[0],
        run.seconds_of_goal() / bound,
        at.x - goal.x,
        at.y - goal.y,
        run.seconds_of_goal(),
        bound,
        run.output,
        max(turned - sum(map(abs, legs(goal.x, goal.y, goal.heading, False)[::2])), 0.0),
        max(rests - 1, 0),
    )


def goals_within(nearest: float, farthest: float, rng: Random) -> Goal:
    """A goal at a random place between two distances, with a random heading."""
    away = (nearest**2 + rng.random() * (farthest**2 - nearest**2)) ** 0.5
    bearing = rng.uniform(-pi, pi)
    return Goal(0, 0, away * cos(bearing), away * sin(bearing), rng.uniform(-pi, pi))


def share(values: list[float], part: float) -> float:
    """The quantile `part` of the values."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def rows(seed: int, robots: int) -> Iterator[Row]:
    """The rows on motion, one after the other."""
    for kind in ROBOTS:
        rng = Random(f"{seed} {kind}")
        setup = configuration(kind)
        stock = kind == "stock"
        trips = [
            trip(setup, goals_within(0.05, 2.0, rng), rng.getrandbits(32)) for _ in range(robots)
        ]
        near, tolerance = (0.02, 3.0) if stock else (0.01, 2.0)
        good = sum(
            t.reached and t.error <= near and degrees(t.heading_error) <= tolerance for t in trips
        ) / len(trips)
        required = 0.97 if stock else 0.99
        unsure = sum(t.is_unsure for t in trips) / len(trips)
        yield Row(
            f"{kind}: goals within 2 m reached",
            f"{good:.1%}" + (f", {unsure:.1%} unsure" if unsure else ""),
            f">= {required:.0%}",
            good >= required,
        )
        far = max(t.farther for t in trips)
        yield Row(f"{kind}: most ever farther away", f"{far:.2f} m", "<= 0.50 m", far <= 0.5)
        off = sum(degrees(t.true_heading_error) > 3.5 for t in trips) / len(trips)
        most = {"edges": 0.005, "counts": 0.02, "stock": 0.05}[kind]
        yield Row(
            f"{kind}: true heading off by > 3.5 deg", f"{off:.1%}", f"<= {most:.1%}", off <= most
        )
        yield from truth_rows(kind, trips)
        yield from ratio_row(kind, trips)
        rng = Random(f"{seed} {kind} metre")
        middle = [
            trip(setup, goals_within(0.8, 1.2, rng), rng.getrandbits(32)) for _ in range(robots)
        ]
        typical = median(t.true_error for t in middle) * 1000
        target = {"edges": 10, "counts": 12, "stock": 20}[kind]
        yield Row.at_most(f"{kind}: true position, 0.8 to 1.2 m, median", typical, target, "mm")
        yield straight(kind, seed, robots, "model")
    yield straight("edges", seed, robots, "count")
    yield ideal()


def ideal() -> Row:
    """The slowest of the known goals on a plant without faults, which may drive backwards."""
    setup = load("goal", IDEAL, [*OPEN_FLOOR, "follower.reverse=true"])
    trips = [
        trip(setup, Goal(0, 0, x, y, radians(heading)), seed=1, reverse=True)
        for x, y, heading in KNOWN_GOALS
    ]
    ratios = [one.ratio for one in trips]
    met = all(one.reached for one in trips) and max(ratios) <= 1.15
    shown = " ".join(f"{ratio:.2f}" for ratio in ratios)
    return Row("ideal plant: time over the bound, five goals", shown, "<= 1.15", met)


def truth_rows(kind: str, trips: list[Trip]) -> Iterator[Row]:
    """True position p95, true heading median and p95 of goals within 2 m."""
    place = share([t.true_error for t in trips], 0.95) * 1000
    target = {"edges": 30.0, "counts": 40.0}.get(kind)
    yield Row(
        f"{kind}: true position within 2 m, p95",
        f"{place:.1f} mm",
        f"<= {target:.0f} mm" if target else "(none)",
        target is None or place <= target,
    )
    headings = [degrees(t.true_heading_error) for t in trips]
    half, most = median(headings), share(headings, 0.95)
    met = kind == "stock" or (half <= 1.0 and most <= 2.5)
    yield Row(
        f"{kind}: true heading, median and p95",
        f"{half:.2f}, {most:.2f} deg",
        "<= 1, <= 2.5 deg" if kind != "stock" else "(none)",
        met,
    )


def ratio_row(kind: str, trips: list[Trip]) -> Iterator[Row]:
    """Time over the rest-to-rest bound."""
    ratio = median(t.ratio for t in trips)
    met = kind == "stock" or ratio <= 1.3
    yield Row(
        f"{kind}: time over the bound, median",
        f"{ratio:.2f}",
        "<= 1.30" if kind != "stock" else "(none)",
        met,
    )


def straight(kind: str, seed: int, robots: int, method: str) -> Row:
    """True lateral deviation after a straight metre."""
    rng = Random(f"{seed} {kind} straight")
    setup = configuration(kind, f"odometry.method={method}")
    aside = [
        trip(setup, Goal(0, 0, 1.0, 0.0, None), rng.getrandbits(32)).y * 1000 for _ in range(robots)
    ]
    spread = pstdev(aside)
    if method == "count":
        return Row(
            "naive counting: straight metre, lateral sd", f"{spread:.1f} mm", "(about 33)", True
        )
    target = {"edges": 6, "counts": 10, "stock": 17}[kind]
    return Row.at_most(f"{kind}: straight metre, lateral sd", spread, target, "mm")
