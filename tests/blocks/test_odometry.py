"""Odometry of a simulated robot: travel, variance, slot errors, restarts."""

from math import degrees, exp, pi, sqrt
from random import Random
from statistics import mean

import pytest

from diffbotctl.config.load import load
from diffbotctl.messages import Encoders, Wheels
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot, draw_robot
from diffbotctl.time import SECOND
from tests.sampling import by_day, each_once

MS = 1_000_000
PITCH = pi * 0.065 / 20  # m
ROBOTS = {"edges": "book_2wd", "counts": "book_2wd_counts", "stock": "book_2wd_stock"}

# (seconds, left, right) in rad/s: a metre ahead, a turn on the spot, back, and a bend.
TOUR = [
    *[(0.03, 0.9 * k, 0.9 * k) for k in range(1, 10)],
    (2.0, 8.5, 8.5),
    (1.0, 0.0, 0.0),
    (0.8, -5.0, 5.0),
    (0.8, 0.0, 0.0),
    (1.2, -6.0, -6.0),
    (0.8, 0.0, 0.0),
    (1.5, 6.0, 8.0),
    (1.5, 0.0, 0.0),
]


def block(kind: str):
    """The block as in the pipeline `goal`."""
    setup = load("goal", ROBOTS[kind])
    use = next(use for use in setup.blocks if use.name == "odometry")
    built = use.cls(**use.values)
    built.reset()
    return setup, built


def drive(kind: str, seed: int, coasting: str = "linear", tour=TOUR):
    """Drive a robot drawn from `seed` along the tour; yields (odometry, truth) of each frame."""
    setup, odometry = block(kind)
    simulation = setup.robot.simulation
    simulation.motor.coasting = coasting
    simulation.slip = 0.0
    robot = SimulatedRobot(kind, plant_parameters(setup.robot), simulation, Random(seed))
    now, truths = 0, []
    for seconds, left, right in tour:
        until = now + int(seconds * 1000) * MS
        robot.command(now, Wheels(now, left, right))
        refreshed = now
        while now < until:
            now += 5 * MS
            robot.advance(now)
            if now - refreshed >= 100 * MS:
                robot.command(now, Wheels(now, left, right))
                refreshed = now
            truths.append((now, robot.truth()))
            for port, message in robot.deliver():
                if port == "encoders":
                    pose, _ = odometry.react(now, message)
                    at = min(truths, key=lambda one: abs(one[0] - message.time))[1]
                    yield odometry, message, pose, at
            del truths[:-40]


def ends(kind: str, robots: int, coasting: str):
    """Heading errors (deg) and normalised errors squared of both wheels after the tour."""
    headings, normalised = [], []
    for seed in range(robots):
        *_, (odometry, _, pose, truth) = drive(kind, seed, coasting)
        headings.append(degrees(pose.heading - truth.pose.heading))
        for wheel, angle in zip(
            odometry.wheels, (truth.left_angle, truth.right_angle), strict=True
        ):
            error = wheel.reported_travel * PITCH - angle * 0.0325
            normalised.append(error * error / wheel.variance)
    return headings, normalised


@each_once(limit=[("edges", 0.5, 4.0), ("counts", 0.9, 5.0)], coasting=["linear", "coulomb"])
def test_heading_and_variance_are_accurate_far_below_a_slot(limit, coasting):
    kind, most, normalised_most = limit
    """One slot of one wheel is 4.7 degrees. Both kinds of friction, detected by edges alone."""
    headings, normalised = ends(kind, 12, coasting)
    assert mean(e * e for e in headings) ** 0.5 < most
    assert 0.3 < mean(normalised) < normalised_most, (
        "the filter's doubt must be neither boast nor alarm"
    )


def test_method_count_is_the_count_times_the_pitch():
    _, odometry = block("edges")
    odometry.method = "count"
    odometry.reset()
    for frame, count in enumerate((7, 7, 8, 10)):
        pose, _ = odometry.react(0, Encoders(frame * 25 * MS, count, count))
    assert pose.x == pytest.approx(3 * PITCH)


