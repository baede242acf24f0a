"""The timing rows: overhead, start-up, memory, speed of simulation. Ratios within one run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from math import inf
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
from diffbotctl.testing.trials.row import Row, printed
from prove import wire

TICKS = 8000  # a side
PERIOD = 0.001  # s
CHAIN = ["world.walls=[]"]


def quantile(values: list[float], part: float) -> float:
    """The value below which `part` of the values lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def five_steps() -> tuple[Any, list[Block]]:
    """The graph of five steps (odometry to kinematics), and the same blocks once more."""
    setup = load(str(Path(__file__).parent / "five_steps.yaml"))
    graph = assemble(setup, real=False).graph
    names = ["odometry", "follower", "mux", "limiter", "kinematics"]
    again = assemble(setup, real=False).graph
    return graph, [again.block(name) for name in names]


def direct(blocks: list[Block]) -> Callable[[int, Any, Any], Any]:
    """The same maths as five direct calls."""
    odometry, follower, mux, limiter, kinematics = (block.react for block in blocks)

    def step(now: int, encoders: Any, goal: Any) -> Any:
        pose = odometry(now, encoders)
        twist, _ = follower(now, pose, goal, None)
        return kinematics(now, limiter(now, mux(now, None, twist)))

    return step


def overhead() -> Iterator[Row]:
    """Engine against direct calls, alternating at 1 kHz, recording on."""
    graph, blocks = five_steps()
    calls = direct(blocks)
    with tempfile.TemporaryDirectory() as folder:
        header = writer.RecordingHeader(graph.kinds, len(graph.sources), {"epoch": "0"})
        channel, _ = writer.start_recorder(Path(folder) / "bench.mcap", header)
        recorder = Recorder(channel, waits=False, on_loss=print)
        left: list[Any] = []
        compiled = graph.compile({"gate.wheels": lambda now, m: left.append(m)}, recorder.record)
        engine_times, direct_times = alternate(graph, compiled, calls, recorder)
        recorder.close({})
    extra = (median(engine_times) - median(direct_times)) * 1e6
    ratio = quantile(engine_times, 0.999) / quantile(direct_times, 0.999)
    yield Row(
        "engine over five direct calls (gate included), median",
        f"{extra:.2f} us",
        "<= 5 us",
        extra <= 5,
    )
    yield Row("engine over direct calls, p99.9", f"x{ratio:.2f}", "<= x3", ratio <= 3)


def alternate(
    graph: Any, compiled: Any, calls: Callable[..., Any], recorder: Recorder
) -> tuple[list[float], list[float]]:
    """Times of both sides, tick by tick, from the encoders' message to the wheels'."""
    place = graph.sources.index("robot.encoders")
    goal_place = graph.sources.index("operator.goal")
    goal = Goal(0, 1, 1.0e6, 0.5, None)
    times: tuple[list[float], list[float]] = ([], [])
    clock = time.perf_counter
    for tick in range(TICKS):
        now = (tick + 1) * 1_000_000
        count = tick // 10
        values: list[Any] = [None] * len(graph.sources)
        values[place] = Encoders(now, count, count, now - 500, now - 700, 9.0, 9.0)
        values[goal_place] = goal if tick == 0 else None
        first, second = (0, 1) if tick % 2 else (1, 0)
        for side in (first, second):
            while clock() % PERIOD > PERIOD / 20:
                pass
            began = clock()
            if side == 0:
                compiled.instant(now, *values)
                times[0].append(clock() - began)
                recorder.drain()
            else:
                calls(now, values[place], goal)
                times[1].append(clock() - began)
    return times


def command(*words: str) -> list[str]:
    """The program as a command line."""
    return [sys.executable, "-m", "diffbotctl", *words]


def installed() -> dict[str, str]:
    """The environment in which a checkout starts as what pip installs: with its bytecode beside it,
    which every first start of a program writes unless it is forbidden to."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": BYTECODE.name}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return environment


BYTECODE = tempfile.TemporaryDirectory()


def start_up() -> Iterator[Row]:
    """`--help`, and `run` in simulation until the first command that turns a wheel leaves."""
    first_command(fresh=True)  # which writes the bytecode
    times = []
    for _ in range(15):
        began = time.perf_counter()
        subprocess.run(command("--help"), stdout=subprocess.DEVNULL, check=True, env=installed())
        times.append(time.perf_counter() - began)
    yield milliseconds("diffbotctl --help", times, 100)
    known, fresh = ([first_command(new) for _ in range(15)] for new in (False, True))
    yield milliseconds("run to first command, files checked before", known, 120)
    yield milliseconds("run to first command, files never checked", fresh, 250)


def milliseconds(what: str, times: list[float], most: int) -> Row:
    """A row for the median of some times."""
    figure = median(times) * 1000
    return Row(what, f"{figure:.0f} ms", f"<= {most} ms", figure <= most)


def first_command(fresh: bool) -> float:
    """Seconds from the start of the process to the first command. Unpaced: the simulated board's
    first frame, 51 ms of virtual time, costs no waiting; what is measured is the start."""
    environment = installed()
    words = [sys.executable, "-m", "prove.first_command", str(time.monotonic())]
    with tempfile.TemporaryDirectory() as folder:
        if fresh:
            environment["XDG_CACHE_HOME"] = folder
        out = subprocess.run(
            [*words, "run", "goal", "--fast", "--quiet"],
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            check=True,
        ).stdout
    return float(out.split("FIRST ")[1])


def memory() -> Iterator[Row]:
    """Memory of a headless run that does not record: PSS counts a page that several processes share
    in parts, so that it falls when other programs in Python run; private is what nobody shares."""
    subprocess.run(
        command("run", "goal", "--goal", "0 0", "--quiet"),  # it is there: only compiles what runs
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
        time.sleep(2.0)  # well into the drive: what a run needs has been imported
        pss = private = 0
        for pid in [process.pid, *children(process.pid)]:
            text = Path(f"/proc/{pid}/smaps_rollup").read_text()
            facts = {line.split(":")[0]: line.split() for line in text.splitlines()[1:]}
            pss += int(facts["Pss"][1])
            private += int(facts["Private_Clean"][1]) + int(facts["Private_Dirty"][1])
    finally:
        process.terminate()
        process.wait()
    yield Row(
        "memory headless, PSS (private)",
        f"{pss / 1024:.1f} MB ({private / 1024:.1f})",
        "<= 28 MB",
        pss / 1024 <= 28,
    )


def children(pid: int) -> list[int]:
    """Child processes of `pid`."""
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


def simulated_speed() -> Iterator[Row]:
    """Simulated seconds per second of the whole goal pipeline, unrecorded and recorded."""
    setup = load("goal", None, CHAIN)
    goals = tuple(Goal(0, 0, x, 0.0, None) for x in (2.0, 0.0) * 4)
    for what, target, recorded in (
        ("unrecorded", 400, False),
        ("every message recorded", 200, True),
    ):
        best = []
        for seed in range(5):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "speed.mcap" if recorded else None
                run = Run(setup, RunOptions(goals=goals, seed=seed, fast=True, record=path))
                began = time.perf_counter()
                result = run.go()
                best.append(result.ending.time / 1e9 / (time.perf_counter() - began))
        figure = median(best) if best else inf
        yield Row(
            f"simulation over real time, {what}",
            f"x{figure:.0f}",
            f">= x{target}",
            figure >= target,
        )


def main() -> int:
    """Print the rows."""
    parts = (overhead, start_up, memory, simulated_speed, wire.rows)
    missed = printed(row for part in parts for row in part())
    print(f"{missed} rows missed")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
