"""The whole pipeline on the emulated board; the plant's model of the board against the binary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import cos, degrees, hypot, pi, sin
from random import Random
from statistics import median
from typing import NamedTuple

from diffbotctl.config.load import load
from diffbotctl.control.speed_loop import LOOP_PERIOD, SpeedGains, WheelSpeedLoop
from diffbotctl.emulator.process import PinTransition
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.messages import Goal
from diffbotctl.runs.options import RunOptions, RunResult
from diffbotctl.runs.run import Run
from diffbotctl.time import MILLISECOND as MS
from tests.support.board_bench import (
    ENCODERS,
    RADIO,
    BoardBench,
    speed,
    trial_board,
)
from tests.support.trials.row import Row

LONGEST = 60.0  # s of virtual time for one goal
QUANTUM = 1 / 255  # of duty: eight bits of PWM


class Trip(NamedTuple):
    """One goal of one robot: true errors, and how its link did."""

    reached: bool
    far: float  # mm
    turned: float  # deg
    spoilt: int  # frames damaged or lost
    rate: float  # state frames a second


def goals(seed: int, count: int) -> Iterator[Row]:
    """Random goals, each with another robot, the radio's delay, and all noise of the robot file.

    The median is judged where the main job judges it, for goals 0.8 to 1.2 m away.
    """
    rng = Random(seed)
    near = [_trip(rng, (0.8, 1.2), seed * 1000 + number) for number in range(count)]
    trips = near + [_trip(rng, (0.3, 2.0), seed * 2000 + number) for number in range(count)]
    reached = sum(trip.reached for trip in trips)
    middle = median(trip.far for trip in near)
    far, turned = max(trip.far for trip in trips), max(trip.turned for trip in trips)
    spoilt, rate = sum(trip.spoilt for trip in trips), min(trip.rate for trip in trips)
    total = len(trips)
    yield Row(
        f"{total} goals on the emulated board: reached", f"{reached}", "all", reached == total
    )
    yield Row.at_most("true position, median, goals 0.8 to 1.2 m", middle, 10, "mm")
    yield Row.at_most("true position, worst within 2 m", far, 60, "mm")
    yield Row.at_most("true heading, worst", turned, 4, "deg", ".2f")
    yield Row("checksum errors and state frames lost", f"{spoilt}", "0", spoilt == 0)
    # Frames leave at whole milliseconds of the board: a span of seconds resolves 0.005 Hz.
    yield Row("state frames, slowest run", f"{rate:.2f} Hz", ">= 38 Hz", round(rate, 2) >= 38)


def _trip(rng: Random, within: tuple[float, float], seed: int) -> Trip:
    distance, bearing = rng.uniform(*within), rng.uniform(-pi, pi)
    heading = rng.uniform(-pi, pi)
    goal = Goal(0, 1, distance * cos(bearing), distance * sin(bearing), heading)
    result, host = _drive(goal, seed)
    assert result.truth is not None
    pose = result.truth.pose
    far = hypot(pose.x - goal.x, pose.y - goal.y) * 1000
    turned = abs(degrees((pose.heading - heading + pi) % (2 * pi) - pi))
    assert result.link is not None
    return Trip(result.reached == 1, far, turned, result.link.damaged + result.link.lost, host.rate)


def _drive(goal: Goal, seed: int) -> tuple[RunResult, DiffbotHost]:
    configuration = load("goal", trial_board().robot, (), real=False)
    run = Run(
        configuration,
        RunOptions(
            port="emulated", goals=(goal,), seed=seed, fast=True, duration=LONGEST, digest=True
        ),
        tell=lambda _: None,
    )
    result = run.go()
    return result, run.robot.host  # type: ignore[union-attr]


def same_twice(seed: int) -> Iterator[Row]:
    """One run, twice."""
    goal = Goal(0, 1, 1.0, 0.5, pi / 2)
    first, second = (_drive(goal, seed)[0].digest for _ in range(2))
    figure = f"{first and first[:8]} {second and second[:8]}"
    yield Row("the same run twice: digest", figure, "equal", first is not None and first == second)


def agreement(seed: int, count: int) -> Iterator[Row]:
    """Equal edges and commands to the binary and to the plant's model of its speed loop."""
    rng = Random(seed)
    differences: list[float] = []
    for _ in range(count):
        differences += _compare(rng)
    differences.sort()
    middle, high = median(differences), differences[int(0.99 * len(differences))]
    yield Row(
        "plant's speed loop against the binary, median",
        f"{middle:.4f}",
        f"<= {QUANTUM:.4f}",
        middle <= QUANTUM,
    )
    yield Row("the same, 99 of 100", f"{high:.4f}", f"<= {3 * QUANTUM:.4f}", high <= 3 * QUANTUM)


def _compare(rng: Random) -> list[float]:
    """One wheel, commands and edges at random; differences of duty, sampled away from changes."""
    gains = SpeedGains(0.10, 0.086, 0.01, rng.uniform(0.01, 0.05))
    bench_settings = trial_board().settings
    side = replace(
        bench_settings.left, start=0.10, gain=0.086, proportional=0.01, integral=gains.integral
    )
    settings = replace(bench_settings, left=side)
    model = WheelSpeedLoop(gains, side.slots)
    differences = []
    with BoardBench(settings=settings) as bench:
        bench.ready()
        bench.wait(400)
        target, rate, edge = 0.0, 10.0, bench.now
        tick = bench.now + LOOP_PERIOD // 2
        for step in range(60):
            if step == 0:
                bench.claim()
            if step % 10 == 0:
                target = rng.choice((-1, 1)) * rng.uniform(1, 9)
                rate = abs(target) * side.slots / (2 * pi) * rng.uniform(0.8, 1.2)
            bench.send(RADIO, speed(step, target, target))
            start = bench.now
            quantised = round(target * 256) / 256
            model.command(start + 11 * MS, quantised)
            edges = []
            while edge < start + 50 * MS:
                if edge >= start:
                    edges.append(edge)
                edge += round(1e9 / rate)
            for rise in edges:
                for pin in ENCODERS:
                    bench.pins += [
                        PinTransition(rise, pin, 1),
                        PinTransition(rise + 4 * MS, pin, 0),
                    ]
            while tick < start + 50 * MS:
                for rise in [each for each in edges if each <= tick]:
                    model.edge(rise)
                edges = [each for each in edges if each > tick]
                model.tick(tick)
                tick += LOOP_PERIOD
            for rise in edges:
                model.edge(rise)
            bench.wait(50)
            if step % 10 >= 8:  # a reversal from end to end slews for 0.4 s
                differences.append(abs(bench.duty[0] - model.duty))
    return differences