def test_slot_errors_are_learnt_in_a_few_turns():
    """After ten turns at constant speed each slot error is known to about a third."""
    tour = [*[(0.03, 0.9 * k, 0.9 * k) for k in range(1, 8)], (10.0, 6.5, 6.5)]
    wrong = []
    for seed in range(6):
        setup, odometry = block("edges")
        robot = SimulatedRobot(
            "edges", plant_parameters(setup.robot), setup.robot.simulation, Random(seed)
        )
        *_, (odometry, _, _, _) = drive("edges", seed, tour=tour)
        for wheel, disc in zip(odometry.wheels, robot.discs, strict=True):
            wrong.append(spread(slot_errors(disc), wheel.filter.motion.disc.errors[:20]))
    assert mean(wrong) < 0.013, "slots are cut to 0.03 of a pitch"


def slot_errors(disc) -> list[float]:
    pitch = 2 * pi / 20
    return [flank / pitch - slot for slot, flank in enumerate(disc.edges[0::2])]


def spread(true: list[float], learnt: list[float]) -> float:
    """Standard deviation of the remaining errors, in the rotation of the disc that fits best."""
    rests = []
    for first in range(20):
        left = [true[(first + k) % 20] - learnt[k] for k in range(20)]
        middle = mean(left)
        rests.append(mean((rest - middle) ** 2 for rest in left) ** 0.5)
    return min(rests)


def test_a_restarted_board_keeps_the_pose():
    _, odometry = block("edges")
    frames = [
        Encoders(100 * MS, 40, 44, command_time=0),
        Encoders(125 * MS, 41, 44, left_edge=120 * MS, command_time=0),
        Encoders(900 * MS, 0, 0, command_time=0, boot=1),
        Encoders(925 * MS, 0, 0, command_time=0, boot=1),
    ]
    poses = [odometry.react(frame.time, frame)[0] for frame in frames]
    assert poses[2][1:4] == poses[1][1:4]
    assert poses[3][1:4] == pytest.approx(poses[1][1:4], abs=1e-6)


@pytest.mark.parametrize("kind", ["edges", "counts"])
def test_what_wheels_roll_while_the_board_restarts_is_in_the_pose_and_its_covariance(kind):
    """Its battery fails for a moment in motion: no edge of the way until rest is counted."""
    errors = []
    for seed in range(12):
        setup, odometry = block(kind)
        plant = draw_robot(setup.robot, setup.nominal, seed)
        while plant.now < 1500 * MS:
            plant.advance(plant.due())
            for name, message in plant.deliver():
                if name == "encoders":
                    odometry.react(message.time, message)
            plant.command(plant.now, Wheels(plant.now, 8.0, 8.0))
        plant.restart_board(plant.parameters)  # it has no command, so the wheels coast
        plant.advance(plant.now + SECOND)
        restarted = Encoders(plant.now, 0, 0, command_time=0, boot=1)
        pose, truth = odometry.react(plant.now, restarted)[0], plant.truth().pose
        sd = (pose.covariance[0] - pose.geometry_sd**2) ** 0.5  # it drives along x
        errors.append((pose.x - truth.x, sd))
    assert all(abs(error) < 3.5 * sd for error, sd in errors), errors
    assert abs(mean(error for error, _ in errors)) < 0.015


def test_wheels_that_roll_out_after_a_restart_move_by_their_counts():
    """One pitch a count, with half a pitch of uncertainty of each wheel, however many they are."""
    _, odometry = block("edges")
    counts = [0, 1, 2, 3, 4, 4, 4]
    frames = [
        Encoders(0, 40, 40, command_time=0),
        *(
            Encoders((100 + 25 * number) * MS, count, count, command_time=0, boot=1)
            for number, count in enumerate(counts)
        ),
    ]
    poses = [odometry.react(frame.time, frame)[0] for frame in frames][1:]
    assert [pose.x for pose in poses] == pytest.approx([count * PITCH for count in counts])
    assert {(pose.y, pose.heading) for pose in poses} == {(0.0, 0.0)}
    first, last = poses[1].covariance, poses[-1].covariance
    assert last[0] == pytest.approx(first[0], rel=0.1)
    assert last[5] == pytest.approx(first[5], rel=0.1)


