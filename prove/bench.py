"""Timing rows: overhead of the engine, start-up, memory, speed of simulation, latency."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from diffbotctl.block import Block
from diffbotctl.config.load import load
from diffbotctl.messages import Encoders, Goal
from diffbotctl.recording import writer
from diffbotctl.recording.recorder import Recorder
from diffbotctl.runs.build_graph import assemble
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from prove import wire
from tests.support.command_process import children_of
from tests.support.trials.proof import arguments, prove
from tests.support.trials.row import Row
from tests.support.trials.section import Section

ROOT = Path(__file__).parents[1]
PERIOD_S = 0.001
GOAL = Goal(0, 1, 1.0e6, 0.5, None)  # out of reach: the robot drives in every tick
EDGES_PER_S = 29.0  # of a wheel at the speed of the follower
OPEN_FLOOR = ["world.walls=[]"]


def quantile(values: list[float], fraction: float) -> float:
    """The value below which `fraction` of the values lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(fraction * len(ordered)))]


def five_steps() -> tuple[Any, list[Block]]:
    """A graph of five blocks (odometry to kinematics), and a second instance of these blocks."""
    setup = load(str(Path(__file__).parent / "five_steps.yaml"))
    graph = assemble(setup, real=False).graph
    names = ["odometry", "follower", "mux", "limiter", "kinematics"]
    second_graph = assemble(setup, real=False).graph
    return graph, [second_graph.block(name) for name in names]


def direct(blocks: list[Block]) -> Callable[[int, Any, Any], Any]:
    """The same computation as five direct calls."""
    odometry, follower, mux, limiter, kinematics = (block.react for block in blocks)

    def step(now: int, encoders: Any, goal: Any) -> Any:
        pose, _ = odometry(now, encoders)  # without a gyro no message of the IMU
        twist, _ = follower(now, pose, goal, encoders, None)  # no block that stops is before it
        return kinematics(now, limiter(now, mux(now, None, twist)))

    return step


def overhead(ticks: int) -> Iterator[Row]:
    """Engine and direct calls, alternating at 1 kHz, with a recording; `ticks` of each."""
    graph, blocks = five_steps()
    calls = direct(blocks)
    with tempfile.TemporaryDirectory() as folder:
        header = writer.RecordingHeader(graph.kinds, len(graph.sources), {"epoch": "0"})
        channel, _ = writer.start_recorder(Path(folder) / "bench.mcap", header, is_paced=True)
        recorder = Recorder(channel, waits=False, on_loss=print)
        commands: list[Any] = []
        sinks = {"gate.wheels": lambda now, command: commands.append(command)}
        compiled = graph.compile(sinks, recorder.record)
        engine_times, direct_times, computed = alternate(graph, compiled, calls, recorder, ticks)
        recorder.close({})
    same = commands == computed and commands[-1].left > 0.0
    yield Row("engine and direct calls give the same commands", str(same), "True", same)
    extra = (median(engine_times) - median(direct_times)) * 1e6
    ratio = quantile(engine_times, 0.999) / quantile(direct_times, 0.999)
    yield Row.at_most(
        "engine over five direct calls (gate included), median", extra, 5, "us", ".2f"
    )
    yield Row("engine over direct calls, p99.9", f"x{ratio:.2f}", "<= x3", ratio <= 3)


def inputs(tick: int) -> tuple[int, Encoders, Goal]:
    """Time, encoders and goal of a tick: a robot that drives as fast as it is commanded to."""
    now = (tick + 1) * 1_000_000
    count = int(now * 1e-9 * EDGES_PER_S)
    return now, Encoders(now, count, count, now - 500, now - 700, 9.0, 9.0), GOAL


