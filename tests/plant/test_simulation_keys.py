"""Each key of `simulation` has an effect on the robot, in the physically right direction."""

import itertools
from math import pi
from statistics import fmean, pstdev
from typing import get_args

import pytest

from diffbotctl.config.load import load
from diffbotctl.config.simulation import Simulation
from diffbotctl.messages import Encoders, Scan, Wheels
from diffbotctl.params import Section, declared
from diffbotctl.plant.simulated_robot import draw_robot
from diffbotctl.plant.world import build_world
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import SECOND
from tests.sampling import each_once
from tests.support.board_bench import UNO_ROBOT

FOUR_SENSORS = UNO_ROBOT.replace("uno.yaml", "four_sensors.yaml")
HALL_ROBOT = UNO_ROBOT.replace("uno.yaml", "mega_hall.yaml")
STEP = 2 * MS
SEEDS = range(6)


class Drive:
    """A plant driven with duties: `speeds` of both wheels at `times` (s), `edges` of the pins."""

    def __init__(self, plant):
        self.plant, self.times, self.speeds, self.edges = plant, [], [], []
        plant.capture(True)

    def run(self, seconds, left, right):
        """Drive with duties, or functions of the seconds since this call."""
        begin = self.plant.now
        while (elapsed := self.plant.now - begin) < seconds * SECOND:
            duties = [duty(elapsed / SECOND) if callable(duty) else duty for duty in (left, right)]
            self.edges += self.plant.advance_with_duties(self.plant.now + STEP, *duties)
            self.times.append(self.plant.now / SECOND)
            self.speeds.append(tuple(wheel.speed for wheel in self.plant.wheels))
        return self

    @property
    def final(self):
        return self.speeds[-1]

    def rising(self, side=0):
        """Times of rising edges, s."""
        return [edge.time / SECOND for edge in self.edges if edge.side == side and edge.level]

    def intervals(self):
        times = self.rising()[5:]
        return [later - earlier for earlier, later in itertools.pairwise(times)]


def straight(plant):
    return Drive(plant).run(2.0, 0.6, 0.6)


def final_speed(plant):
    return sum(straight(plant).final)


def rise(plant):
    """Seconds of each wheel to 63 % of its final speed."""
    drive = straight(plant)
    return [
        next(
            time
            for time, speeds in zip(drive.times, drive.speeds, strict=True)
            if speeds[side] > 0.63 * drive.final[side]
        )
        for side in (0, 1)
    ]


def rise_difference(plant):
    left, right = rise(plant)
    return abs(left - right)


def speed_difference(plant):
    left, right = straight(plant).final
    return abs(left - right) / (left + right)


def speed_ripple(plant):
    return pstdev(left for left, _ in straight(plant).speeds[400:])


def breakaway(plant):
    """The duty at which a wheel at rest begins to turn."""
    drive = Drive(plant).run(2.0, lambda t: 0.25 * t, 0.0)
    index = next(number for number, speeds in enumerate(drive.speeds) if speeds[0] > 0.0)
    return 0.25 * drive.times[index]


def keeping(plant):
    """The duty at which a turning wheel stops."""
    drive = Drive(plant).run(1.0, 0.6, 0.6)
    begin = len(drive.times)
    drive.run(6.0, lambda t: 0.6 - 0.1 * t, 0.6)
    index = next(n for n, speeds in enumerate(drive.speeds) if n > begin and speeds[0] < 0.2)
    return 0.6 - 0.1 * (drive.times[index] - drive.times[begin])


def coasting(plant):
    """Seconds until an undriven wheel stands."""
    drive = Drive(plant).run(1.0, 0.6, 0.6)
    begin = len(drive.times)
    drive.run(3.0, 0.0, 0.0)
    moving = [n for n, speeds in enumerate(drive.speeds) if n >= begin and speeds[0] > 0.05]
    return drive.times[moving[-1]] - drive.times[begin]


def lost_motion(plant):
    """What the shafts turn to and fro and the wheels do not, rad."""
    drive = Drive(plant).run(1.0, 0.6, 0.6)
    forward = plant.chassis.travel
    drive.run(1.5, -0.6, -0.6)
    turned = sum(abs(left) + abs(right) for left, right in drive.speeds) * STEP / SECOND / 2
    assert forward > 0.0
    return turned - plant.chassis.travel / plant.chassis.left_radius


def first_edges(plant):
    """Seconds between the first rising edges of both wheels."""
    drive = Drive(plant).run(1.0, 0.6, 0.6)
    return abs(drive.rising(0)[0] - drive.rising(1)[0])