def test_the_filters_go_on_once_the_wheels_have_rolled_out():
    """Or are driven: their edges are fractions of a slot again."""
    _, odometry = block("edges")
    restarted = Encoders(100 * MS, 0, 0, command_time=0, boot=1)
    odometry.react(0, Encoders(0, 40, 40, command_time=0))
    odometry.react(100 * MS, restarted)
    for number in range(1, 20):  # ROLL_OUT_NS is 14 frames
        odometry.react(0, restarted._replace(time=(100 + 25 * number) * MS))
        assert (odometry.roll_out_end == 0) == (number >= 14)
    odometry.react(0, restarted._replace(time=SECOND, boot=2))
    driven = restarted._replace(time=1025 * MS, boot=2, left_command=5.0, right_command=5.0)
    odometry.react(0, driven)
    assert odometry.roll_out_end == 0


@pytest.mark.parametrize("kind", ["edges", "counts"])
def test_every_covariance_is_valid(kind):
    """Symmetric by construction; no negative variance, no correlation above one."""
    for _, _, pose, _ in drive(kind, 11):
        xx, xy, xh, yy, yh, hh = pose.covariance
        assert min(xx, yy, hh) >= 0.0
        for both, one, other in ((xy, xx, yy), (xh, xx, hh), (yh, yy, hh)):
            assert both * both <= one * other * (1 + 1e-9) + 1e-18


@pytest.mark.parametrize("kind", ["edges", "counts"])
@pytest.mark.parametrize("silent", [0.5, 5.0])
def test_after_a_gap_the_counts_give_the_travel(kind, silent):
    """The link fails while driving; the board stops after 300 ms and continues to count."""
    setup, odometry = block(kind)
    setup.robot.simulation.slip = 0.0
    for seed in range(4):
        odometry.reset()
        robot = SimulatedRobot(
            kind, plant_parameters(setup.robot), setup.robot.simulation, Random(seed)
        )
        now, pose = 0, None
        while now < (1.5 + silent + 0.3) * 1e9:
            if now <= 1.5e9 and now % (100 * MS) == 0:
                robot.command(now, Wheels(now, 8.0, 8.0))
            now += 5 * MS
            robot.advance(now)
            received = not 1.5e9 < now < (1.5 + silent) * 1e9
            for port, message in robot.deliver():
                if port == "encoders" and received:
                    pose, _ = odometry.react(now, message)
        truth = robot.truth().pose
        # Half a pitch of each wheel is not known: 5 mm along the way, and 0.08 rad.
        assert truth.x > 0.35 + 0.05
        assert abs(pose.x - truth.x) < 1.5 * PITCH
        assert abs(pose.heading - truth.heading) < 2.0 * PITCH / odometry.track
        sd = pose.covariance[5] ** 0.5
        assert abs(pose.heading - truth.heading) < 4.0 * sd


def queued(frames, rng):
    """The frames as a host reads them that stands still now and then: several with one time."""
    held, until = [], 0
    for frame in frames:
        if not held and rng.random() < 0.02:
            until = frame.time + rng.choice((50, 200, 430, 1000)) * MS
        if frame.time < until:
            held.append(frame)
            continue
        yield from (one._replace(time=frame.time) for one in held)
        held.clear()
        yield frame


@pytest.mark.parametrize("kind", ["edges", "counts"])
@pytest.mark.parametrize("seeds", by_day(1, [range(4), range(4, 20)]))
def test_frames_that_have_queued_up_have_one_time(kind, seeds):
    frames = [message for _, message, _, _ in drive(kind, 3)]
    for seed in seeds:
        _, odometry = block(kind)
        for frame in queued(frames, Random(seed)):
            pose, _ = odometry.react(frame.time, frame)
        assert abs(pose.x) < 1.5 and abs(pose.y) < 1.5
        assert all(-100.0 < part < 100.0 for part in pose.covariance)


