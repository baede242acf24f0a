"""Random robots, perturbations and goals on both plants: what is reached, reported and given up.

`python -m prove.matrix --seed N --runs N` prints a table of the perturbations, as that of
`diffbotctl trials`, and the worst cases; each can be run alone:
`python -m prove.matrix --case SEED:ROBOT:PERTURBATION:PLANT:NUMBER`.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from math import ceil, sqrt
from multiprocessing import Pool
from pathlib import Path
from statistics import median

from diffbotctl.trials.random_robots import STOCK_FIRST
from diffbotctl.trials.summary import case_lines, worst_first
from diffbotctl.trials.verdict import JudgedRun
from tests.support.matrix_case import EQUATIONS, Case, CaseResult, run_case
from tests.support.random_robots import ENCODER_FAULTS, PERTURBATIONS
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

ROBOTS = 24
RUNS = ROBOTS * len(PERTURBATIONS) * len(EQUATIONS) * 4
COVERAGE_RUNS_MIN = 400  # independent runs of one robot, or with one perturbation
# Shares within 1, 2 and 3 standard deviations: one axis, and the radius of two. Ideal ones are
# 0.683, 0.954 and 0.997, and 0.393, 0.865 and 0.989.
HEADING_TARGET, POSITION_TARGET = (0.62, 0.89, 0.98), (0.33, 0.80, 0.97)
FALSE_SIGMAS, FALSE_MIN, FALSE_WORST = 4.0, 0.020, 0.100
TRAVEL_MAX_S, STANDING_MAX_S = 1.0, 5.0
MODESTY_MAX = 1.5
STOCK_DIVISOR, STOCK_TEXT = 4, "the book's firmware, "
WORST = 20  # cases that are named


def cases(
    seed: int, runs: int, plants: Iterable[int], robots: int = ROBOTS, first: int = 0
) -> Iterator[Case]:
    """`runs` cases, with all robots, perturbations and plants as evenly as the number allows.

    The robots are numbered from `first` on.
    """
    plants = tuple(plants)
    names = tuple(PERTURBATIONS)
    for index in range(runs):
        plant = plants[index % len(plants)]
        rest = index // len(plants)
        # The robot advances with each case, the perturbation too: any few cases are a mixture.
        number, place = divmod(rest, robots * len(names))
        robot = place % robots
        name = names[(place // robots + robot) % len(names)]
        yield Case(seed, first + robot, name, plant, number)


def run_all(todo: Iterable[Case]) -> list[CaseResult]:
    """The results, in the order of the cases, which run on all processors."""
    with Pool() as pool:
        return [*pool.imap(run_case, todo, chunksize=2)]


def rows(results: list[CaseResult], what: str = "") -> Iterator[Row]:
    """The rows of both plants, one after the other; `what` describes all of them."""
    for plant, equations in EQUATIONS.items():
        of_plant = [result for result in results if result.case.plant == plant]
        if of_plant:
            yield from _plant_rows(f"{what}plant {plant} ({equations})", of_plant)


def stock_cases(seed: int, runs: int, plants: Iterable[int]) -> list[Case]:
    """Cases of robots with the book's firmware, a quarter as many as `runs`."""
    return [*cases(seed, ceil(runs / STOCK_DIVISOR), plants, first=STOCK_FIRST)]


def _plant_rows(name: str, results: list[CaseResult]) -> Iterator[Row]:
    feasible = [result for result in results if result.is_feasible]
    reached = [result.trial for result in feasible if result.trial.is_claimed]
    unsure = sum(trial.outcome == "reached_unsure" for trial in reached)
    share = len(reached) / max(len(feasible), 1)
    yield Row(
        f"{name}: {len(feasible)} feasible goals reached",
        f"{share:.1%}" + (f", {unsure / len(feasible):.1%} unsure" if unsure else ""),
        ">= 97 %",
        share >= 0.97,
    )
    yield from _given_up_row(name, results)
    late = [result for result in results if result.farther > result.farther_limit]
    worst = max(results, key=lambda result: result.farther / result.farther_limit)
    yield Row(
        f"{name}: farther than the start by more than allowed",
        f"{len(late)}, worst {worst.farther:.2f} m",
        "0: max(0.3 m, speed x (1 s + lag))",
        not late,
    )
    false = [result for result in results if is_false(result)]
    most = max((result.true_error for result in false), default=0.0)
    yield Row(
        f"{name}: reached, but > 4 sd and > 20 mm off",
        f"{len(false) / len(results):.2%}, worst {most * 1000:.0f} mm",
        "<= 0.3 %, none above 100 mm",
        len(false) <= 0.003 * len(results) and most <= FALSE_WORST,
    )
    yield from _coverage_rows(name, results)
    calm = [result for result in results if result.case.perturbation == "none"]
    if calm:
        hesitant = sum(result.trial.outcome == "reached_unsure" for result in calm) / len(calm)
        yield Row(
            f"{name}: reached_unsure without perturbation",
            f"{hesitant:.1%} of {len(calm)}",
            "<= 3 %",
            hesitant <= 0.03,
        )