def interval_spread(plant):
    return pstdev(straight(plant).intervals())


def open_share_error(plant):
    """Distance of the open share of the left disc from one half."""
    edges = [edge for edge in straight(plant).edges if edge.side == 0][20:]
    high = sum(after.time - edge.time for edge, after in itertools.pairwise(edges) if edge.level)
    return abs(high / (edges[-1].time - edges[0].time) - 0.5)


def changes_per_turn(plant):
    drive = straight(plant)
    return sum(edge.side == 0 for edge in drive.edges) / (plant.wheels[0].angle / (2 * pi))


def turn_error(plant):
    """Relative error of a turn in place by the file's geometry."""
    Drive(plant).run(2.0, -0.6, 0.6)
    left, right = (wheel.angle for wheel in plant.wheels)
    return abs(plant.chassis.heading / ((right - left) * 0.0325 / 0.125) - 1.0)


def way_error(plant):
    """Relative error of a distance by the file's geometry."""
    Drive(plant).run(3.0, 0.6, 0.6)
    angle = sum(wheel.angle for wheel in plant.wheels) / 2
    return abs(plant.chassis.travel / (angle * 0.0325) - 1.0)


def pin_voltage(plant):
    return plant.battery_pin_voltage()


def loaded_voltage(plant):
    Drive(plant).run(1.0, 1.0, 1.0)
    return plant.battery_voltage()


def front_volts(plant):
    Drive(plant).run(0.2, 0.0, 0.0)
    return [plant.sensor_volts()["front"] for _ in range(50)]


def volts_mean(plant):
    return fmean(front_volts(plant))


def volts_spread(plant):
    return pstdev(front_volts(plant))


def echo_spread(plant):
    return pstdev(plant.echo_us("front") for _ in range(50))


def messages(plant, kind, seconds=2.0, left=0.0, right=0.0):
    """What arrives of a simulated board that is commanded these speeds (rad/s)."""
    arrived = []
    for now in range(0, round(seconds * SECOND), 50 * MS):
        plant.advance(now)
        arrived += [message for _, message in plant.deliver() if isinstance(message, kind)]
        plant.command(now, Wheels(now, left, right))
    return arrived


def scan_spread(plant):
    scans = messages(plant, Scan)
    return pstdev(scan.distances[0] for scan in scans)


def turns(plant, *speeds):
    frames = messages(plant, Encoders, 2.0, *speeds)
    return [frame.turn for frame in frames]


def drift_at_rest(plant):
    return abs(turns(plant)[-1])


def turn_noise(plant):
    angles = turns(plant)
    return pstdev(later - earlier for earlier, later in itertools.pairwise(angles))


def turn_share_error(plant):
    return abs(turns(plant, -4.0, 4.0)[-1] / plant.truth().pose.heading - 1.0)


def turn_share(plant):
    return turns(plant, -4.0, 4.0)[-1] / plant.truth().pose.heading


def drift_in_acceleration(plant):
    return abs(turns(plant, 8.0, 8.0)[-1] - plant.truth().pose.heading)


def fault_time(plant):
    """Seconds until a frame reports a fault of the gyro; 9 when none does."""
    frames = messages(plant, Encoders, 3.0, -2.0, 2.0)
    return next((frame.time / SECOND for frame in frames if frame.turn_fault), 9.0)


def world_x(plant):
    return plant.pose_in_world().x


def world_y(plant):
    return plant.pose_in_world().y


def world_heading(plant):
    return plant.pose_in_world().heading


def left_wheel(plant):
    return Drive(plant).run(1.0, 0.6, 0.0).final[0]


def right_wheel(plant):
    return Drive(plant).run(1.0, 0.0, 0.6).final[1]


def left_edges(plant):
    return sum(edge.side == 0 for edge in Drive(plant).run(1.0, 0.6, 0.0).edges)


def right_edges(plant):
    return sum(edge.side == 1 for edge in Drive(plant).run(1.0, 0.0, 0.6).edges)


def counted_left(plant):
    return messages(plant, Encoders, 1.0, 5.0, 5.0)[-1].left


def counted_right(plant):
    return messages(plant, Encoders, 1.0, 5.0, 5.0)[-1].right