def alternate(
    graph: Any, compiled: Any, calls: Callable[..., Any], recorder: Recorder, ticks: int
) -> tuple[list[float], list[float], list[Any]]:
    """Seconds from the Encoders message to the wheel command, per tick: engine, direct calls.

    And the commands of the direct calls.
    """
    times: tuple[list[float], list[float], list[Any]] = ([], [], [])
    clock = time.perf_counter
    for tick in range(ticks):
        now, encoders, goal = inputs(tick)
        values = {"robot.encoders": encoders, "operator.goal": goal if tick == 0 else None}
        sources = [values.get(name) for name in graph.sources]
        for variant in (0, 1) if tick % 2 else (1, 0):
            while clock() % PERIOD_S > PERIOD_S / 20:
                pass
            began = clock()
            if variant == 0:
                compiled.instant(now, *sources)
                times[0].append(clock() - began)
                recorder.drain()
            else:
                command = calls(now, encoders, goal)
                times[1].append(clock() - began)
                times[2].append(command)
    return times


def command(*words: str) -> list[str]:
    """The command line of diffbotctl."""
    return [sys.executable, "-m", "diffbotctl", *words]


def installed() -> dict[str, str]:
    """An environment in which a checkout has cached bytecode, as an installed package has.

    The first start writes it.
    """
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": BYTECODE.name}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return environment


BYTECODE = tempfile.TemporaryDirectory()


def start_up(starts: int) -> Iterator[Row]:
    """`--help`, and `run` in simulation up to the first command that turns a wheel."""
    first_command(fresh=True)  # writes the bytecode
    times = []
    for _ in range(starts):
        began = time.perf_counter()
        subprocess.run(command("--help"), stdout=subprocess.DEVNULL, check=True, env=installed())
        times.append(time.perf_counter() - began)
    yield milliseconds("diffbotctl --help", times, 100)
    cached, fresh = ([first_command(new) for _ in range(starts)] for new in (False, True))
    yield milliseconds("run to first command, files checked before", cached, 120)
    yield milliseconds("run to first command, files never checked", fresh, 250)


def milliseconds(what: str, times: list[float], limit: int) -> Row:
    """A row for the median of `times` (s); `limit` is in ms."""
    figure = median(times) * 1000
    return Row.at_most(what, figure, limit, "ms", ".0f")


