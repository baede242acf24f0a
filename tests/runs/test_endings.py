"""Every exit path ends in a stop: its output and its exit code."""

import os
import re
import resource
import signal
import threading
import time

import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.config import registry
from diffbotctl.config.load import load
from diffbotctl.messages import Goal, Twist
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.sampling import by_day
from tests.support.command_process import (
    command_line,
    command_line_with_block,
    start_in_pipe,
)
from tests.support.terminal import Terminal
from tests.support.trials.host_freeze import HANGING_PIPELINE, HANGS

FAR = ["run", "goal", "--goal", "30 0", "--set", "world.walls=[]"]


def start(*words):
    return start_in_pipe(command_line(*words))


def without_core_dump():
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def read_until(process, words):
    """Lines up to the one with `words`; fails by itself when the process ends without it."""
    for line in process.stdout:
        if words in line:
            return
    raise AssertionError(f"the run ended without saying '{words}'")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_driving_ends_in_a_confirmed_stop(number):
    process = start(*FAR)
    read_until(process, "driving")
    process.send_signal(number)
    rest = process.communicate(timeout=60)[0]
    assert "final stop confirmed" in rest
    assert process.returncode == 130


@pytest.mark.parametrize("key", by_day(1, ["\x03", "\x1c"]))
def test_ctrl_c_on_a_terminal_leaves_the_emulated_board_running_for_the_stop(key):
    with Terminal(command_line(*FAR, "--port", "emulated")) as terminal:
        terminal.until(lambda text: "driving" in text)
        terminal.type(key)
        assert terminal.ended() == 130
        assert "final stop confirmed" in terminal.text


def test_a_second_ctrl_backslash_ends_a_run_whose_block_hangs(tmp_path):
    pipeline = tmp_path / "hanging.yaml"
    pipeline.write_text(HANGING_PIPELINE)
    place = "tests.support.trials.host_freeze:Hangs"
    line = command_line_with_block("hangs", place, "run", pipeline, "--set", "hangs.after=1 s")
    process = start_in_pipe(line, cwd=tmp_path, preexec_fn=without_core_dump)
    read_until(process, HANGS)
    process.send_signal(signal.SIGQUIT)
    while process.poll() is None:
        process.send_signal(signal.SIGQUIT)
        time.sleep(0.01)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGQUIT


def test_the_end_of_the_time_is_a_confirmed_stop():
    run = Run(load("goal", None, ["world.walls=[]"]), RunOptions(fast=True, duration=2.0))
    result = run.go()
    assert result.ending.stopped is True and result.ending.code == 1  # the goal was not reached
    left, right = (wheel.speed for wheel in run.plant.wheels)
    assert abs(left) < 0.01 and abs(right) < 0.01


def run_with_fault(fault, **options):
    sets = ["world.walls=[]", f"robot.simulation.faults=[{{fault: {fault}}}]"]
    return Run(load("goal", None, sets), RunOptions(fast=True, **options)).go()


@pytest.mark.parametrize("fault", ["board_reset, at: 1 s", "operator_stop, at: 1 s"])
def test_a_latched_stop_that_nothing_can_end_ends_a_fast_run(fault):
    result = run_with_fault(fault)
    (stop,) = result.stops
    assert (result.ending.code, result.ending.stopped, result.reached) == (1, True, 0)
    assert stop.code in result.ending.cause and result.ending.cause.endswith(stop.cause)
    assert result.ending.time - stop.time < SECOND


def test_a_latched_stop_that_something_can_end_ends_no_run():
    assert run_with_fault("operator_stop, at: 1 s, for: 1 s").reached == 1
    limited = run_with_fault("operator_stop, at: 1 s", duration=3.0)
    assert limited.ending.cause.startswith("time limit")


def test_a_latched_stop_of_one_robot_ends_only_its_goals(tmp_path):
    path = tmp_path / "pair.yaml"
    path.write_text("""format: 1
kind: pipeline
include:
  - {path: goal, as: left, set: {world.walls: []}}
  - path: goal
    as: right
    set: {world.walls: [], robot.simulation.faults: [{fault: operator_stop, at: 1 s}]}
""")
    result = Run(load(str(path)), RunOptions(fast=True)).go()
    assert (result.ending.code, result.reached, result.goals) == (1, 1, 2)
    assert "left: all goals reached; right: goal 1 was not reached" in result.ending.cause


