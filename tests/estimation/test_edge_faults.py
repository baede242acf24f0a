"""Faults of an encoder: probabilities by hand, and the odometry of a robot that misses edges."""

from math import degrees, exp, hypot
from random import Random
from statistics import median

import pytest

from diffbotctl.config.load import load
from diffbotctl.estimation.edge_counts import NO_FAULTS
from diffbotctl.estimation.edge_hypothesis import EdgeHypothesis
from diffbotctl.estimation.wheel_frame import WheelFrame
from diffbotctl.estimation.wheel_kalman import WheelKalman
from diffbotctl.estimation.wheel_side import Priors
from diffbotctl.messages import Wheels
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot

MS = 1_000_000
TOUR = [*[(60, k, k) for k in range(1, 8)], (4000, 8.0, 8.0), (1000, 0.0, 0.0)]


@pytest.mark.parametrize(
    "edges, seen, missed, probability",
    [
        (0, 0, 1, 0.001),
        (50, 0, 1, 0.0005),
        (50, 1, 1, 1.05 / 100),  # one fault in 50 edges beside the prior 0.05 in 50
        (50, 1, 2, 0.3 * 1.05 / 100),
        (0, 0, -1, 0.001),
        (10, 30, 1, 0.1),  # the limit
    ],
)
def test_probability_of_a_missed_edge(edges, seen, missed, probability):
    faults = NO_FAULTS.added(edges, seen)
    assert exp(faults.log_prior(missed)) == pytest.approx(probability)


def test_a_working_encoder_has_no_warning():
    assert NO_FAULTS.added(500, 0).added(1, 1).text == ""
    assert "edges are missing: about 3 of 103" in NO_FAULTS.added(100, 3).text
    assert "counted twice" in NO_FAULTS.added(100, -3).text


def drive(seed: int, missed: float):
    """Drive 1 m ahead; the left encoder misses a share of its edges in steady motion."""
    setup = load("goal", "book_2wd")
    simulation = setup.robot.simulation
    simulation.slip = 0.0
    robot = SimulatedRobot("edges", plant_parameters(setup.robot), simulation, Random(seed))
    use = next(use for use in setup.blocks if use.name == "odometry")
    odometry = use.cls(**use.values)
    odometry.reset()
    pin, left = robot.wheels[0]._pins, robot.board.sides[0]
    now = 0
    for span, *speeds in TOUR:
        until = now + span * MS
        while now < until:
            robot.command(now, Wheels(now, *speeds))
            now += 20 * MS
            robot.advance(now)
            if left.count > 20:
                pin._disc = pin._disc._replace(missed=missed)
            for port, message in robot.deliver():
                if port == "encoders":
                    pose, _ = odometry.react(message.time, message)
    truth = robot.truth().pose
    return pose, degrees(pose.heading - truth.heading), hypot(pose.x - truth.x, pose.y - truth.y)


@pytest.mark.nightly
def test_missed_edges_neither_turn_nor_shift_the_pose():
    """One missed edge of 10 mm turns a counting robot by 4.7 deg; three of a hundred are missed."""
    headings, places, warnings = [], [], []
    for seed in range(12):
        pose, heading, place = drive(seed, 0.03)
        headings.append(abs(heading))
        places.append(place)
        warnings.append(pose.warning)
    assert median(headings) < 1.0
    assert median(places) < 0.02
    assert sum("left wheel: edges are missing" in text for text in warnings) >= 6
    assert not any("right" in text for text in warnings)


def test_an_encoder_that_misses_nothing_gives_no_warning():
    assert [drive(seed, 0.0)[0].warning for seed in range(6)] == [""] * 6


@pytest.mark.parametrize("is_extra", [True, False], ids=["extra", "missed"])
def test_the_edge_of_a_hypothesis_is_that_of_the_counts_less_its_faults(is_extra):
    """A wheel that gives an edge every fifth frame of 20 ms: one comes in the middle, or late."""
    frame, hypotheses = 20 * MS, [EdgeHypothesis(WheelKalman(Priors(lag=0.1), 20), 0, 0)]
    for number in range(1, 203):
        count = number // 5 + (1 if is_extra else -1) * (number > 201)
        edges = WheelFrame(number * frame, max(count, 0), None, 10.0, 0, 0.3)
        hypotheses = [branch for one in hypotheses for branch in one.update(edges)]
        if number < 202:
            hypotheses = hypotheses[:1]
    if not is_extra:  # the next edge comes in time, with the count of the one before
        late = WheelFrame(206 * frame, 41, None, 10.0, 0, 0.3)
        hypotheses = [branch for one in hypotheses for branch in one.update(late)]
    first = hypotheses[0]
    assert len(hypotheses) > 1
    for one in hypotheses:
        difference = one.faults.missed - one.faults.extra
        assert one.edge_slot - first.edge_slot == difference - (
            first.faults.missed - first.faults.extra
        )


def test_edges_of_a_wheel_that_is_taken_for_standing_are_no_additional_ones():
    """They would be, one by one, for as long as the wheel turns, and its pose would stay behind."""
    frame, hypotheses = 20 * MS, [EdgeHypothesis(WheelKalman(Priors(lag=0.1), 20), 0, 0)]
    for number in range(1, 101):
        edges = WheelFrame(number * frame, number // 5, None, 10.0, 0, 0.3)
        hypotheses = hypotheses[0].update(edges)
    hypotheses[0].motion.speed = 0.0
    for number in range(101, 120):  # no drive is known of, and the edges go on
        edges = WheelFrame(number * frame, number // 5, None, 0.0, 100 * frame, 0.0)
        hypotheses = [branch for one in hypotheses for branch in one.update(edges)]
        assert all(one.faults.extra == 0 for one in hypotheses)
        hypotheses = hypotheses[:1]


def starting_wheel(until: int) -> EdgeHypothesis:
    """A wheel after `until` frames of 20 ms with a drive of 10 pitches/s; its first edge is due
    within 0.3 s."""
    hypotheses = [EdgeHypothesis(WheelKalman(Priors(lag=0.1), 20), 0, 0)]
    for number in range(1, until):
        frame = WheelFrame(number * 20 * MS, 0, None, 10.0, 0, 0.3)
        hypotheses = [branch for one in hypotheses for branch in one.update(frame)]
    assert len(hypotheses) == 1
    return hypotheses[0]


def test_the_first_edge_of_a_wheel_that_starts_is_late_not_missing():
    assert starting_wheel(50).faults.number == 0


@pytest.mark.parametrize(
    "edges, excess, cost",
    [(0, 0.5, 1.5), (3, 0.5, 1.5), (4, 0.5, 4.0), (0, -0.5, 4.0)],
    ids=["at once", "within the first edges", "later", "sooner than predicted"],
)
def test_a_wheel_that_starts_may_be_held_suddenly(edges, excess, cost):
    wheel = starting_wheel(10).motion
    wheel.edges_since_rest = edges
    assert wheel.speed > 0.0 and wheel.change_cost(excess) == cost
    wheel.drive_reversed()
    assert wheel.change_cost(0.5) == 1.5
