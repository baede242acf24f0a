"""Driving over a radio link that is late, lossy and away for 5 s: the firmware's binary behind it.

In virtual time; `tests/bluetooth` drives over the same radio in real time, through a socket.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import pairwise
from math import hypot
from pathlib import Path
from random import Random
from typing import NamedTuple

from diffbotctl.config.load import load
from diffbotctl.emulator.emulated_robot import emulated_robot_driver
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder
from diffbotctl.messages import Goal, Stop
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.robot_run import PortRobot
from diffbotctl.runs.run import Run
from tests.support.radio_module import DeliveredFrame
from tests.support.remote_board import RemoteBoard
from tests.support.trials.row import Row

OUTAGE = 5.0  # s
SILENCE = 0.100  # s; less must not stop the robot
OF_SILENCE = ("telemetry_stale", "range_stale", "reconnect", "command_stale")
LOST_SILENTLY = "gone silent"  # in the cause of `link_lost`; else the connection itself broke
LATEST = 3.0  # s of driving before the outage; the goals take three and more
LONGEST = 60.0  # s of virtual time for one drive
LOOK_BACK = 0.6  # s before a dead-man's stop was seen: its 300 ms, and the delay of the news
EXPIRED = frames.ModeCode.EXPIRED
GLANCE = 1_000_000_000  # ns between two looks of the person at the robot


class Trial(NamedTuple):
    """How one drive went. `stops`: silence (s) before each stop that it caused, and the code."""

    outage: str

    reached: bool
    stops: list[tuple[float, str]]
    frames: int
    lost: int
    error: float  # m, of the true place from the goal
    consents: int  # that were needed after stops that waited for them


class Drive(Run):
    """A run on a far board, with a person who resumes what waits for that."""

    def __init__(self, seed: int, outage: tuple[str, float, float], options: RunOptions) -> None:
        self.seed, self.outage = seed, outage
        super().__init__(load("goal", "book_2wd", ()), options, tell=lambda _: None)
        self.consents, self.looked = 0, 0
        self.far.person = self.look

    def _open_robot(self) -> PortRobot:
        near = emulated_robot_driver(self.configuration, self.options.seed)
        self.far = RemoteBoard(near.board, near.host, self.seed, self.outage)
        return PortRobot(self.far, self.far.robot)

    def look(self, now: int) -> None:
        """Resume, when a stop waits for it."""
        if now - self.looked < GLANCE:
            return
        self.looked = now
        if any(stop.latched for stop in self.operator.stops_in_force.values()):
            self.consents += 1
            self.operator.resume(now)


def trial(seed: int, outage: str) -> Trial:
    """One drive; `outage`: away (the connection stays), hung up (it breaks), or none."""
    rng = Random(seed)
    goal = Goal(0, 1, rng.uniform(0.7, 1.1), rng.uniform(-0.3, 0.3), None)
    when = (outage, rng.uniform(0.0, LATEST), OUTAGE)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.mcap"
        options = RunOptions("emulated", (goal,), seed, fast=True, duration=LONGEST, record=file)
        drive = Drive(seed, when, options)
        result = drive.go()
        stops = silences(file) + expiries(drive.far.passed)
    assert result.truth is not None
    pose, ways = result.truth.pose, (drive.far.up, drive.far.down)
    return Trial(
        outage,
        result.reached == 1,
        stops,
        sum(w.count for w in ways),
        sum(w.lost for w in ways),
        hypot(pose.x - goal.x, pose.y - goal.y),
        drive.consents,
    )


def silences(recording: Path) -> list[tuple[float, str]]:
    """Silence (s), and the code, of each of the host's stops that was for want of news.

    The silence is that of the wire that was missed. Before its first message nothing was driving.
    """
    found = []
    news: dict[str, tuple[int, int]] = {}  # of each wire: the last two times something came
    for each in RecordingReader(recording).messages():
        before, last = news.get(each.wire, (0, 0))
        if each.time != last:
            news[each.wire] = (last, each.time)
        stop = each.message
        if isinstance(stop, Stop) and not each.from_driver and _of_silence(stop):
            missed = "robot.front" if stop.code == "range_stale" else "robot.encoders"
            before, last = news.get(missed, (0, 0))
            since = before if each.time == last else last  # it was the frame after the silence
            if since:
                found.append(((each.time - since) / 1e9, stop.code))
    return found


def _of_silence(stop: Stop) -> bool:
    return stop.code in OF_SILENCE or (stop.code == "link_lost" and LOST_SILENTLY in stop.cause)


def expiries(passed: list[DeliveredFrame]) -> list[tuple[float, str]]:
    """Longest silence of the host, in s, just before each stop by the board's dead-man."""
    found, mode, decoder = [], None, FrameDecoder()
    to_board = [each.at for each in passed if not each.to_host]
    for each in passed:
        if not each.to_host:
            continue
        for frame in decoder.feed(each.data):
            if isinstance(frame, frames.StateFrame | frames.CountsFrame):
                if frame.mode == EXPIRED and mode not in (None, EXPIRED):
                    found.append((_longest(to_board, each.at), "dead-man"))
                mode = frame.mode
    return found


def _longest(times: list[float], until: float) -> float:
    near = [at for at in times if until - LOOK_BACK <= at <= until]
    marks = [until - LOOK_BACK, *near, until]
    return max(b - a for a, b in pairwise(marks))


def rows(seed: int, trials: int = 30) -> Iterator[Row]:
    """A third of the trials each: no outage, out of reach, hung up."""
    kinds = ("none", "away", "hung up")
    done = [trial(seed * 1000 + number, kinds[number % 3]) for number in range(trials)]
    reached = sum(each.reached for each in done)
    consents = sum(each.consents for each in done)
    lost, sent = sum(each.lost for each in done), sum(each.frames for each in done)
    yield Row.counted(
        "radio of 10 to 50 ms, 1 % lost, 5 s outages: goals",
        reached,
        trials,
        f"all, with `resume` ({consents})",
    )
    stops = [stop for each in done for stop in each.stops]
    least = f", least {min(stops)[0] * 1000:.0f} ms ({min(stops)[1]})" if stops else ""
    yield Row(
        "  stops for silence, and how long that was",
        f"{len(stops)}{least}",
        ">= 100 ms",
        all(silence >= SILENCE for silence, _ in stops),
    )
    for kind in kinds:
        worst = max(each.error for each in done if each.outage == kind)
        yield Row(
            f"  true distance from the goal, outage: {kind}",
            f"<= {worst * 1000:.0f} mm",
            "(no target)",
            True,
        )
    yield Row(
        "  frames lost of those sent, outages included",
        f"{lost} of {sent}",
        "(no target)",
        lost > 0,
    )
