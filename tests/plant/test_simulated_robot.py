"""The whole simulated robot: equal runs for equal seeds, wiring, frames, sensors."""

from math import pi
from random import Random

import pytest

from diffbotctl.config.simulation import MotorTruth, SensorTruth, Simulation, WiringTruth
from diffbotctl.control.speed_loop import SpeedGains
from diffbotctl.messages import Duty, Encoders, Volts, Wheels
from diffbotctl.plant.range_sensors import RESIDUAL_VOLTS, volts
from diffbotctl.plant.robot_parameters import MountedSensor, PlantParameters
from diffbotctl.plant.simulated_robot import SimulatedRobot
from diffbotctl.plant.world import Wall, World
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND

FRAME = round(SECOND / 38)
GAINS = SpeedGains(0.1, 0.0859, 0.0, 0.02)
MACHINE = PlantParameters(
    track=0.125,
    left_diameter=0.065,
    right_diameter=0.065,
    rated=(10 * pi / 3, 10 * pi / 3),
    counts=(20, 20),
    glitch=2 * MS,
    deadman=300 * MS,
    gains=(GAINS, GAINS),
)


def robot(kind="edges", seed=1, world=None, wiring=None, machine=None, **errors):
    simulation = Simulation(wiring=WiringTruth(**(wiring or {})), **errors)
    return SimulatedRobot(
        kind, MACHINE._replace(**(machine or {})), simulation, Random(seed), world
    )


def driven(made, seconds, left, right, kind=Wheels):
    """Send the same command every 25 ms; returns all messages."""
    received = []
    for now in range(0, int(seconds * SECOND), FRAME):
        made.advance(now)
        received += made.deliver()
        made.command(now, kind(now, left, right))
    made.advance(int(seconds * SECOND))
    return received + made.deliver()


@pytest.mark.parametrize("kind, command", [("edges", Wheels), ("counts", Wheels), ("stock", Duty)])
def test_the_same_seed_is_the_same_run(kind, command):
    a, b, other = (robot(kind, seed) for seed in (7, 7, 8))
    runs = [driven(made, 3.0, 0.6, 0.5, command) for made in (a, b, other)]
    assert runs[0] == runs[1] and a.truth() == b.truth()
    assert runs[0] != runs[2] and a.truth() != other.truth()


