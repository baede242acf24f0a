"""Discs are learnt from lifted wheels that turn each way; too little motion is refused."""

from math import pi
from random import Random
from statistics import fmean

import pytest

from diffbotctl.calibrate.steps.discs import DiscLearner, learn_discs, turning_duty
from diffbotctl.config.load import load
from diffbotctl.messages import Duty, Encoders
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.time import MILLISECOND as MS

SLOTS = 20
PITCH = 2 * pi / SLOTS  # rad
WAYS = ((300, 3.0), (300, 6.0), (10_000, 8.0), (1000, 0.0))  # ms, rad/s; each way


def learner():
    use = next(use for use in load("goal", "book_2wd").blocks if use.name == "odometry")
    built = DiscLearner(**use.values)
    built.reset()
    return built


def turned(seed: int, ways=(1.0, -1.0)):
    """A robot drawn from `seed`, and the frames of its board while both wheels turned."""
    setup = load("goal", "book_2wd")
    robot = SimulatedRobot(
        "edges", plant_parameters(setup.robot), setup.robot.simulation, Random(seed)
    )
    now, frames = 0, []
    for way in ways:
        for span, speed in WAYS:
            until = now + span * MS
            while now < until:
                duty = turning_duty(now, setup.robot, way * speed) if speed else Duty(now, 0.0, 0.0)
                robot.command(now, duty)
                now += 100 * MS
                robot.advance(now)
                frames += [each for port, each in robot.deliver() if port == "encoders"]
    return robot, frames


def scatter(true, learnt, first):
    """Standard deviation of what is left when slot `first` is taken for the pattern's first."""
    left = [true[(first + slot) % SLOTS] - learnt[slot] for slot in range(SLOTS)]
    return fmean((each - fmean(left)) ** 2 for each in left) ** 0.5


@pytest.mark.parametrize("seed", range(4))
def test_both_edges_of_each_slot_are_learnt_in_one_order(seed):
    """To a third of what they are cut to (0.03), but for the torque ripple; both rows begin at the
    same slot."""
    robot, frames = turned(seed)
    for found, disc in zip(learn_discs(learner(), frames), robot.discs, strict=True):
        places = [flank / PITCH - number / 2 for number, flank in enumerate(disc.edges)]
        forward, backward = places[0::2], places[1::2]
        first = min(range(SLOTS), key=lambda each: scatter(forward, found.forward, each))
        assert scatter(forward, found.forward, first) < 0.01
        assert scatter(backward, found.backward, first) < 0.01
        assert fmean(found.forward) == pytest.approx(0.0, abs=1e-12)
        assert found.sd < 0.015


def test_one_direction_leaves_the_other_edges_unknown():
    _, frames = turned(0, ways=(1.0,))
    for found in learn_discs(learner(), frames):
        assert len(found.forward) == SLOTS
        assert found.backward == ()


@pytest.mark.parametrize(
    "frames, word",
    [
        ([], "no counts"),
        # a board at rest: nothing is learnt of either disc
        ([Encoders(k * 25 * MS, 0, 0, command_time=0) for k in range(40)], "left wheel"),
        ([Encoders(0, 5, 5, boot=1), Encoders(25 * MS, 0, 0, boot=2)], "restarted"),
    ],
)
def test_data_without_information_is_refused(frames, word):
    with pytest.raises(ValueError, match=word):
        learn_discs(learner(), frames)