def is_false(result: CaseResult) -> bool:
    """Whether it claims a goal from which it is farther than it reported."""
    return (
        result.trial.outcome == "reached"
        and result.true_error > FALSE_MIN
        and result.position_sigmas > FALSE_SIGMAS
    )


def is_late(result: CaseResult) -> bool:
    """Whether a goal was given up too late, or without a cause."""
    return (
        result.travel_after > TRAVEL_MAX_S
        or result.standing_after > STANDING_MAX_S
        or not result.cause
        or result.trial.outcome in ("time_limit", "ended")
    )


def _given_up_row(name: str, results: list[CaseResult]) -> Iterator[Row]:
    given_up = [each for each in results if not each.is_feasible and not each.trial.is_claimed]
    if not given_up:
        return
    late = sum(is_late(result) for result in given_up)
    travel = max(result.travel_after for result in given_up)
    standing = max(result.standing_after for result in given_up)
    of_wheel = [result for result in given_up if result.wheel]
    named = sum(result.is_named for result in of_wheel)
    yield Row(
        f"{name}: {len(given_up)} infeasible given up in time",
        f"{1 - late / len(given_up):.0%}; {travel:.0f}, {standing:.0f} s; "
        f"{named} of {len(of_wheel)} wheels named",
        "all: 1 s of travel, 5 s of standing",
        not late and named == len(of_wheel),
    )


def _coverage_rows(name: str, results: list[CaseResult]) -> Iterator[Row]:
    """Shares within 1, 2, 3 reported standard deviations of the worst robot and perturbation."""
    headings = [(each.reported_heading, each.estimate_turn) for each in results]
    positions = [
        (each.reported_position * sqrt(2.0), each.trial.estimate_error or 0.0) for each in results
    ]
    for what, target, sigmas, pairs in (
        ("heading", HEADING_TARGET, _heading_sigmas, headings),
        ("position", POSITION_TARGET, _position_sigmas, positions),
    ):
        for kind, groups in (("all", {"": results}), *_groups(results)):
            if not groups:
                continue
            worst = min(groups, key=lambda key: _margin(_shares(groups[key], sigmas), target))
            shares = _shares(groups[worst], sigmas)
            size = len(groups[worst])
            yield Row(
                f"{name}: {what} in 1/2/3 sd, {kind} {worst} ({size})".replace(" ()", ""),
                "/".join(f"{100 * share:.0f}" for share in shares),
                ">= " + "/".join(f"{100 * part:.0f}" for part in target),
                _margin(shares, target) >= 0.0,
            )
        ratio = modesty(pairs)
        yield Row(
            f"{name}: {what}: median reported sd over actual RMS",
            f"{ratio:.2f}",
            f"<= {MODESTY_MAX}",
            ratio <= MODESTY_MAX,
        )


def _groups(results: list[CaseResult]) -> Iterator[tuple[str, dict[str, list[CaseResult]]]]:
    """Robots and perturbations with enough runs; with few runs the perturbations as they are."""
    by_robot, by_perturbation = defaultdict(list), defaultdict(list)
    for result in results:
        by_robot[str(result.case.robot)].append(result)
        by_perturbation[result.case.perturbation].append(result)
    for kind, groups in (("robot", by_robot), ("with", by_perturbation)):
        yield kind, {key: group for key, group in groups.items() if len(group) >= COVERAGE_RUNS_MIN}


Measure = Callable[[CaseResult], float]


def _heading_sigmas(result: CaseResult) -> float:
    return abs(result.heading_sigmas)


def _position_sigmas(result: CaseResult) -> float:
    return result.position_sigmas


def modesty(pairs: list[tuple[float, float]]) -> float:
    """Median of the reported standard deviations over the RMS of the actual errors."""
    rms = sqrt(sum(error * error for _, error in pairs) / len(pairs))
    return median(reported for reported, _ in pairs) / rms if rms else 0.0


def _shares(results: list[CaseResult], sigmas: Measure) -> tuple[float, ...]:
    values = [sigmas(result) for result in results]
    return tuple(sum(value <= limit for value in values) / len(values) for limit in (1, 2, 3))


def _margin(shares: tuple[float, ...], target: tuple[float, ...]) -> float:
    return min(share - part for share, part in zip(shares, target, strict=True))