def test_the_step_size_changes_nothing():
    once, often = robot(), robot()
    for made in (once, often):
        made.command(0, Wheels(0, 5.0, 4.0))
    once.advance(SECOND // 4)
    for now in range(MS, SECOND // 4 + 1, MS):
        often.advance(now)
    assert once.deliver() == often.deliver()
    assert once.truth() == often.truth()


@pytest.mark.parametrize(
    "wiring, reverse, command, turns",  # sign of each wheel's turning
    [
        ({}, (False, False), (5.0, 5.0), (1, 1)),
        ({}, (False, False), (-5.0, 5.0), (-1, 1)),
        ({"left": "dead"}, (False, False), (5.0, 5.0), (0, 1)),
        ({"right": "dead"}, (False, False), (5.0, 5.0), (1, 0)),
        ({"left": "reversed"}, (False, False), (5.0, 5.0), (-1, 1)),
        ({"left": "reversed"}, (True, False), (5.0, 5.0), (1, 1)),  # the robot file undoes it
        ({}, (False, True), (5.0, 5.0), (1, -1)),
        ({"left": "swapped", "right": "swapped"}, (False, False), (5.0, 0.0), (0, 1)),
        ({"left": "swapped", "right": "swapped"}, (False, False), (0.0, -5.0), (-1, 0)),
        ({"left": "floating"}, (False, False), (5.0, 5.0), (1, 1)),
    ],
)
def test_wiring(wiring, reverse, command, turns):
    made = robot(wiring=wiring, machine={"reversed": reverse})
    driven(made, 0.4, *command)  # before a stall of a wheel without edges is noticed
    truth = made.truth()
    assert [(a > 0) - (a < 0) for a in (truth.left_angle, truth.right_angle)] == list(turns)


def counted(made, seconds, left, right, kind=Wheels):
    """Counts of the left and right socket, without their signs."""
    last = [m for port, m in driven(made, seconds, left, right, kind) if port == "encoders"][-1]
    return abs(last.left), abs(last.right)


def test_a_floating_wire_picks_up_the_mains_independent_of_the_wheel():
    resting = counted(robot(wiring={"left": "floating"}), 1.0, 0.0, 0.0)
    # 50 Hz for 0.95 s, the time of the last frame that has arrived; its trembling adds up
    assert resting == (pytest.approx(47, abs=3), 0)


@pytest.mark.parametrize(
    "wiring, command, counting",
    [
        ({"left_encoder": "dead"}, (5.0, 5.0), (False, True)),
        ({"right_encoder": "dead"}, (5.0, 5.0), (True, False)),
        ({"encoders": "swapped"}, (5.0, 0.0), (False, True)),
        ({"encoders": "swapped"}, (0.0, 5.0), (True, False)),
        # the left wheel's encoder is dead, and sits in the right one's socket
        ({"encoders": "swapped", "left_encoder": "dead"}, (5.0, 5.0), (True, False)),
    ],
)
def test_wiring_of_the_encoders(wiring, command, counting):
    counts = counted(robot(wiring=wiring), 0.4, *command)
    assert tuple(count > 2 for count in counts) == counting


@pytest.mark.parametrize("wiring", [{}, {"encoders": "swapped"}])
def test_frames_have_duties_and_levels_of_the_pins_in_turn(wiring):
    made = robot(wiring=wiring)
    sampled = []
    for step in range(1, 81):
        now = step * FRAME
        made.command(now - FRAME, Wheels(now, 3.0, 5.0))
        made.advance(now)
        sockets = {edge.side: edge.level for edge in made.encoder_levels()}
        duties = tuple(side.duty for side in made.board.sides)
        sampled.append((sockets[0], sockets[1], *duties))
    made.advance(3 * SECOND)
    sent = [m for port, m in made.deliver() if port == "encoders"][: len(sampled)]
    assert len(sent) == len(sampled)
    for number, (frame, each) in enumerate(zip(sent, sampled, strict=True)):
        left, right, left_duty, right_duty = each
        shown = frame.left_level, frame.right_level, frame.left_duty, frame.right_duty
        duty = pytest.approx(right_duty if number % 2 else left_duty, abs=0.5001 / 127)
        assert shown == ((None, right, None, duty) if number % 2 else (left, None, duty, None))
    assert {each[0] for each in sampled} == {each[1] for each in sampled} == {0, 1}
    assert max(each[2] for each in sampled) > 0.3


@pytest.mark.parametrize("kind", ["stock", "edges"])
def test_the_published_firmware_sends_neither_levels_nor_duties(kind):
    made = robot(kind)
    made.advance(SECOND)
    frames = [m for port, m in made.deliver() if port == "encoders"]
    shown = [
        (frame.left_level, frame.right_level, frame.left_duty, frame.right_duty) for frame in frames
    ]
    missing = {each.count(None) for each in shown}
    assert len(shown) > 10 and missing == {4 if kind == "stock" else 2}


def test_exchanged_pins_in_the_settings_undo_exchanged_wires():
    wiring = {"left": "swapped", "right": "swapped", "encoders": "swapped"}
    reported = {"channels": (1, 0), "sockets": (1, 0)}
    made = robot(wiring=wiring, machine=reported)
    counts = counted(made, 0.4, 5.0, 0.0)
    truth = made.truth()
    assert counts[0] > 2 and counts[1] == 0
    assert truth.left_angle > 0.0 and truth.right_angle == 0.0


def test_a_wheel_is_turned_by_hand_through_an_angle():
    made = robot()
    end = made.turn_by_hand(0, 4 * pi, 2 * pi)
    assert end == 2 * SECOND  # two turns at one a second
    made.advance(3 * SECOND)
    assert made.truth().left_angle == pytest.approx(4 * pi) and made.truth().right_angle == 0.0
    assert made.truth().left_speed == 0.0
    assert made.board.sample(3 * SECOND).left == 40


@pytest.mark.parametrize(
    "wiring, sides",
    [
        ({}, {0}),
        ({"encoders": "swapped"}, {1}),
        ({"left_encoder": "dead"}, set()),
        ({"right_encoder": "floating"}, {0, 1}),  # it hums, though only the left wheel turns
    ],
)
def test_captured_edges_are_those_at_the_board_s_pins(wiring, sides):
    made = robot(wiring=wiring)
    made.capture(True)
    made.turn_by_hand(0, 2 * pi, 2 * pi)
    made.advance(SECOND + SECOND // 10)
    assert {flank.side for flank in made.captured_edges} == sides
    turned = [flank for flank in made.captured_edges if flank.side == min(sides, default=0)]
    if "left_encoder" not in wiring:
        assert len(turned) == pytest.approx(40, abs=1)  # both flanks of 20 slots
    made.capture(False)
    reported = len(made.captured_edges)
    made.turn_by_hand(0, 2 * pi, 2 * pi)
    made.advance(3 * SECOND)
    assert len(made.captured_edges) == reported


def test_our_firmware_also_takes_raw_duty():
    made = robot()
    received = driven(made, 3.0, 0.5, -0.5, Duty)
    motor, truth = made.motors[0], made.truth()
    # At half duty the battery sags by 2 %; the ripple moves the speed by its 2 %.
    settled = motor.speed * (0.49 - motor.keep) / (1 - motor.keep)
    assert truth.left_speed == pytest.approx(settled, rel=0.05) and truth.right_speed < -4.0
    last = [m for port, m in received if port == "encoders"][-1]
    assert last.command_kind == "duty" and last.left > 0 > last.right


def test_a_restarted_board_counts_from_zero_with_a_new_boot_number():
    made = robot()
    driven(made, 1.0, 5.0, 5.0)
    made.restart_board(made.parameters._replace(counts=(30, 30)))
    made.advance(2 * SECOND)
    last = made.deliver()[-1][1]
    assert last.boot == 1
    assert abs(last.left) < 3 and abs(last.right) < 3  # 15 each before; the wheels roll out


def test_counts_agree_with_the_angle_turned():
    made = robot()
    driven(made, 3.0, 6.0, 6.0)
    frame = made.board.sample(3 * SECOND)
    truth = made.truth()
    # A count short or over at either end, and a fifth of a pitch of irregular slots.
    assert frame.left == pytest.approx(truth.left_angle * 20 / (2 * pi), abs=1.25)
    assert frame.right == pytest.approx(truth.right_angle * 20 / (2 * pi), abs=1.25)


def test_frames_come_on_time():
    received = [m for port, m in driven(robot(), 1.0, 5.0, 5.0) if port == "encoders"]
    # Sampled each 26.3 ms, at the host 27.4 ms later: those up to 972.6 ms have come.
    assert [m.time for m in received] == [FRAME * k for k in range(1, 37)]
    assert all(isinstance(m, Encoders) for m in received)


def test_due_is_when_a_message_comes():
    made = robot()
    assert made.due() == FRAME + 27_400_000
    made.advance(made.due() - 1)
    assert made.deliver() == []
    made.advance(made.due())
    assert len(made.deliver()) == 1


def test_the_robot_stops_300_ms_after_the_last_command():
    made = robot()
    made.command(0, Wheels(0, 5.0, 5.0))
    made.advance(SECOND)  # by then it has coasted out
    assert made.truth().left_speed == 0.0 and made.truth().left_angle > 0.3
    still = made.truth()._replace(time=0)
    made.advance(5 * SECOND)
    assert made.truth()._replace(time=0) == still


def test_the_sensor_measures_an_approaching_wall():
    # Sensor 80 mm before the axle, the wall at 0.38 m: 0.30 m at the start.
    sight = {
        "world": World([Wall(0.38, -1.0, 0.38, 1.0)]),
        "machine": {"sensors": (MountedSensor("front", 0.08),)},
        "sensors": {"front": SensorTruth(noise=0.0)},
    }
    made = robot(**sight)
    received = driven(made, 1.0, 5.0, 5.0)
    seen = [m for port, m in received if port == "front"]
    assert all(isinstance(m, Volts) for m in seen)
    assert seen[2].volts == pytest.approx(volts(0.30), abs=0.02)
    # The last frame was sampled at 950 ms, of a measurement at most 21.5 ms older.
    gap = 0.30 - made.truth().pose.x
    assert volts(gap + 0.016) < seen[-1].volts < volts(gap)


def test_a_sensor_in_an_empty_world_measures_nothing():
    made = robot(
        machine={"sensors": (MountedSensor("front", 0.08),)},
        sensors={"front": SensorTruth(noise=0.0)},
    )
    received = driven(made, 0.5, 5.0, 5.0)
    assert {m.volts for port, m in received if port == "front"} == {RESIDUAL_VOLTS}


@pytest.mark.parametrize(
    "left, right, supply",  # 4 % of the voltage are lost when both motors take all
    [(1.0, 1.0, 0.96), (1.0, 0.0, 0.98), (1.0, -1.0, 0.96), (0.5, 0.5, 0.98)],
)
def test_the_battery_voltage_drops_with_the_load(left, right, supply):
    made = robot("stock", motor=MotorTruth(ripple=0.0))
    driven(made, 4.0, left, right, Duty)
    motor = made.motors[0]
    settled = motor.speed * (supply * left - motor.keep) / (1 - motor.keep)
    assert made.truth().left_speed == pytest.approx(settled, rel=1e-6)


def test_drawn_motors_stay_within_their_spread():
    for seed in range(50):
        made = robot(seed=seed)
        for motor in made.motors:
            assert 0.9 * MACHINE.rated[0] <= motor.speed <= 1.1 * MACHINE.rated[0]
            assert 0.060 * 0.95 <= motor.lag <= 0.150 * 1.05
            assert 0.08 <= motor.start <= 0.16
            assert motor.keep == pytest.approx(0.8 * motor.start)


def test_each_motor_has_its_own_rated_speed():
    unlike = (10.0, 7.0)
    truth = MotorTruth(gain_spread=0.0)
    made = robot(machine={"rated": unlike}, motor=truth)
    assert tuple(motor.speed for motor in made.motors) == unlike
