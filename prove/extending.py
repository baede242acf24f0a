"""Own messages, inputs and programs: what works, how long it takes, what happens when they fail."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

from diffbotctl.replay.replay import replay
from tests.support import own_package
from tests.support.running import PlainClient, cli, running
from tests.support.trials import hostile_sockets, programs, round_trips
from tests.support.trials.row import Row
from tests.support.trials.section import drawn

ROOT = Path(__file__).parent.parent
RATIO_MAX, ENGINE_MAX = 3.0, 0.03
STOP_MAX_S = 0.3
SILENT_KIND = "hang"  # leaves the engine the least to do
LOAD_RATIO_MAX = 2.0
PEAK_MAX_BYTES = 100 << 20


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@contextmanager
def _python_path(*folders: Path) -> Iterator[None]:
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(map(str, folders))
    try:
        yield
    finally:
        os.environ.pop("PYTHONPATH")
        if before is not None:
            os.environ["PYTHONPATH"] = before


def message_rows() -> Iterator[Row]:
    """Commands that take messages of another package, and read them where it is missing."""
    with _folder() as folder:
        site, recording = folder / "site", str(folder / "noses.mcap")
        pipeline = str(own_package.install(site))
        picture = str(folder / "ppm.svg")
        with _python_path(ROOT, site):
            outputs = [
                cli(folder, *words)
                for words in (
                    ("run", pipeline, "--fast", "--quiet", "--record", recording),
                    ("graph", pipeline),
                    ("blocks", "show", "smell"),
                    ("replay", recording, "--check"),
                    ("replay", recording, "--set", "nose.gain=2"),
                )
            ] + _running_commands(folder, pipeline)
        with _python_path(ROOT):
            absent = [
                cli(folder, *words)
                for words in (
                    ("bag", "info", recording),
                    ("bag", "export", recording, "nose.face", "nose.own", "nose.gas"),
                    (
                        "bag",
                        "plot",
                        "nose.gas.ppm",
                        "nose.own.near",
                        recording,
                        "--output",
                        picture,
                    ),
                    ("bag", "diff", recording, recording),
                )
            ]
        yield _count("own messages: commands with the package", outputs)
        yield _count("own messages: bag without the package", absent)
        text = outputs[1][1]
        both = "odd_noses/Range" in text and " Range " in text.replace("odd_noses/Range", "")
        yield Row("own Range beside the built-in one", "both" if both else "mixed up", "both", both)


def _running_commands(folder: Path, pipeline: str) -> list[tuple[int, str, str]]:
    with running(folder, pipeline, "--stay", "--goal", "0 0"):
        client = PlainClient(folder)
        client.until(lambda status: status["time"] > 300_000_000)  # ns: some frames
        client.close()
        return [
            cli(folder, *words)
            for words in (
                ("topic", "list"),
                ("topic", "echo", "nose.face", "--once"),
                ("topic", "hz", "nose.gas", "--once"),
                ("topic", "type", "nose.own"),
                ("call", "nose.raise_count", "by=10"),
                ("param", "set", "nose.gain", "3"),
                ("dash", "--once"),
            )
        ]


def _count(what: str, outputs: list[tuple[int, str, str]]) -> Row:
    good = sum(code == 0 and "INCOMPLETE" not in out for code, out, _ in outputs)
    return Row.counted(what, good, len(outputs))


def round_trip_rows(seconds: float) -> Iterator[Row]:
    """Round trips at 200 Hz, beside those of the same program through bare pipes."""
    with _folder() as folder:
        trips, equal = {}, []
        for language, (run, echo) in round_trips.senders(folder).items():
            floor = round_trips.bare(folder, run, echo, seconds)
            bound = round_trips.bare(folder, run, round_trips.json_echo(folder), seconds)
            trip = round_trips.through_program(folder, run, seconds)
            trips[f"program in {language}"] = floor, bound, trip
            equal.append(_is_equal(trip))
        # The client of the measurement is written in Python.
        floor, bound, _ = trips["program in Python"]
        trip = round_trips.through_client(folder, seconds)
        trips["client in Python"] = floor, bound, trip
        equal.append(_is_equal(trip))
        for what, (floor, bound, trip) in trips.items():
            ratio = trip.median / floor.median
            yield Row(
                f"round trip at 200 Hz, {what}",
                f"{trip.figure(floor)}; bare {floor.median * 1e3:.3f} ms, an interpreter that only "
                f"reads and writes JSON {bound.median / floor.median:.1f}x, "
                f"{100 * bound.engine:.1f} % of a core",
                f"<= {RATIO_MAX:g}x, <= {100 * ENGINE_MAX:g} % of a core",
                ratio <= RATIO_MAX and trip.engine <= ENGINE_MAX,
            )
        yield Row(
            "their replays without programs and client",
            f"{sum(equal)} of {len(equal)} equal",
            "all",
            all(equal),
        )


def _is_equal(trips: round_trips.RoundTrips) -> bool:
    """Whether a replay of the recording gives the same messages."""
    assert trips.recording is not None
    return replay(trips.recording, check=True).difference is None


def failure_rows(seed: int, failures: int, kinds: int = len(programs.CAUSES)) -> Iterator[Row]:
    """Programs that drive and fail: stopped in time, named, latched; and their replays.

    `failures` programs fail in each way.
    """
    equal = runs = 0
    loads: dict[str, float] = {}
    others = [kind for kind in programs.CAUSES if kind != SILENT_KIND]
    for kind in (SILENT_KIND, *drawn(others, kinds - 1, seed)):
        outcomes = []
        for place in range(failures):
            with _folder() as folder:
                outcomes.append(programs.fail(folder, kind, programs.DRIVEN_LINES + place % 7))
        right = sum(outcome.is_right and outcome.is_in_time for outcome in outcomes)
        worst = max(outcome.silence for outcome in outcomes)
        loads[kind] = median(outcome.load for outcome in outcomes)
        equal += sum(outcome.is_equal for outcome in outcomes)
        runs += len(outcomes)
        yield Row(
            f"program that drives: {kind.replace('_', ' ')}",
            f"{right} of {failures} stopped, named, latched; {worst * 1e3:.0f} ms at most",
            f"all, <= {1e3 * (programs.TIMEOUT_S + programs.MARGIN_S):.0f} ms",
            right == failures,
        )
    ratio = max(loads.values()) / loads[SILENT_KIND]
    yield Row(
        "engine's load, the worst kind over a program that hangs",
        f"{ratio:.1f} times, {max(loads.values()):.1%} of a core",
        f"<= {LOAD_RATIO_MAX:g} times",
        ratio <= LOAD_RATIO_MAX,
    )
    yield Row(
        "their replays without the programs", f"{equal} of {runs} equal", "all", equal == runs
    )


def silent_reader_rows(requests: int, stops: int) -> Iterator[Row]:
    """A client that sends requests and never reads, beside one that stops the robot."""
    with _folder() as folder:
        attack = hostile_sockets.silent_reader(folder, requests, stops)
    worst = max(attack.stops)
    good = attack.survived and not attack.failures and worst <= STOP_MAX_S
    yield Row(
        f"client that never reads, {attack.requests} requests",
        f"stop {worst * 1e3:.0f} ms at most of {stops}, {attack.peak_bytes >> 20} MB",
        f"<= {STOP_MAX_S * 1e3:.0f} ms, <= {PEAK_MAX_BYTES >> 20} MB",
        good and attack.peak_bytes <= PEAK_MAX_BYTES,
    )