def first_command(fresh: bool) -> float:
    """Seconds from the start of the process to the first command.

    The run is not paced, so the first frame of the simulated board, after 51 ms of virtual time,
    does not add a wait.
    """
    environment = installed()
    words = [sys.executable, "-m", "prove.first_command", str(time.monotonic())]
    with tempfile.TemporaryDirectory() as folder:
        if fresh:
            environment["XDG_CACHE_HOME"] = folder
        output = subprocess.run(
            [*words, "run", "goal", "--fast", "--quiet"],
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
    return float(output.split("FIRST ")[1])


def memory() -> Iterator[Row]:
    """Memory of a headless run without a recording: PSS, and private memory in parentheses.

    PSS divides a shared page among its processes, so it is lower while other Python programs run.
    """
    subprocess.run(
        command("run", "goal", "--goal", "0 0", "--quiet"),  # ends at once; writes the bytecode
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=installed(),
        check=True,
    )
    process = subprocess.Popen(
        command("run", "goal", "--goal", "2 0", "--quiet"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=installed(),
    )
    try:
        time.sleep(2.0)  # now it drives, and everything that a run needs is imported
        pss = private = 0
        for pid in [process.pid, *children_of(process.pid)]:
            text = Path(f"/proc/{pid}/smaps_rollup").read_text()
            fields = {line.split(":")[0]: line.split() for line in text.splitlines()[1:]}
            pss += int(fields["Pss"][1])
            private += int(fields["Private_Clean"][1]) + int(fields["Private_Dirty"][1])
    finally:
        process.terminate()
        process.wait()
    yield Row(
        "memory headless, PSS (private)",
        f"{pss / 1024:.1f} MB ({private / 1024:.1f})",
        "<= 28 MB",
        pss / 1024 <= 28,
    )


def simulated_speed(runs: int) -> Iterator[Row]:
    """Simulated seconds per second of the whole goal pipeline, unrecorded and recorded."""
    setup = load("goal", None, OPEN_FLOOR)
    goals = tuple(Goal(0, 0, x, 0.0, None) for x in (2.0, 0.0) * 4)
    for what, target, recorded in (
        ("unrecorded", 400, False),
        ("every message recorded", 200, True),
    ):
        ratios = []
        for seed in range(runs):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "speed.mcap" if recorded else None
                run = Run(setup, RunOptions(goals=goals, seed=seed, fast=True, record=path))
                began = time.perf_counter()
                result = run.go()
                ratios.append(result.ending.time / 1e9 / (time.perf_counter() - began))
        figure = median(ratios)
        yield Row(
            f"simulation over real time, {what}",
            f"x{figure:.0f}",
            f">= x{target}",
            figure >= target,
        )


def speed_against(commit: str, pairs: int) -> Iterator[Row]:
    """Simulated seconds per second beside those of `commit`: the same runs, alternating.

    The ratio is that of the fastest of `pairs` runs each: other programs only slow a run down.
    """
    with tempfile.TemporaryDirectory() as folder:
        older = Path(folder) / "older"
        archive = subprocess.run(
            ["git", "archive", "--format=tar", commit], cwd=ROOT, check=True, stdout=subprocess.PIPE
        )
        with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
            files.extractall(older, filter="data")
        for pipeline in ("goal", "wander"):
            for what, target, recorded in (
                ("unrecorded", 1.5, False),
                ("every message recorded", 1.4, True),
            ):
                before, now = [], []
                for seed in range(pairs):
                    path = Path(folder) / "speed.mcap" if recorded else None
                    before.append(speed_of(older, pipeline, seed, path))
                    now.append(speed_of(ROOT, pipeline, seed, path))
                ratio = max(now) / max(before)
                yield Row(
                    f"{pipeline}: simulation over real time against {commit}, {what}",
                    f"x{ratio:.2f} (x{max(before):.0f} to x{max(now):.0f})",
                    f">= x{target}",
                    ratio >= target,
                )


def speed_of(tree: Path, pipeline: str, seed: int, recording: Path | None) -> float:
    """Simulated seconds per second of the version in `tree`."""
    if recording is not None:
        recording.unlink(missing_ok=True)
    words = [str(ROOT / "prove" / "simulation_speed.py"), pipeline, str(seed)]
    output = subprocess.run(
        [sys.executable, *words, *([str(recording)] if recording else [])],
        env={**os.environ, "PYTHONPATH": str(tree)},
        cwd=tree,
        text=True,
        stdout=subprocess.PIPE,
        check=True,
    ).stdout
    figures = json.loads(output)
    return float(figures["simulated"] / figures["seconds"])


SECTIONS = (
    Section("overhead", overhead, {"ticks": 8000}, {"ticks": 200}, True),
    Section("start", start_up, {"starts": 15}, {"starts": 1}, True),
    Section("memory", memory),
    Section("simulation", simulated_speed, {"runs": 5}, {"runs": 1}, True),
    Section("wire", wire.rows, {"seconds": 12.0}, {"seconds": 0.5}, True),
)


def main() -> int:
    """Print the rows; with `--against COMMIT` those of the simulation's speed beside COMMIT."""
    names = [each.name for each in SECTIONS]
    parser = arguments("python -m prove.bench", __doc__, names)
    parser.add_argument("--against", metavar="COMMIT", help="compare the simulation's speed")
    parser.add_argument("--pairs", type=int, default=7, help="runs of each version (default 7)")
    options = parser.parse_args()
    sections: tuple[Section, ...] = SECTIONS
    if options.against:
        speed = partial(speed_against, options.against, options.pairs)
        sections = (Section("simulation", speed),)
    return prove("bench", sections, options)


if __name__ == "__main__":
    raise SystemExit(main())