def summary(results: list[CaseResult]) -> Iterator[str]:
    """The table of the perturbations and the worst cases, on each plant."""
    for plant, equations in EQUATIONS.items():
        judged = [judge(result) for result in results if result.case.plant == plant]
        if not judged:
            continue
        yield f"\nplant {plant} ({equations}): {len(judged)} runs"
        yield from case_lines(judged)
        for each in worst_first([each for each in judged if not each.passed])[:WORST]:
            yield line(each)


def judge(result: CaseResult) -> JudgedRun:
    """What of a case is not as the rows ask for."""
    found = result.trial
    unmet = {
        "feasible, not reached": result.is_feasible and not found.is_claimed,
        "given up late": not (result.is_feasible or found.is_claimed) and is_late(result),
        "farther than allowed": result.farther > result.farther_limit,
        "false claim": is_false(result),
        "position beyond 4 sd": _position_sigmas(result) > FALSE_SIGMAS,
        "heading beyond 4 sd": _heading_sigmas(result) > FALSE_SIGMAS,
    }
    return JudgedRun(found, tuple(text for text, is_so in unmet.items() if is_so))


def line(judged: JudgedRun) -> str:
    """One line about a run."""
    found = judged.result
    return (
        f"{found.name:<26} {found.outcome:<14} {found.time:6.1f} s  "
        f"true {(found.error or 0.0) * 1000:5.0f} mm  "
        f"estimate off {(found.estimate_error or 0.0) * 1000:5.0f} mm  "
        f"farther {found.farther or 0.0:.2f} m  {', '.join(judged.unmet)}: {found.cause}"
    )


def case_text(case: Case, folder: Path | None) -> str:
    """All that is known of one case."""
    result = run_case(case, folder)
    fields = result._asdict() | result.trial._asdict()
    return "\n".join(f"{name:<16} {value}" for name, value in fields.items() if name != "trial")


ENCODER_FAULT_TEXTS = {
    "halved": "encoders that lose every second slot",
    "halved_for_a_time": "encoders that do so for 1 to 4 s",
    "both_halved": "pairs of encoders that both do so",
    "silent_for_moments": "encoders that give no pulses for up to 0.4 s, one to four times",
}


def encoder_cases(seed: int, runs: int, plants: Iterable[int]) -> list[Case]:
    """`runs` cases on each plant of encoders that do not show what their wheels do."""
    return [
        Case(seed, number % ROBOTS, fault, plant, number // ROBOTS)
        for plant in plants
        for fault in ENCODER_FAULTS
        for number in range(runs)
    ]


def encoder_rows(results: list[CaseResult]) -> Iterator[Row]:
    """What is reported when no odometry can follow: no goal may be claimed without a warning."""
    for plant, equations in EQUATIONS.items():
        for fault in ENCODER_FAULTS:
            group = [
                result
                for result in results
                if result.case.plant == plant and result.case.perturbation == fault
            ]
            if group:
                what = f"{len(group)} {ENCODER_FAULT_TEXTS[fault]}"
                yield _encoder_row(f"plant {plant} ({equations}): {what}", group)


def _encoder_row(what: str, group: list[CaseResult]) -> Row:
    false = [result for result in group if is_false(result)]
    most = max((result.true_error for result in false), default=0.0)
    farther = sum(result.farther > result.farther_limit for result in group)
    return Row(
        f"{what}: reached, but > 4 sd and > 20 mm off",
        f"{len(false)}, worst {most * 1000:.0f} mm; {farther} farther than allowed",
        "none above 100 mm",
        most <= FALSE_WORST,
    )


def sample(seed: int, runs: int, plants: int = len(EQUATIONS)) -> Iterator[Row]:
    """The rows of `runs` runs on the plants."""
    chosen = drawn(EQUATIONS, plants, seed)
    yield from rows(run_all(cases(seed, runs, chosen)))
    yield from rows(run_all(stock_cases(seed, runs, chosen)), STOCK_TEXT)
    faults = ceil(runs / len(PERTURBATIONS) / len(chosen))
    yield from encoder_rows(run_all(encoder_cases(seed, faults, chosen)))


def main() -> None:
    """Print the summary, or one case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--runs", type=int, default=RUNS)
    parser.add_argument("--case", type=Case.parse, help="run one case, and print all of it")
    parser.add_argument("--keep", type=Path, help="folder for the files of --case")
    options = parser.parse_args()
    if options.case is not None:
        print(case_text(options.case, options.keep))
    else:
        print("\n".join(summary(run_all(cases(options.seed, options.runs, EQUATIONS)))))


if __name__ == "__main__":
    main()
