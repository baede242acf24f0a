"""A measured disc is identified after power-on; another disc is rejected."""

from math import exp, pi
from random import Random
from statistics import fmean

import pytest

from diffbotctl.config.load import load
from diffbotctl.control.motor_curve import settled_speed
from diffbotctl.estimation.slot_errors import EdgeErrors, SlotEstimate
from diffbotctl.estimation.wheel_filter import WheelFilter
from diffbotctl.estimation.wheel_frame import WheelFrame
from diffbotctl.estimation.wheel_side import Priors
from diffbotctl.messages import Wheels
from diffbotctl.plant.robot_parameters import plant_parameters
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.wheel import EncoderDisc, WheelModel
from tests.sampling import by_day

MS = 1_000_000
SLOTS = 20
PITCH = 2 * pi / SLOTS  # rad
SPEED = 8.0  # rad/s


def errors(disc: EncoderDisc, first: int) -> list[float]:
    """Errors (pitches, mean removed) of the edges seen forward (0) or backward (1)."""
    places = [edge / PITCH - slot for slot, edge in enumerate(disc.edges[first::2])]
    return [place - fmean(places) for place in places]


def drive(seed: int, direction: float, turned: float, known) -> tuple:
    """Turn both wheels in `direction` (1 or -1) for 1 s, their discs rotated by `turned` (rad).

    `known`: the disc that the robot file states for a robot's side, from its true one.
    """
    setup = load("goal", "book_2wd")
    robot = SimulatedRobot(
        "edges", plant_parameters(setup.robot), setup.robot.simulation, Random(seed)
    )
    drive = setup.robot.drive
    for side, disc in zip((drive.left, drive.right), robot.discs, strict=True):
        side.encoder.slot_errors = errors(known(disc), 0)
        side.encoder.back_errors = errors(known(disc), 1)
    robot.drive.wheels = tuple(
        WheelModel(wheel.motor, disc._replace(start=turned), Random(seed))
        for wheel, disc in zip(robot.wheels, robot.discs, strict=True)
    )
    use = next(use for use in setup.blocks if use.name == "odometry")
    odometry = use.cls(**use.values)
    odometry.reset()
    for step in range(1, 41):
        now = step * 50 * MS
        speed = direction * SPEED * min(1.0, step / 6) * (step < 26)
        robot.command(now, Wheels(now, speed, speed))
        robot.advance(now)
        for port, message in robot.deliver():
            if port == "encoders":
                odometry.react(now, message)
    return odometry, robot


@pytest.mark.parametrize("seed", by_day(2, range(6)))
def test_slots_are_identified_in_every_rotation(seed):
    """The first edge is the next one after the initial position of the disc."""
    turned = 0.5 + seed
    odometry, robot = drive(seed, 1.0, turned, lambda disc: disc)
    for wheel, disc in zip(odometry.wheels, robot.discs, strict=True):
        assert wheel.filter.alignment is None
        true, learnt = errors(disc, 0), wheel.filter.motion.disc.errors[:SLOTS]
        # z begins between slots 0 and 1, the disc between those about `turned`
        fits = [
            sum((true[(first + slot) % SLOTS] - learnt[slot]) ** 2 for slot in range(SLOTS))
            for first in range(SLOTS)
        ]
        best = min(range(SLOTS), key=lambda first: fits[first])
        assert abs((best - turned / PITCH + SLOTS / 2) % SLOTS - SLOTS / 2) <= 1.2
        assert (fits[best] / SLOTS) ** 0.5 < 0.012, "unlearnt they scatter by 0.03"


def test_the_disc_is_identified_going_backward():
    odometry, robot = drive(3, -1.0, 2.0, lambda disc: disc)
    for wheel, disc in zip(odometry.wheels, robot.discs, strict=True):
        assert wheel.filter.alignment is None
        assert sorted(wheel.filter.motion.disc.backward_errors) == pytest.approx(
            sorted(errors(disc, 1))
        )


@pytest.mark.parametrize("seed", by_day(2, range(4)))
def test_another_disc_is_rejected(seed):
    """All slot errors with the opposite sign: no rotation fits."""

    def mirrored(disc: EncoderDisc) -> EncoderDisc:
        turned = tuple(
            2 * (place // 2 * PITCH + place % 2 * 0.5 * PITCH) - edge
            for place, edge in enumerate(disc.edges)
        )
        return disc._replace(edges=turned)

    odometry, _ = drive(seed, 1.0, 1.0, mirrored)
    for wheel in odometry.wheels:
        assert not any(wheel.filter.motion.disc.backward_errors)


def test_what_was_counted_before_stays_open():
    """Of a wheel that may have passed one edge more before, the pattern shows only which slot is
    under the barrier now."""
    rng = Random(4)
    pattern = [rng.gauss(0.0, 0.04) for _ in range(SLOTS)]
    priors = Priors(has_edge_times=True)
    known = EdgeErrors(pattern, (), SlotEstimate(0.0, 1e-4), priors.slot)
    wheel = WheelFilter(priors, 0, 0, SLOTS, known)
    drive = settled_speed(1.0, 0.1, 10.0) * SLOTS / (2 * pi)  # pitches/s
    lag, first_slot = priors.lag, 7
    place = 0.5  # pitches, of slot 0
    edges = []  # times (s)
    for slot in range(1, 41):
        target = slot + pattern[(slot + first_slot) % SLOTS]
        low, high = 0.0, 3.0
        while high - low > 1e-9:  # z = 0.5 + drive * (t - lag (1 - exp(-t / lag)))
            time = 0.5 * (low + high)
            is_late = place + drive * (time - lag * (1.0 - exp(-time / lag))) > target
            low, high = (low, time) if is_late else (time, high)
        edges.append(low)
    is_doubted = False
    for frame in range(1, 60):
        passed = [time for time in edges if time <= frame * 0.02]
        edge_time = round(passed[-1] * 1e9) if passed else None
        wheel.update(WheelFrame(frame * 20 * MS, len(passed), edge_time, drive, 0, 1.0))
        if wheel.alignment is None and passed:
            break
        if len(passed) == 2 and not is_doubted:
            is_doubted = True
            branches = [hypothesis.copy() for hypothesis in wheel.hypotheses]
            for branch in branches:
                branch.edge_slot += 1
                branch.motion.z += 1.0
            wheel.hypotheses += branches
    assert is_doubted and wheel.alignment is None, "the rotation has not been found"
    best = wheel.motion
    others = [
        each.motion for each in wheel.hypotheses if abs(each.motion.travel - best.travel) > 0.5
    ]
    assert others, "the other count was dropped without a reason"
    here, there = (
        wheel.hypotheses[0],
        next(each for each in wheel.hypotheses if each.motion is others[0]),
    )
    assert abs(here.edge_slot - there.edge_slot) == 1
    differences = [
        here.motion.disc.errors[(here.edge_slot + ahead) % SLOTS]
        - there.motion.disc.errors[(there.edge_slot + ahead) % SLOTS]
        for ahead in range(SLOTS)
    ]
    assert fmean(each * each for each in differences) ** 0.5 < 0.015, "others differ by 0.05"
