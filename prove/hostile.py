"""Hostile files, recordings and clients; memory over a day."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from random import Random

from tests.support.confined import ConfinedCommands, ConfinedOutcome
from tests.support.trials import (
    hostile_recordings,
    hostile_sockets,
    hostile_tables,
    hostile_yaml,
    long_run,
)
from tests.support.trials.row import Row

MEMORY_MAX_BYTES = 100 << 20
CPU_MAX_S = 2.0
GROWTH_MAX_BYTES = 3 << 20
STOP_MAX_S = 0.3
GOOD = Path(__file__).parent.parent / "tests" / "data" / "recordings"
RECORDINGS = ("edges.mcap", "turtle.mcap", "ease.mcap", "obstacle.mcap")
RUNS = (("square", "book_2wd"), ("wander", "turtlebot3_burger"))


def rows(seed: int, count: int, commands_max: int | None = None) -> Iterator[Row]:
    """`count` files of each kind, with which at most as many commands are run."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with ConfinedCommands(folder) as commands:
            yield _file_row(
                "robot and pipeline files", _files(commands, rng, folder, count), commands_max
            )
            yield _file_row("recordings", _recordings(commands, rng, folder, count), commands_max)
            yield _file_row(
                "tables, answers, state files", _tables(commands, rng, folder, count), commands_max
            )


def client_rows(seed: int, count: int) -> Iterator[Row]:
    """Invalid lines over half of `count` connections, and twenty clients that flood."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        attack = hostile_sockets.attack(Path(name), rng, connections=count // 2, lines=20)
        is_met = attack.survived and not attack.failures and attack.peak_bytes <= MEMORY_MAX_BYTES
        figure = f"{attack.requests} lines, {attack.peak_bytes >> 20} MB"
        yield Row("21 hostile socket: the run goes on", figure, "alive, <= 100 MB", is_met)
    with tempfile.TemporaryDirectory() as name:
        flood = hostile_sockets.flood(Path(name), repeats=max(3, count // 20))
        figure = f"worst {max(flood.stops) * 1000:.0f} ms of {len(flood.stops)}"
        yield Row(
            "F stop under a flood of 20 clients", figure, "0.3 s", max(flood.stops) <= STOP_MAX_S
        )


def memory_rows(seed: int, hours: float) -> Iterator[Row]:
    """Growth over `hours` of simulated time."""
    for pipeline, robot in RUNS:
        use = long_run.measure_in_process(pipeline, robot, hours, seed)
        what = f"20 memory of {robot}, {hours:g} h simulated"
        yield Row(what, f"+{use.growth / 1e6:.1f} MB", "3 MB", use.growth <= GROWTH_MAX_BYTES)


def _file_row(what: str, outcomes: Iterable[ConfinedOutcome], most: int | None) -> Row:
    """Faults, greatest memory and time; what goes wrong is printed."""
    count = faults = peak = 0
    slowest = 0.0
    for outcome in islice(outcomes, most):
        count += 1
        peak, slowest = max(peak, outcome.peak_bytes), max(slowest, outcome.cpu_s)
        if outcome.faults:
            faults += 1
            print(f"  {' '.join(outcome.words)}: {outcome.faults}: {outcome.output[-300:]!r}")
    is_met = not faults and peak <= MEMORY_MAX_BYTES and slowest <= CPU_MAX_S
    figure = f"{faults} of {count}, {peak >> 20} MB, {slowest:.1f} s"
    return Row(f"21 hostile {what}: defects", figure, "0, 100 MB, 2 s CPU", is_met)


def _files(
    commands: ConfinedCommands, rng: Random, folder: Path, count: int
) -> Iterator[ConfinedOutcome]:
    path = folder / "hostile.yaml"
    robots = {shipped.stem for shipped in hostile_yaml.SHIPPED if shipped.parent.name == "robots"}
    for stem, content in hostile_yaml.hostile_files(rng, count):
        path.write_bytes(content)
        words = ("goal", "--robot", path) if stem in robots else (path,)
        yield commands.run("check", path)
        yield commands.run("run", *words, "--fast", "--for", "1s", "--quiet")
    for content in hostile_yaml.bombs().values():
        path.write_bytes(content)
        yield commands.run("check", path)
    for included in hostile_yaml.included_files(folder).values():
        yield commands.run("check", included)


def _recordings(
    commands: ConfinedCommands, rng: Random, folder: Path, count: int
) -> Iterator[ConfinedOutcome]:
    path, good = folder / "hostile.mcap", GOOD / rng.choice(RECORDINGS)
    damaged = hostile_recordings.hostile_recordings(rng, good, count)
    for content in (*(data for _, data in damaged), *hostile_recordings.bombs(good).values()):
        path.write_bytes(content)
        for words in (
            ("bag", "info", path),
            ("bag", "diff", path, good),
            ("bag", "recover", path, "--output", folder / "recovered.mcap", "--force"),
            ("replay", path),
            ("replay", path, "--check"),
            ("replay", path, "--set", "follower.tolerance=2cm"),
        ):
            yield commands.run(*words)


def _tables(
    commands: ConfinedCommands, rng: Random, folder: Path, count: int
) -> Iterator[ConfinedOutcome]:
    table, answers = folder / "drive.csv", folder / "answers.yaml"
    state = folder / "diffbotctl" / "start.json"
    state.parent.mkdir(exist_ok=True)
    for content in hostile_tables.hostile_tables(rng, count):
        table.write_bytes(content)
        yield commands.run("calibrate", "from-log", table, "--robot", "book_2wd")
    for content in hostile_tables.hostile_answers(rng, count):
        answers.write_bytes(content)
        state.write_bytes(content)
        words = ("calibrate", "battery", "--port", "sim", "--yes", "--answers", answers)
        yield commands.run(*words)
        yield commands.run("start", "--status")
