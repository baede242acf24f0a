"""Messages of the socket as fields of ROS messages: tables worked by hand."""

from math import inf, isnan, pi, radians, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.config.load import load
from diffbotctl.ros2 import conversion
from diffbotctl.ros2.conversion import SensorModel
from diffbotctl.ros2.options import BridgeOptions, decode_options, encode_options
from diffbotctl.ros2.robot_model import model_of, model_of_run
from diffbotctl.ros2.stamps import WINDOW, WINDOWS_MAX, StampClock, stamp_complaint
from diffbotctl.time import SECOND

FRONT = SensorModel("front_sensor_link", 0.042, 0.3)


def odometry(**changes):
    covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    fields = {"x": 1.0, "y": 2.0, "heading": pi / 2, "linear": 0.1, "angular": -0.2}
    return {"time": 5, **fields, "covariance": covariance, **changes}


def test_odometry_has_its_covariance_where_ros_reads_x_y_and_yaw():
    fields = conversion.odometry(odometry())
    pose, twist = fields["pose"], fields["twist"]["twist"]
    half = sqrt(0.5)
    assert pose["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": half, "w": half})
    rows = [pose["covariance"][6 * row : 6 * row + 6] for row in range(6)]
    assert rows[0] == [1.0, 2.0, 0, 0, 0, 3.0]
    assert rows[1] == [2.0, 4.0, 0, 0, 0, 5.0]
    assert rows[5] == [3.0, 5.0, 0, 0, 0, 6.0]
    assert [rows[index][index] for index in (2, 3, 4)] == [1e6] * 3
    assert twist == {"linear": {"x": 0.1}, "angular": {"z": -0.2}}


@given(st.floats(-3.14, 3.14), st.floats(0.1, 10.0))
def test_a_heading_survives_the_way_to_a_quaternion_and_back(heading, length):
    turn = {name: value * length for name, value in conversion.quaternion(heading).items()}
    assert conversion.heading_of(**turn) == pytest.approx(heading, abs=1e-9)


@pytest.mark.parametrize(
    ("state", "distance", "expected"),
    [("measured", 0.12, 0.12), ("clear", 0.3, inf), ("too_close", 0.0, -inf)],
)
def test_a_range_follows_rep_117(state, distance, expected):
    fields = conversion.range_fields({"state": state, "distance": distance}, FRONT)
    assert (fields["range"], fields["min_range"], fields["max_range"]) == (expected, 0.042, 0.3)


def test_a_faulty_range_is_no_number():
    fields = conversion.range_fields({"state": "fault", "distance": 0.0}, FRONT)
    assert isnan(fields["range"])


def test_a_scan_of_four_rays():
    sensor = SensorModel("lidar_sensor_link", 0.12, 3.5)
    message = {"start": 0.0, "step": -pi / 2, "distances": [1.0, "inf", 0.0, 2.0]}
    message |= {"duration": 0.2}
    fields = conversion.scan(message, sensor)
    assert fields["ranges"] == [1.0, inf, 0.0, 2.0]
    assert fields["angle_increment"] == pytest.approx(-pi / 2)  # a lidar turns clockwise
    assert fields["angle_max"] == pytest.approx(-1.5 * pi)
    assert (fields["scan_time"], fields["time_increment"]) == (0.2, 0.05)
    assert conversion.scan_age(message) == 200_000_000


def inertial(**changes):
    fields = {"state": "working", "rate": 0.5, "bias": 0.1, "bias_sd": 0.001, "calibrated": True}
    return {"time": 5, **fields, "cause": "", **changes}


def test_an_imu_has_its_turn_rate_and_marks_what_it_does_not_measure():
    fields = conversion.imu(inertial())
    covariance = fields["angular_velocity_covariance"]
    assert fields["angular_velocity"] == {"z": 0.5}
    assert (covariance[0], covariance[4]) == (1e6, 1e6)  # it has one axis
    # 1 mrad/s of the bias, 0.3 % of the rate, and the noise of a frame: below 0.5 deg/s together.
    assert 0.001**2 + (0.003 * 0.5) ** 2 < covariance[8] < radians(0.5) ** 2
    for quantity in ("orientation", "linear_acceleration"):
        assert fields[f"{quantity}_covariance"] == [-1.0, 0, 0, 0, 0, 0, 0, 0, 0]


