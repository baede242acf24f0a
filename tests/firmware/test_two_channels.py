"""Two-channel encoders: the firmware on the emulated boards, and the host behind it."""

from dataclasses import replace
from math import degrees, hypot, pi
from pathlib import Path

import pytest

import tests.support
from diffbotctl.config.load import load
from diffbotctl.emulator.emulated_robot import emulated_robot_driver
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.messages import Encoders, Goal
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from diffbotctl.time import SECOND
from tests.sampling import by_day, each_once
from tests.support.board_bench import (
    MEGA_BOARD,
    PICO_BOARD,
    RADIO,
    UNO_BOARD,
    BoardBench,
    speed,
    trials_on,
)
from tests.support.trials import two_channels

ROBOTS = Path(tests.support.__file__).parent
BOARDS = pytest.mark.parametrize(
    "board", by_day(1, [PICO_BOARD, MEGA_BOARD, UNO_BOARD]), ids=["pico", "mega2560", "uno"]
)


@pytest.mark.parametrize(
    ("board", "slots_per_second"),
    [(MEGA_BOARD, 12_000), (UNO_BOARD, 12_000), (PICO_BOARD, 20_000)],
    ids=["mega2560", "uno", "pico"],
)
def test_no_count_is_lost_at_full_speed(board, slots_per_second):
    with trials_on(board):
        assert two_channels.slot_rate() == slots_per_second
        rows = list(two_channels.full_speed(seconds=0.2))
    for row in rows:
        assert row.met, row


@BOARDS
def test_the_board_accepts_the_most_counts_per_turn(board):
    with trials_on(board):
        settings = two_channels.two_channels()
    sides = [replace(side, slots=frames.SLOTS_MAXIMUM) for side in (settings.left, settings.right)]
    with BoardBench(settings=replace(settings, left=sides[0], right=sides[1])) as bench:
        bench.ready()  # raises LookupError when it refuses them


def test_a_robot_with_very_fine_encoders_drives_to_its_goal():
    """6569 slots a turn at 100 rpm: 10,948 edges a second, which a Mega counts."""
    sets = ["robot.drive.encoder.slots=6569", "robot.drive.motor.rated=100 rpm"]
    configuration = load("goal", str(ROBOTS / "mega_hall.yaml"), sets, real=False)
    options = RunOptions(
        port="emulated", goals=(Goal(0, 1, 0.3, 0.0, 0.0),), seed=4, fast=True, duration=30.0
    )
    result = Run(configuration, options, tell=lambda _: None).go()
    assert result.reached == 1 and result.truth is not None
    assert hypot(result.truth.pose.x - 0.3, result.truth.pose.y) < 0.01


@BOARDS
def test_a_rocking_wheel_adds_nothing(board):
    with trials_on(board):
        (row,) = two_channels.rocking()
    assert row.met, row


@each_once(
    robot=["mega_hall.yaml", "uno_hall.yaml", "pico_hall.yaml"], wiring=["plain", "exchanged"]
)
def test_a_wheel_turned_by_hand_counts_in_its_direction(robot, wiring):
    """A quarter turn forward, half a turn backward, without any command: 1320 slots a turn."""
    sets = [f"robot.simulation.wiring.left_encoder={wiring}"]
    driver = emulated_robot_driver(load("goal", str(ROBOTS / robot), sets), 3)
    counts = []

    def run(seconds):
        for delivery in driver.deliver(driver.board.now + round(seconds * SECOND)):
            if isinstance(delivery.message, Encoders):
                counts.append((delivery.message.left, delivery.message.right))
        return counts[-1]

    try:
        before = run(3)
        driver.robot.turn_by_hand(0, 0.5 * pi, pi)
        forward = run(1)
        driver.robot.turn_by_hand(0, -pi, pi)
        after = run(1.5)
    finally:
        driver.close()
    sign = 1 if wiring == "plain" else -1
    counts_of_slot = 4 if robot == "pico_hall.yaml" else 1
    assert sign * (forward[0] - before[0]) == pytest.approx(330 * counts_of_slot, abs=1)
    assert sign * (after[0] - forward[0]) == pytest.approx(-660 * counts_of_slot, abs=1)
    assert after[1] == before[1]


