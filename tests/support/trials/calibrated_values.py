"""Values that the calibration chain writes for simulated robots, against the truth."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from random import Random
from statistics import fmean
from tempfile import TemporaryDirectory

from diffbotctl.calibrate.runner import make_step, open_session, run_step
from diffbotctl.config.load import load_robot
from diffbotctl.errors import Problem, RunError
from diffbotctl.ui.terminal_prompter import TerminalPrompter
from tests.support.calibration_robots import SilentScreen
from tests.support.matrix_case import EQUATIONS
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

CHAIN = ("encoders", "motors", "distance", "geometry")
WITHIN_SD, SHARE_MIN = 2.0, 0.90


class EnterKey(TerminalPrompter):
    """A person who presses Enter at every question."""

    def _type(self, text: str, default: str = "") -> str:
        return default


def robot_text(rng: Random, equations: str, pulses: str) -> str:
    """A robot whose geometry, motors, battery and floor are drawn at random."""
    track, diameter = rng.uniform(0.0, 0.04), rng.uniform(0.0, 0.006)
    sag, slip = rng.choice((0.0, 0.04, 0.10)), rng.choice((0.2, 0.5, 1.0))
    return (
        "format: 1\nkind: robot\ninclude: book_2wd\n"
        "drive: {polarity: checked_by_hand, "
        f"left: {{motor: {{pulses: {pulses}}}}}, right: {{motor: {{pulses: {pulses}}}}}}}\n"
        f"simulation: {{equations: {equations}, slip: {slip} mm, battery: {{sag: {sag}}}, "
        f"geometry: {{track_spread: {track:.4f}, diameter_spread: {diameter:.4f}}}}}\n"
        "calibration: {}\n"
    )


def deviations(
    seed: int, equations: str, pulses: str, folder: Path, steps: Sequence[str]
) -> dict[str, float]:
    """Errors of the values of one robot, in their standard deviations, by field.

    Raises RunError for a chain that a fault ends.
    """
    robot = folder / f"robot-{seed}.yaml"
    robot.write_text(robot_text(Random(f"calibrated values {seed}"), equations, pulses))
    session, tools = open_session(load_robot(str(robot)), "sim", seed)
    assert tools is not None
    with session, redirect_stdout(StringIO()):
        prompter = EnterKey(tools=tools)
        for name in steps:
            outcome = run_step(make_step(name), session, prompter, SilentScreen())
            if outcome.faults:
                raise RunError(Problem("E-CALIBRATE-ROBOT", name, outcome.faults[0]))
            session.recording.clear()
        values = tools.compare(session.findings.values())
    return {value.field: value.deviation for value in values if value.deviation is not None}


def rows(
    seed: int, robots: int, steps: int = len(CHAIN), plants: int = len(EQUATIONS)
) -> Iterator[Row]:
    """The chain on robots of each plant."""
    for equations in drawn(EQUATIONS.values(), plants, seed):
        yield from plant_rows(seed, robots, steps, equations)


def plant_rows(
    seed: int,
    robots: int,
    steps: int = len(CHAIN),
    equations: str = "exponential",
    pulses: str = "inputs",
) -> Iterator[Row]:
    """For each field, the share of robots whose value lies within two standard deviations."""
    by_field: dict[str, list[float]] = defaultdict(list)
    failed = 0
    with TemporaryDirectory() as folder:
        for number in range(robots):
            try:
                one = 1000 * seed + number
                found = deviations(one, equations, pulses, Path(folder), CHAIN[:steps])
            except RunError:
                failed += 1
                continue
            for field, deviation in found.items():
                by_field[field.replace("left.", "").replace("right.", "")].append(deviation)
    what = f"calibrated values, {robots} robots, {equations}, {pulses}"
    for field, errors in by_field.items():
        share = fmean(abs(error) <= WITHIN_SD for error in errors)
        rms = fmean(error * error for error in errors) ** 0.5
        yield Row(
            f"{what}: {field.removeprefix('drive.')}",
            f"{100 * share:.0f} % within 2 sd",
            f">= {100 * SHARE_MIN:.0f} %; rms {rms:.2f} sd",
            share >= SHARE_MIN,
        )
    yield Row(f"{what}: chain not finished", f"{failed}", "0", not failed)