def test_a_scale_that_was_not_calibrated_makes_a_turn_less_certain():
    plain, calibrated = (
        conversion.imu(inertial(rate=2.0, calibrated=known))["angular_velocity_covariance"][8]
        for known in (False, True)
    )
    assert plain - calibrated == pytest.approx(4.0 * (0.03**2 - 0.003**2))


@pytest.mark.parametrize("state", ["zeroing", "failed"])
def test_an_imu_that_is_not_used_measures_nothing(state):
    fields = conversion.imu(inertial(state=state, rate=0.0))
    assert fields["angular_velocity_covariance"][0] == -1.0


def test_counts_become_angles_of_the_wheels():
    assert conversion.wheel_angles({"left": 20, "right": -5}, (20.0, 20.0)) == pytest.approx(
        (2 * pi, -pi / 2)
    )


def test_diagnostics_name_a_stop_and_its_cause():
    stop = {"time": 1, "code": "obstacle", "cause": "10 cm ahead", "latched": False}
    entries = conversion.diagnostics({"guard.stop": ("Stop", stop), "x": ("Twist", {})})
    assert [(e.name, e.level, e.message) for e in entries] == [
        ("guard.stop", conversion.WARN, "10 cm ahead")
    ]
    (entry,) = conversion.diagnostics({"gate.stop": ("Stop", {**stop, "latched": True})})
    assert entry.level == conversion.ERROR
    (entry,) = conversion.diagnostics({"gate.stop": ("Stop", {**stop, "code": ""})})
    assert (entry.level, entry.message) == (conversion.OK, "may move")


def test_stamps_follow_the_least_delay_and_later_a_drift():
    clock = StampClock()
    assert clock.stamp(0, 1000) == 1000
    assert clock.stamp(500, 1400) == 1400  # 100 ns less delay
    assert clock.stamp(600, 1999) == 1500
    for number in range(1, WINDOWS_MAX + 1):  # both clocks drift apart by 50 ns in all
        now = 1400 + number * WINDOW
        stamp = clock.stamp(now - 950, now)
    assert stamp == now


def test_stamps_are_exact_with_an_epoch():
    assert StampClock(7 * SECOND).stamp(3 * SECOND, 99 * SECOND) == 10 * SECOND


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (0, ""),
        (100 * SECOND, ""),
        (99 * SECOND + SECOND // 2, ""),
        (99 * SECOND, "1.0 s old"),
        (102 * SECOND, "in the future"),
    ],
)
def test_an_old_velocity_must_not_drive(stamp, words):
    complaint = stamp_complaint(stamp, 100 * SECOND)
    assert words in complaint and bool(words) == bool(complaint)


def test_the_model_of_a_robot_survives_the_way_to_the_bridge():
    model = model_of(load("standby", "book_2wd"))
    options = BridgeOptions("goal", "/a.socket", True, "left", "left/", model)
    assert decode_options(encode_options(options)) == options
    assert model.counts_per_turn == (20.0, 20.0)
    assert model.sensors["range.range"].frame == "front_sensor_link"
    assert [frame.name for frame in model.frames if frame.moves == "wheel"] == [
        "left_wheel_link",
        "right_wheel_link",
    ]


def test_a_robot_whose_files_are_elsewhere_has_no_description_and_this_is_reported():
    status = {"pid": 1, "pipeline": "/nowhere/a.yaml", "robot": "/nowhere/b.yaml"}
    model, complaint = model_of_run(status, None)
    assert model.urdf == "" and "no robot description" in complaint


@pytest.mark.parametrize("known", [[0.0] * 6, [1e-4, 0.0, 0.0, 2e-4, 0.0, 3e-4]])
def test_no_variance_of_odometry_is_zero(known):
    """The rule of robot_localization: a measurement with a variance of zero is not usable."""
    fields = conversion.odometry(odometry(covariance=known))
    for part in ("pose", "twist"):
        covariance = fields[part]["covariance"]
        assert len(covariance) == 36 and all(covariance[i * 7] > 0.0 for i in range(6))
        assert all(isinstance(value, float) for value in covariance)
    assert fields["pose"]["covariance"][0] == max(known[0], 1e-6)
    assert fields["twist"]["covariance"][0] == pytest.approx(0.012**2)
    assert fields["twist"]["covariance"][35] == pytest.approx(0.2**2)
    assert fields["twist"]["covariance"][14] == 1e6  # what a planar robot does not measure