@pytest.mark.parametrize("port", ["sim", "emulated"])
def test_a_robot_with_a_pico_drives_to_its_goal(port):
    """The simulated board counts as the firmware does: both are as near to the goal."""
    goal = Goal(0, 1, 0.4, 0.2, pi / 2)
    options = RunOptions(port=port, goals=(goal,), seed=4, fast=True, duration=60.0)
    configuration = load("goal", str(ROBOTS / "pico_hall.yaml"), real=False)
    result = Run(configuration, options, tell=lambda _: None).go()
    assert result.reached == 1 and result.truth is not None
    pose = result.truth.pose
    assert hypot(pose.x - goal.x, pose.y - goal.y) < 0.01
    assert degrees(pose.heading) == pytest.approx(90, abs=2.5)  # the tyres slip


@pytest.mark.parametrize("channel", ["A", "B"])
def test_a_storm_at_either_channel_of_a_pico_stops_the_motors(channel):
    """200,000 pulses a second: the board names the wheel, and takes commands afterwards."""
    with trials_on(PICO_BOARD):
        settings = two_channels.two_channels()
    slow = (replace(side, slots=80) for side in (settings.left, settings.right))
    settings = replace(settings, **dict(zip(("left", "right"), slow, strict=True)))
    left = settings.left
    with BoardBench(settings=settings) as bench:
        bench.ready()
        bench.send(RADIO, speed(1, 3.0, 3.0))
        bench.wait(30)
        assert min(bench.duty) > 0.1
        bench.emulator.pulses(left.encoder if channel == "A" else left.encoder_b, 2500, 2500)
        for number in range(2, 8):
            bench.send(RADIO, speed(number, 3.0, 3.0))
            bench.wait(50)
        assert bench.duty == [0.0, 0.0]
        assert bench.state().mode == frames.ModeCode.FAULT
        flags = [
            each.frame.value
            for each in bench.received
            if isinstance(each.frame, frames.StatusFrame)
            and each.frame.item == frames.ItemCode.FLAGS
        ]
        both = frames.FLAG_LEFT_STORM | frames.FLAG_RIGHT_STORM
        assert flags[-1] & both == frames.FLAG_LEFT_STORM
        bench.emulator.pulses(left.encoder if channel == "A" else left.encoder_b, 0, 0)
        bench.wait(600)
        bench.claim()
        bench.send(RADIO, frames.ActionFrame(frames.ActionCode.CLEAR, 0))
        bench.wait(30)
        bench.send(RADIO, speed(9, 3.0, 3.0))
        bench.wait(30)
        assert min(bench.duty) > 0.1


def test_a_pico_needs_an_interrupt_for_each_channel():
    with trials_on(PICO_BOARD), BoardBench() as bench:
        settings = two_channels.two_channels()
        bench.wait(30)
        for pin, refusal in ((27, "PIN_INTERRUPT"), (None, "PIN_MISSING")):
            wrong = replace(settings, right=replace(settings.right, encoder_b=pin))
            answer = bench.configure(wrong)
            assert answer.refusal == frames.RefusalCode[refusal]
            assert frames.SettingsFrame._fields[answer.field] == "right_encoder_b"
        assert bench.configure(settings).refusal == frames.RefusalCode.NONE


@pytest.mark.parametrize("board", [MEGA_BOARD, UNO_BOARD], ids=["mega2560", "uno"])
def test_an_avr_board_refuses_to_count_every_edge(board):
    with trials_on(board), BoardBench() as bench:
        bench.wait(30)
        settings = replace(two_channels.two_channels(), every_edge=True)
        assert bench.configure(settings).refusal == frames.RefusalCode.RANGE
