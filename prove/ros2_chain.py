"""The chain from encoders to wheels beside nodes of ROS 2, in one run: times, load, memory, start.

Ticks of both encoders go in on a pseudo-terminal, commands for the wheels come out. The nodes are
written as tutorials write them, once as a process each and once in one process with one executor.
They have no serial protocol to negotiate, no limits but one, no recording and no safety gate;
diffbotctl has all of them.

An answer of the nodes carries the number of its tick, so each is counted, however late it is. A
command of diffbotctl may equal the one before; then its answer looks the same as a
repetition, and one that takes longer than a period counts for the next tick.
"""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import tempfile
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import NamedTuple

from prove import wire
from prove.tick_answers import PAIR
from prove.wire import Ticks, Timing
from tests.support.command_process import children_of, processor_s
from tests.support.ros2_nodes import environment, ros_python
from tests.support.trials.row import NoData, Row

NODES = ("driver", "odometry", "follower", "limiter", "kinematics")
SCRIPT = Path(wire.__file__).with_name("ros2_chain_nodes.py")
START_TIMEOUT_S = 60.0
SETTLE_S = 3.0  # of ticks before the measurement: imports and discovery are over
ANSWERED_MIN = 0.6  # share of the ticks; diffbotctl repeats some commands, and then has none
CODES = 8  # as in the nodes
NUMBERS = CODES * CODES
LAST_ANSWER_S = 1.0  # in which those of the last ticks come


Processes = list[subprocess.Popen[bytes]]
Send = Callable[[Ticks, float], list[float]]
Start = Callable[[Path, str, int], AbstractContextManager[Processes]]


class ChainFigures(NamedTuple):
    """What one variant of the chain came to.

    `load`: share of a core of all its processes; `memory`: their PSS in bytes; `start`: seconds
    from its start to the first command for the wheels.
    """

    timing: Timing
    load: float
    memory: int
    start: float

    @property
    def answered(self) -> float:
        """Share of the ticks that were answered."""
        return len(self.timing.times) / self.timing.ticks

    def text(self) -> str:
        """All figures in one line."""
        timing = self.timing
        return (
            f"p50 {timing.median * 1e3:.2f}, p99 {timing.p99 * 1e3:.2f} ms; {self.load:.1%} of a "
            f"core; {self.memory / 1e6:.0f} MB; first command {self.start:.2f} s; {timing.counts()}"
        )


class Ratios(NamedTuple):
    """How many times better one variant is than another, or has to be."""

    p50: float
    p99: float
    load: float
    memory: float
    start: float

    def text(self) -> str:
        """The ratios that count; 0 counts for nothing."""
        named = zip(("p50", "p99", "load", "PSS", "start"), self, strict=True)
        return ", ".join(f"{name} {value:.1f}x" for name, value in named if value)


AGAINST_FIVE = Ratios(8.0, 4.0, 5.0, 4.0, 7.0)
AGAINST_ONE = Ratios(5.0, 0.0, 0.0, 0.9, 0.0)


def rows(repeats: int, rate: float = 50.0) -> Iterator[Row]:
    """The figures of all variants at `rate` Hz, and what diffbotctl is better by.

    Of `repeats` rounds, in which the variants alternate, each figure is the best one: other
    programs only make them worse.
    """
    if ros_python() is None:
        yield NoData("the chain beside ROS 2", "no rclpy", "`make ros2` installs it", True)
        return
    variants: dict[str, Callable[[], ChainFigures]] = {
        "diffbotctl": lambda: _measured(_diffbotctl, rate, Ticks.send),
        "five processes of rclpy": lambda: _measured(_five_processes, rate, every_answer),
        "one process of rclpy": lambda: _measured(_one_process, rate, every_answer),
    }
    found: dict[str, list[ChainFigures]] = {name: [] for name in variants}
    for _ in range(repeats):
        for name, measured in variants.items():
            try:
                found[name].append(measured())
            except TimeoutError as error:
                yield Row(f"chain at {rate:g} Hz: {name}", str(error), "commands", False)
                return
    best = {name: _best(figures) for name, figures in found.items()}
    for name, figures in best.items():
        yield Row(
            f"chain at {rate:g} Hz: {name}",
            figures.text(),
            f"at least {ANSWERED_MIN:.0%} answered",
            figures.answered >= ANSWERED_MIN,
        )
    if min(figures.answered for figures in best.values()) < ANSWERED_MIN:
        return  # a robot that was stopped, or a machine without time: nothing can be compared
    ours, five, one = best.values()
    yield _comparison("five processes", _ratios(ours, five), AGAINST_FIVE)
    yield _comparison("one process", _ratios(ours, one), AGAINST_ONE)


def _best(figures: list[ChainFigures]) -> ChainFigures:
    return ChainFigures(
        min(figures, key=lambda each: (each.answered < ANSWERED_MIN, each.timing.median)).timing,
        min(each.load for each in figures),
        min(each.memory for each in figures),
        min(each.start for each in figures),
    )