@pytest.mark.parametrize("kind", ["edges", "counts"])
@pytest.mark.parametrize("period", [3, 9, 40])
def test_a_robot_that_is_pushed_may_have_moved_either_way(kind, period):
    """One channel does not show the direction: a push back is counted forward. `period`: frames
    from edge to edge."""
    tour = [*[(0.03, 0.9 * k, 0.9 * k) for k in range(1, 8)], (2.0, 6.5, 6.5), (2.0, 0.0, 0.0)]
    *_, (odometry, rested, before, _) = drive(kind, 1, tour=tour)
    assert sqrt(before.covariance[0]) < PITCH and not before.warning
    pushed = 12
    for frame in range(1, pushed * period + 1):
        edges, time = frame // period, rested.time + frame * 25 * MS
        edge = None if rested.left_edge is None or not edges else time
        frame_message = rested._replace(
            time=time,
            left=rested.left + edges,
            right=rested.right + edges,
            left_edge=edge or rested.left_edge,
            right_edge=edge or rested.right_edge,
        )
        pose, _ = odometry.react(time, frame_message)
    back = before.x - pushed * PITCH
    assert sqrt(pose.covariance[0]) > 0.4 * (pose.x - back) > 0.05
    assert "left and right wheel: turned by 12 edges without a command" in pose.warning
    assert "counted twice" not in pose.warning
    # 12 edges of each wheel the one way or the other, twice as far apart.
    assert pose.pushed_heading_sd == pytest.approx(2 * pushed * PITCH / odometry.track, rel=0.01)
    assert before.pushed_heading_sd == 0.0
    odometry.set_pose(0)
    pose, _ = odometry.react(0, frame_message._replace(time=frame_message.time + 25 * MS))
    assert "without a command" not in pose.warning and pose.pushed_heading_sd == 0.0


@pytest.mark.parametrize(("edges", "pitches"), [(1, 0.5), (2, sqrt(8.0)), (3, sqrt(18.0))])
def test_a_wheel_that_is_dragged_in_a_turn_about_it_may_have_turned_either_way(edges, pitches):
    """The right wheel turns for 4 s; the left one, without a command, gives an edge each second."""
    frames = [frame for _, frame, *_ in drive("edges", 1, tour=[(4.0, 0.0, 6.5), (1.0, 0.0, 0.0)])]
    poses = []
    for most in (0, edges):
        _, odometry = block("edges")
        dragged, at = 0, frames[0].time + SECOND
        for frame in frames:
            if dragged < most and frame.time >= at:
                dragged, at = dragged + 1, at + SECOND
                given = frame.time
            if dragged:
                frame = frame._replace(left=frame.left + dragged, left_edge=given)
            pose, _ = odometry.react(frame.time, frame)
        poses.append(pose)
    still, moved = poses
    track = odometry.track
    added = moved.covariance[5] - still.covariance[5]
    assert sqrt(added) * track == pytest.approx(pitches * PITCH, rel=0.15)
    assert ("left wheel: turned by" in moved.warning) is (edges > 1)
    assert not still.warning


def test_the_last_edges_of_a_robot_that_rolls_out_slowly_are_no_push():
    """Both wheels give two edges more, half a second apart, without a command."""
    *_, (odometry, rested, before, _) = drive("edges", 1, tour=[(2.0, 6.5, 6.5), (2.0, 0.0, 0.0)])
    for frame in range(1, 60):
        edges, time = min(frame // 20, 2), rested.time + frame * 25 * MS
        edge = rested.time + 20 * edges * 25 * MS
        counts = rested._replace(time=time, left=rested.left + edges, right=rested.right + edges)
        if edges:
            counts = counts._replace(left_edge=edge, right_edge=edge)
        pose, _ = odometry.react(time, counts)
    assert edges == 2 and not pose.warning and pose.pushed_heading_sd == 0.0
    assert pose.covariance[5] < before.covariance[5] + (0.5 * PITCH / odometry.track) ** 2


def test_an_encoder_that_loses_every_second_edge_is_reported_and_in_the_covariance():
    """From 2 s on the right wheel counts half; both motors turn as stated, at changing duties."""
    setup, odometry = block("counts")
    motor, period, change = setup.robot.drive.left.motor, 20 * MS, SECOND
    static, speed, place, half_from = motor.loop.static, 0.0, 0.0, None
    for now in range(0, 9 * SECOND, period):
        duty = 0.45 if now // change % 2 else 0.75
        settled = (duty - static) / (1.0 - static) * motor.rated * 20 / (2 * pi)  # pitches/s
        place += speed * period / SECOND
        speed += (settled - speed) * (1.0 - exp(-period / SECOND / motor.lag))
        left = int(place)
        if now >= 2 * SECOND and half_from is None:
            half_from = left
        right = left if half_from is None else half_from + (left - half_from) // 2
        since = now // change * change
        counts = Encoders(now, left, right, None, None, duty, duty, "duty", since, 1)
        pose, _ = odometry.react(now, counts)
    assert "right wheel: counts half" in pose.warning
    assert abs(pose.heading) < 3.0 * sqrt(pose.covariance[5])