IMU = ("robot.imu.type=mpu6050", "robot.imu.axes=z")
QUIET_IMU = (
    *IMU,
    *(f"robot.simulation.gyro.{key}=0 rad/s" for key in ("bias", "drift", "noise")),
    "robot.simulation.gyro.scale_spread=0",
    "robot.simulation.gyro.tilt=0 deg",
)
BATTERY = ("robot.battery.pin=A1", "robot.battery.divider=3", "robot.battery.low=6.0 V")
WALL = ("world.walls=[{from: [0.3 m, -1 m], to: [0.3 m, 1 m]}]",)
EVEN = (
    "robot.simulation.motor.gain_spread=0",
    "robot.simulation.motor.lag_spread=0",
    "robot.simulation.motor.ripple=0",
    "robot.simulation.motor.start_duty=[0.1, 0.1]",
    "robot.simulation.encoder.slot_spread=0",
    "robot.simulation.encoder.jitter=0 us",
)
BOUNCE = ("robot.simulation.encoder.bounce=5 ms",)
NO_SLIP = ("robot.simulation.slip=0 mm",)
MORE, LESS = "more", "less"

# Key, what it is set to first and second, what is measured, what the second makes of it; base.
ROWS = [
    ("motor.lag", "[50 ms, 50 ms]", "[200 ms, 200 ms]", lambda p: sum(rise(p)), MORE, ()),
    ("motor.lag_spread", "0", "0.5", rise_difference, MORE, EVEN),
    ("motor.gain_spread", "0", "0.4", speed_difference, MORE, ()),
    ("motor.backlash", "0 deg", "20 deg", lost_motion, MORE, NO_SLIP),
    ("motor.start_duty", "[0.1, 0.1]", "[0.25, 0.25]", breakaway, MORE, ()),
    ("motor.keep_share", "0.4", "1", keeping, MORE, ()),
    ("motor.ripple", "0", "0.3", speed_ripple, MORE, ()),
    ("encoder.phase", "zero", "random", first_edges, MORE, EVEN),
    ("encoder.slot_spread", "0", "0.1", interval_spread, MORE, EVEN[:-2]),
    ("encoder.duty_spread", "0", "0.15", open_share_error, MORE, EVEN),
    ("encoder.jitter", "0 us", "1 ms", interval_spread, MORE, EVEN[:-1]),
    ("encoder.slots", "20", "26", changes_per_turn, MORE, ()),
    ("encoder.bounce", "0 ms", "5 ms", changes_per_turn, MORE, ()),
    ("encoder.bounce_share", "0.2", "1", changes_per_turn, MORE, BOUNCE),
    ("encoder.covered", "0", "5", changes_per_turn, LESS, ()),
    ("encoder.missed", "0", "0.3", changes_per_turn, LESS, ()),
    ("encoder.doubled", "0", "0.3", changes_per_turn, MORE, ()),
    ("geometry.track_spread", "0", "0.2", turn_error, MORE, NO_SLIP),
    ("geometry.diameter_spread", "0", "0.2", way_error, MORE, NO_SLIP),
    ("slip", "0 mm", "30 mm", way_error, MORE, ()),
    ("battery.volts", "4.0 V", "7.6 V", final_speed, MORE, ()),
    ("battery.volts", "4.0 V", "7.6 V", pin_voltage, MORE, BATTERY),
    ("battery.divider_error", "0", "0.2", pin_voltage, LESS, BATTERY),
    ("battery.sag", "0", "0.4", final_speed, LESS, ()),
    ("battery.sag", "0", "0.4", loaded_voltage, LESS, BATTERY),
    ("sensors.front.noise", "0 mV", "60 mV", volts_spread, MORE, WALL),
    ("sensors.front.offset", "0 V", "0.2 V", volts_mean, MORE, WALL),
    ("gyro.scale_spread", "0", "0.1", turn_share_error, MORE, QUIET_IMU),
    ("gyro.noise", "0 rad/s", "0.01 rad/s", turn_noise, MORE, IMU),
    ("gyro.bias", "0 rad/s", "0.3 rad/s", drift_at_rest, MORE, QUIET_IMU),
    ("gyro.drift", "0 rad/s", "0.1 rad/s", drift_at_rest, MORE, QUIET_IMU),
    ("gyro.tilt", "0 deg", "28 deg", turn_share, LESS, QUIET_IMU),
    ("gyro.axes", "z", "-z", fault_time, LESS, IMU),  # gravity shows it
    ("gyro.acceleration_effect", "0 rad/s", "0.01 rad/s", drift_in_acceleration, MORE, QUIET_IMU),
    ("start.x", "0 m", "0.2 m", world_x, MORE, ()),
    ("start.y", "0 m", "0.2 m", world_y, MORE, ()),
    ("start.heading", "0 deg", "30 deg", world_heading, MORE, ()),
    # The book's left motor is soldered the other way round, which its robot file undoes.
    ("wiring.left", "reversed", "plain", left_wheel, LESS, ()),
    ("wiring.left", "reversed", "swapped", left_wheel, LESS, ()),
    ("wiring.left", "reversed", "dead", left_wheel, LESS, ()),
    ("wiring.left", "reversed", "floating", left_edges, MORE, ()),
    ("wiring.right", "plain", "reversed", right_wheel, LESS, ()),
    ("wiring.right", "plain", "swapped", right_wheel, LESS, ()),
    ("wiring.right", "plain", "dead", right_wheel, LESS, ()),
    ("wiring.right", "plain", "floating", right_edges, MORE, ()),
    ("wiring.encoders", "plain", "swapped", left_edges, LESS, ()),
    ("wiring.left_encoder", "plain", "dead", left_edges, LESS, ()),
    ("wiring.left_encoder", "plain", "floating", left_edges, MORE, ()),
    ("wiring.right_encoder", "plain", "dead", right_edges, LESS, ()),
    ("wiring.right_encoder", "plain", "floating", right_edges, MORE, ()),
]  # fmt: skip
OTHER_ROBOTS = [
    ("turtlebot3_burger", "sensors.scan.spread", "0 m", "0.05 m", scan_spread, MORE, WALL),
    (FOUR_SENSORS, "sensors.front.echo_spread", "0 mm", "50 mm", echo_spread, MORE, WALL),
    (HALL_ROBOT, "wiring.left_encoder", "plain", "exchanged", counted_left, LESS, ()),
    (HALL_ROBOT, "wiring.right_encoder", "plain", "exchanged", counted_right, LESS, ()),
]
# With torques there is always dry friction, which stops a wheel without drive in finite time.
ONLY_EXPONENTIAL = ("motor.coasting", "linear", "coulomb", coasting, LESS, ())