class Breaks(Block):
    """Raises when it has driven for a while."""

    twist = In(Twist)
    out = Out(Twist, name="twist")

    def reset(self):
        self.count = 0

    def react(self, now, twist):
        self.count += 1
        return Twist(now, 1 / (60 - self.count), 0.0)._replace(linear=0.1)


def test_a_block_that_raises_is_named_and_the_robot_stopped(tmp_path, monkeypatch):
    from diffbotctl.config import registry

    monkeypatch.setitem(registry.BLOCKS, "breaks", f"{__name__}:Breaks")
    file = tmp_path / "breaks.yaml"
    file.write_text(
        """
format: 1
kind: pipeline
robot: {use: book_2wd, in: {wheels: kinematics.wheels}}
blocks:
  odometry: {block: odometry, in: {encoders: robot.encoders}}
  follower: {block: goal_follower, in: {odometry: odometry.odometry, goal: operator.goal}}
  bad: {block: breaks, in: {twist: follower.twist}}
  kinematics: {block: diff_drive, in: {twist: bad.twist}}
"""
    )
    options = RunOptions(fast=True, goals=(Goal(0, 0, 2.0, 0.0, None),), record=tmp_path / "r.mcap")
    result = Run(load(str(file)), options).go()
    assert result.ending.code == 1 and result.ending.stopped is True
    text = str(result.failure)
    assert "block bad" in text and "ZeroDivisionError" in text


def test_a_full_disk_is_reported_at_once_and_the_run_continues():
    reported = []
    setup = load("goal", None, ["world.walls=[]"])
    run = Run(setup, RunOptions(fast=True, record="/dev/full"), tell=reported.append)
    result = run.go()
    assert result.reached == 1 and result.ending.stopped is True
    assert "No space left" in result.recording
    assert len(reported) == 1 and "RECORDING STOPPED" in reported[0]


def test_a_killed_run_leaves_a_readable_recording_that_check_refuses(tmp_path):
    from diffbotctl.errors import RunError
    from diffbotctl.recording.reader import RecordingReader
    from diffbotctl.replay.replay import replay

    path = tmp_path / "killed.mcap"
    process = start(*FAR, "--record", str(path))
    read_until(process, "driving")
    reader = threading.Thread(target=process.stdout.read)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    reader.start()
    reader.join(timeout=60)  # the children hold the pipe: when it ends they have written all
    recorded = list(RecordingReader(path).messages())
    assert any(item.wire == "gate.wheels" for item in recorded)
    with pytest.raises(RunError, match="incomplete"):
        replay(path, check=True)
    assert replay(path, check=False).ending.code == 0


def test_a_replay_is_the_run_again_bit_for_bit(tmp_path):
    from diffbotctl.replay.replay import replay

    path = tmp_path / "whole.mcap"
    result = Run(load("goal"), RunOptions(fast=True, record=path, digest=True, seed=8)).go()
    again = replay(path, check=True)
    assert again.difference is None and again.digest == result.digest and again.compared > 1000


class Sleeps(Block):
    """Does not return for 0.4 s, once, when it has driven for a while."""

    twist = In(Twist)
    out = Out(Twist, name="twist")

    def reset(self):
        self.has_slept = False

    def react(self, now, twist):
        if now > 1.5 * SECOND and not self.has_slept:
            self.has_slept = True
            time.sleep(0.4)
        return twist


def test_a_block_that_sleeps_stops_the_robot_with_its_name(tmp_path, monkeypatch):
    monkeypatch.setitem(registry.BLOCKS, "sleeps", f"{__name__}:Sleeps")
    pipeline = tmp_path / "sleeping.yaml"
    pipeline.write_text(HANGING_PIPELINE.replace("hangs", "sleeps").replace("requested:", "twist:"))
    options = RunOptions(goals=(Goal(0, 0, 2.0, 0.0),), duration=3.0)
    result = Run(load(str(pipeline), "book_2wd", ["world.walls=[]"]), options).go()
    (stop,) = result.stops
    assert (stop.code, stop.latched) == ("block_overrun", True)
    # Less than 0.4 s where the engine has waited for a processor in this instant, which is not the
    # block's fault; always more than the limit.
    took = re.search(r"block sleeps took (\d+\.\d\d) s for one reaction; 0\.15 s", stop.cause)
    assert took is not None and float(took[1]) > 0.15
    assert result.odometry.x < 0.6  # 0.3 m/s for 1.5 s, and the way to standstill
