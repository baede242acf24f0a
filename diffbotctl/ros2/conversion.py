"""Messages of the control socket as fields of ROS messages: nested dictionaries by field name.

Nothing here needs ROS. Conventions: REP-103 (units, axes), REP-105 (frames), and the comments in
the definitions of nav_msgs, sensor_msgs, diagnostic_msgs and rcl_interfaces.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from math import atan2, cos, inf, nan, pi, sin
from typing import Any, NamedTuple

from diffbotctl.estimation.gyro_heading import SCALE_SD
from diffbotctl.estimation.gyro_turn import NOISE, RESOLUTION_SD
from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.geometry.map_tiles import FREE, OCCUPIED, UNKNOWN, CellRows
from diffbotctl.messages import Imu

Fields = dict[str, Any]

# From the cells of a tile to those of nav_msgs/OccupancyGrid, as bytes.
CELL_BYTES = bytes.maketrans((UNKNOWN + FREE + OCCUPIED).encode(), bytes([255, 0, 100]))

UNKNOWN_VARIANCE = 1e6  # of what a planar pose does not measure; zero would mean exact
NOT_MEASURED = [-1.0] + [0.0] * 8  # covariance of what an IMU does not measure (REP-145)
CALIBRATED_SCALE_SD = 0.003  # relative, what `calibrate imu` leaves of the gyro's scale
GYRO_FRAME_S = 0.02  # over which a rate is measured; telemetry below 50 Hz has less noise
GYRO_NOISE_VARIANCE = NOISE**2 / GYRO_FRAME_S + 2.0 * (RESOLUTION_SD / GYRO_FRAME_S) ** 2
# Variance of the pose, m2 and rad2: filters such as robot_localization refuse one of zero, which
# the pose has at the start.
POSE_VARIANCE_MIN = 1e-6
# Standard deviations of the velocity, m/s and rad/s: simulated robots with discs of 20 slots have
# 0.011 and 0.18 while they move; finer encoders have less. A wheel that does not slide sideways
# leaves no other speed across.
SPEED_SD, TURN_RATE_SD = 0.012, 0.2
TWIST_VARIANCES = (SPEED_SD**2, SPEED_SD**2, *[UNKNOWN_VARIANCE] * 3, TURN_RATE_SD**2)
INFRARED = 1  # sensor_msgs/Range
BATTERY_UNKNOWN = 0  # sensor_msgs/BatteryState: status, health and technology
LOG_LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40}  # rcl_interfaces/Log
OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))  # diagnostic_msgs/DiagnosticStatus
GOAL_FAILURES = ("blocked", "stuck", "given_up")
# Indices of x, y and heading in a covariance of ROS: 6 by 6, by rows, (x, y, z, roll, pitch, yaw).
PLANAR_INDICES = (0, 1, 5, 6, 7, 11, 30, 31, 35)


class SensorModel(NamedTuple):
    """Frame and figures of a distance sensor: m, rad."""

    frame: str
    nearest: float
    reach: float
    field_of_view: float = 0.1


def quaternion(heading: float) -> Fields:
    """A rotation about the vertical axis by `heading` rad."""
    return {"x": 0.0, "y": 0.0, "z": sin(0.5 * heading), "w": cos(0.5 * heading)}


def heading_of(x: float, y: float, z: float, w: float) -> float:
    """The heading (rad) of a rotation, which may have any length but zero."""
    return atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def odometry(message: Fields) -> Fields:
    """nav_msgs/Odometry without header and frames."""
    return {
        "pose": {"pose": pose(message), "covariance": _pose_covariance(message)},
        "twist": {"twist": twist(message), "covariance": _diagonal(*TWIST_VARIANCES)},
    }


def _pose_covariance(message: Fields) -> list[float]:
    xx, xy, xh, yy, yh, hh = (number(value) for value in message["covariance"])
    pose_covariance = _diagonal(0.0, 0.0, *[UNKNOWN_VARIANCE] * 3, 0.0)
    values = (xx, xy, xh, xy, yy, yh, xh, yh, hh)
    for index, value in zip(PLANAR_INDICES, values, strict=True):
        pose_covariance[index] = value
    for index in (0, 7, 35):
        pose_covariance[index] = max(pose_covariance[index], POSE_VARIANCE_MIN)
    return pose_covariance


def _diagonal(*variances: float) -> list[float]:
    """A covariance of ROS with these six variances."""
    return [variances[i // 7] if i % 7 == 0 else 0.0 for i in range(36)]


def twist(message: Fields) -> Fields:
    """geometry_msgs/Twist of a forward speed and a turn rate."""
    return {
        "linear": {"x": number(message["linear"])},
        "angular": {"z": number(message["angular"])},
    }


def pose(message: Fields) -> Fields:
    """geometry_msgs/Pose of x, y and heading."""
    position = {"x": number(message["x"]), "y": number(message["y"]), "z": 0.0}
    return {"position": position, "orientation": quaternion(number(message["heading"]))}


def occupancy_grid(cells: CellRows) -> Fields:
    """nav_msgs/OccupancyGrid without its header: -1 unknown, 0 free, 100 occupied."""
    letters = "".join(cells.rows).encode().translate(CELL_BYTES)
    return {
        "info": {
            "resolution": cells.resolution,
            "width": len(cells.rows[0]) if cells.rows else 0,
            "height": len(cells.rows),
            "origin": pose({"x": cells.x, "y": cells.y, "heading": 0.0}),
        },
        "data": array("b", letters),
    }


def map_pose(message: Fields) -> Fields:
    """geometry_msgs/PoseWithCovarianceStamped of the robot in the map."""
    return {"pose": {"pose": pose(message), "covariance": _pose_covariance(message)}}


def map_transform(message: Fields) -> Fields:
    """geometry_msgs/Transform of odom in the map."""
    x, y, heading = message["odom"]
    return transform({"x": x, "y": y, "heading": heading})


def transform(message: Fields) -> Fields:
    """geometry_msgs/Transform of x, y and heading."""
    parts = pose(message)
    return {"translation": parts["position"], "rotation": parts["orientation"]}


def range_fields(message: Fields, sensor: SensorModel) -> Fields:
    """sensor_msgs/Range: +inf when clear, -inf when too close (REP-117), nan for a fault."""
    distance = number(message["distance"])
    states = {"clear": inf, "too_close": -inf, "fault": nan}
    return {
        "radiation_type": INFRARED,
        "field_of_view": sensor.field_of_view,
        "min_range": sensor.nearest,
        "max_range": sensor.reach,
        "range": states.get(message["state"], distance),
    }


def scan(message: Fields, sensor: SensorModel) -> Fields:
    """sensor_msgs/LaserScan: inf when clear, 0 when too close, which is below range_min.

    Its stamp is the time of the first ray: `scan_age` before that of the message.
    """
    distances = [number(value) for value in message["distances"]]
    step, duration = number(message["step"]), number(message["duration"])
    return {
        "angle_min": number(message["start"]),
        "angle_max": number(message["start"]) + step * max(len(distances) - 1, 0),
        "angle_increment": step,
        "time_increment": duration / len(distances) if distances else 0.0,
        "scan_time": duration,
        "range_min": sensor.nearest,
        "range_max": sensor.reach,
        "ranges": distances,
    }


def scan_age(message: Fields) -> int:
    """Time (ns) from the first ray of a scan to its end; 0 of other messages."""
    return round(1e9 * number(message.get("duration", 0.0)))


def wheel_angles(message: Fields, counts_per_turn: tuple[float, float]) -> tuple[float, float]:
    """Angles of both wheels (rad) from the counts of their encoders."""
    left, right = counts_per_turn
    return 2.0 * pi * message["left"] / left, 2.0 * pi * message["right"] / right


def imu(message: Fields) -> Fields:
    """sensor_msgs/Imu: the turn rate about the vertical axis, in the frame of the robot.

    Orientation and acceleration are not measured. Before the gyro has been zeroed, and after it has
    failed, the rate is not measured either.
    """
    measured = message["state"] == "working"
    rate = number(message["rate"])
    scale_sd = CALIBRATED_SCALE_SD if message["calibrated"] else SCALE_SD
    variance = GYRO_NOISE_VARIANCE + number(message["bias_sd"]) ** 2 + (scale_sd * rate) ** 2
    about = (UNKNOWN_VARIANCE, 0.0, 0.0, 0.0, UNKNOWN_VARIANCE, 0.0, 0.0, 0.0, variance)
    return {
        "orientation_covariance": NOT_MEASURED,
        "angular_velocity": {"z": rate if measured else 0.0},
        "angular_velocity_covariance": list(about) if measured else NOT_MEASURED,
        "linear_acceleration_covariance": NOT_MEASURED,
    }


def battery(message: Fields) -> Fields:
    """sensor_msgs/BatteryState; what is not measured is nan."""
    unknown = ("temperature", "current", "charge", "capacity", "design_capacity", "percentage")
    return {
        **dict.fromkeys(unknown, nan),
        "voltage": number(message["volts"]),
        "power_supply_status": BATTERY_UNKNOWN,
        "power_supply_health": BATTERY_UNKNOWN,
        "power_supply_technology": BATTERY_UNKNOWN,
        "present": True,
    }


def log_line(message: Fields) -> Fields:
    """rcl_interfaces/Log without its stamp."""
    return {
        "level": LOG_LEVELS[message["level"]],
        "name": f"diffbotctl.{message['source']}",
        "msg": message["text"],
    }


class DiagnosticEntry(NamedTuple):
    """One status: name, level, message, and values by key."""

    name: str
    level: bytes
    message: str
    values: Mapping[str, str]


def diagnostics(newest: Mapping[str, tuple[str, Fields]]) -> list[DiagnosticEntry]:
    """The statuses of the robot from the newest message of each wire, with its type."""
    makers = {"Stop": _stop_entry, "Link": _link_entry, "GoalState": _goal_entry}
    makers |= {"Battery": _battery_entry, "Imu": _imu_entry}
    return [
        makers[kind](wire, message) for wire, (kind, message) in newest.items() if kind in makers
    ]


def _stop_entry(wire: str, message: Fields) -> DiagnosticEntry:
    if not message["code"]:
        return DiagnosticEntry(wire, OK, "may move", {})
    level = ERROR if message["latched"] else WARN
    values = {"code": message["code"], "latched": str(message["latched"]).lower()}
    return DiagnosticEntry(wire, level, message["cause"], values)


def _link_entry(wire: str, message: Fields) -> DiagnosticEntry:
    levels = {"up": OK, "stale": STALE, "lost": ERROR}
    counters = ("received", "damaged", "lost", "restarts", "latency")
    values = {name: str(message[name]) for name in counters}
    text = message["cause"] or message["state"]
    return DiagnosticEntry(wire, levels.get(message["state"], WARN), text, values)


def _goal_entry(wire: str, message: Fields) -> DiagnosticEntry:
    level = WARN if message["state"] in GOAL_FAILURES else OK
    values = {"number": str(message["number"]), "distance": str(message["distance"])}
    return DiagnosticEntry(wire, level, message["cause"] or message["state"], values)


def _battery_entry(wire: str, message: Fields) -> DiagnosticEntry:
    level, text = (WARN, "low") if message["low"] else (OK, "ok")
    return DiagnosticEntry(wire, level, text, {"volts": str(message["volts"])})


def _imu_entry(wire: str, message: Fields) -> DiagnosticEntry:
    imu = Imu(**message)
    level = {"working": OK, "zeroing": WARN, "failed": ERROR}[imu.state]
    values = {name: str(message[name]) for name in ("rate", "bias", "bias_sd", "calibrated")}
    return DiagnosticEntry(wire, level, imu_text(imu), values)


def number(value: float | str) -> float:
    """A number of the control socket, where nan and infinities are texts."""
    return float(value)