def plants(robot, key, value, base, equations):
    sets = [*base, f"robot.simulation.{key}={value}", "robot.drive.polarity=checked_by_hand"]
    if equations:
        sets.append(f"robot.simulation.equations={equations}")
    if robot == FOUR_SENSORS:
        sets.append("guard.stale_after=0.25 s")
    configuration = load("goal", robot, sets)
    world = build_world(configuration.world)
    return [draw_robot(configuration.robot, configuration.nominal, seed, world) for seed in SEEDS]


def declared_keys(section, prefix=""):
    """All keys of a section and of those in it. A sensor is `sensors.front`."""
    for name, declaration in declared(section).items():
        inner = [
            kind for kind in (declaration.kind, *get_args(declaration.kind)) if is_section(kind)
        ]
        if inner:
            name = f"{name}.front" if name == "sensors" else name
            yield from declared_keys(inner[0], f"{prefix}{name}.")
        else:
            yield prefix + name


def is_section(kind):
    return isinstance(kind, type) and issubclass(kind, Section)


def test_the_table_has_every_key():
    keys = {key for key, *_ in (*ROWS, ONLY_EXPONENTIAL)}
    keys |= {row[1].replace("scan", "front") for row in OTHER_ROBOTS}
    declared = {key for key in declared_keys(Simulation) if not key.startswith("faults.")}
    assert keys | {"equations", "plant"} == declared  # test_faults.py has a table of the faults


def check(robot, equations, key, first, second, measure, relation, base):
    values = [
        sum(map(measure, plants(robot, key, value, base, equations))) for value in (first, second)
    ]
    difference = values[1] - values[0]
    least = 0.02 * max(map(abs, values))
    assert (difference if relation == MORE else -difference) > least, values


@each_once(row=ROWS, equations=["exponential", "torque"])
def test_the_effect_of_a_key(row, equations):
    check("book_2wd", equations, *row)


@pytest.mark.parametrize(
    ("robot", "key", "first", "second", "measure", "relation", "base"),
    OTHER_ROBOTS,
    ids=[f"{key}={second}" for _, key, _, second, *_ in OTHER_ROBOTS],
)
def test_the_effect_of_a_key_on_robots_with_other_parts(
    robot, key, first, second, measure, relation, base
):
    check(robot, None, key, first, second, measure, relation, base)


def test_the_effect_of_coasting():
    check("book_2wd", "exponential", *ONLY_EXPONENTIAL)


def test_both_equations_differ():
    speeds = [
        [straight(plant).speeds for plant in plants("book_2wd", "slip", "0 mm", (), equations)]
        for equations in ("exponential", "torque")
    ]
    assert speeds[0] != speeds[1]