def _ratios(ours: ChainFigures, theirs: ChainFigures) -> Ratios:
    return Ratios(
        theirs.timing.median / ours.timing.median,
        theirs.timing.p99 / ours.timing.p99,
        theirs.load / ours.load,
        theirs.memory / ours.memory,
        theirs.start / ours.start,
    )


def _comparison(against: str, ratios: Ratios, target: Ratios) -> Row:
    met = all(ratio >= least for ratio, least in zip(ratios, target, strict=True))
    counted = Ratios(
        *(ratio if least else 0.0 for ratio, least in zip(ratios, target, strict=True))
    )
    return Row(f"diffbotctl better than {against}", counted.text(), target.text(), met)


def _measured(start: Start, rate: float, send: Send) -> ChainFigures:
    """Figures of the variant whose processes `start` begins on a port."""
    with tempfile.TemporaryDirectory() as name, _terminal() as (master, port):
        began = time.perf_counter()
        with start(Path(name), port, master) as processes:
            ticks = Ticks(master, rate)
            first = _first_command(ticks) - began
            ticks.send(SETTLE_S)
            while ticks.answers.wait(LAST_ANSWER_S / 10):
                pass
            everyone = [pid for each in processes for pid in (each.pid, *children_of(each.pid))]
            used, since = sum(map(processor_s, everyone)), time.perf_counter()
            sent = ticks.count
            times = send(ticks, wire.SECONDS)
            load = (sum(map(processor_s, everyone)) - used) / (time.perf_counter() - since)
            memory = sum(_pss(pid) for pid in everyone)
    return ChainFigures(Timing(sorted(times), ticks.count - sent), load, memory, first)


def every_answer(ticks: Ticks, seconds: float) -> list[float]:
    """Seconds from each tick to its answer, for nodes whose answers carry the tick's number.

    The answer to the last tick before has come.
    """
    number = _code(ticks.answers.last)
    sent: dict[int, float] = {}
    times: list[float] = []
    due = time.perf_counter()
    end = due + seconds
    while (due := due + 1.0 / ticks.rate) < end:
        _take_answers(ticks, sent, times, due)
        number = (number + 1) % NUMBERS
        ticks.write()
        sent[number] = time.perf_counter()
    _take_answers(ticks, sent, times, end + LAST_ANSWER_S)
    return times


def _take_answers(ticks: Ticks, sent: dict[int, float], times: list[float], until: float) -> None:
    while ticks.answers.wait(until - time.perf_counter()):
        since = sent.pop(_code(ticks.answers.last), None)
        if since is not None:
            times.append(time.perf_counter() - since)


def _code(pair: bytes) -> int:
    """The number of the tick in the commands for both wheels, modulo NUMBERS."""
    left, right = (struct.unpack_from("<i", pair, place)[0] for place in (7, PAIR // 2 + 7))
    return int(left % CODES + CODES * (right % CODES))


def _first_command(ticks: Ticks) -> float:
    """Send ticks until a command comes that turns a wheel; the time of it."""
    deadline = time.perf_counter() + START_TIMEOUT_S
    while time.perf_counter() < deadline:
        ticks.send(1.5 / ticks.rate)
        if any(ticks.board.pwm.values()):
            return time.perf_counter()
    raise TimeoutError("no command came for the wheels")


@contextmanager
def _terminal() -> Iterator[tuple[int, str]]:
    """A pseudo-terminal: our end, and the name of the other one."""
    master, slave = os.openpty()
    tty.setraw(slave)
    try:
        yield master, os.ttyname(slave)
    finally:
        os.close(master)
        os.close(slave)


@contextmanager
def _ended(processes: Processes) -> Iterator[Processes]:
    """End the processes afterwards."""
    try:
        yield processes
    finally:
        for process in processes:
            process.send_signal(signal.SIGTERM)
        for process in processes:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def _diffbotctl(folder: Path, port: str, master: int) -> Iterator[Processes]:
    words = [*wire.command(port, folder / "chain.mcap"), "--quiet"]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with _ended([process]) as processes:
        wire.negotiate(master)
        yield processes


@contextmanager
def _five_processes(folder: Path, port: str, master: int) -> Iterator[Processes]:
    with _ended([_nodes(folder, port, name) for name in NODES]) as processes:
        yield processes


@contextmanager
def _one_process(folder: Path, port: str, master: int) -> Iterator[Processes]:
    with _ended([_nodes(folder, port, *NODES)]) as processes:
        yield processes


def _nodes(folder: Path, port: str, *names: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [str(ros_python()), str(SCRIPT), port, *names],
        env=environment(folder),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _pss(pid: int) -> int:
    """Proportional set size of a process (bytes)."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) << 10
