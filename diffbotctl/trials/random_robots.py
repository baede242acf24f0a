"""Robots drawn at random, as the files of a person.

Nothing is drawn to suit an estimator or a controller: sizes, encoders, motors, gears and floors are
spread over what kits and shops sell, and what the robot file states of them has the errors of a
ruler and of a calibration.
"""

from __future__ import annotations

from math import exp, log, pi, sqrt
from random import Random
from typing import Any, NamedTuple

from diffbotctl.config.checks.drive import resolution
from diffbotctl.config.robot import default_glitch

Tree = dict[str, Any]
PERIODS = {"edges": 40, "counts": 50, "stock": 16.5}  # Hz
LINKS = {
    "diffbot": {"protocol": "diffbot", "uart": 1, "baud": 9600},
    # Delays as measured with the book's firmware.
    "rosserial": {
        "protocol": "rosserial",
        "uart": 1,
        "baud": 9600,
        "command_delay": 0.1,
        "command_jitter": 0.012,
        "stamp_jitter": 0.008,
    },
}
LIMITS = ("speed", "turn_rate", "acceleration", "braking")
STOCK_FIRST = 1000  # robots with this number and beyond have the book's firmware
EDGE_RATE_MAX = 20_000  # per second, of one encoder
PITCH_TRACK_RATIO_MAX = 0.2
DIAMETER_TRACK_RATIO_MAX = 1.2


class RobotDesign(NamedTuple):
    """What a person knows of a robot, and how its parts spread. Lengths m, speeds rad/s."""

    number: int
    board: str  # edges, counts, or stock: the book's firmware
    track: float
    diameter: float
    slots: int
    rated: float
    glitch: float  # s, the default
    speed: float  # m/s, the limits
    turn_rate: float
    acceleration: float
    braking: float
    idle: str
    lag: tuple[float, float]
    simulation: Tree

    @property
    def pitch(self) -> float:
        """Travel of a wheel in one count, m."""
        return pi * self.diameter / self.slots

    @property
    def tolerances(self) -> tuple[float, float]:
        """Tolerances (m, rad) of a goal, as coarse as `check` asks for."""
        is_timed = self.board == "edges"
        stddev = resolution(self.diameter, self.slots, self.speed, is_timed, self.protocol)
        position = max(0.01, 2.5 * stddev)
        return position, max(2.0 * pi / 180, 2.0 * sqrt(2.0) * stddev / self.track)

    @property
    def protocol(self) -> str:
        """What its board speaks."""
        return "rosserial" if self.board == "stock" else "diffbot"

    def tree(self) -> Tree:
        """The robot file without a calibration."""
        return {
            "format": 1,
            "kind": "robot",
            "board": {
                "type": "mega2560",
                "telemetry": PERIODS[self.board],
                "edge_times": self.board == "edges",
                **({} if self.board == "stock" else {"deadman": 0.3}),
            },
            "link": LINKS[self.protocol],
            "drive": {
                "type": "differential",
                "polarity": "checked_by_hand",
                "track": self.track,
                "wheel": {"diameter": self.diameter, "width": 0.02},
                "motor": {"driver": "l298n", "rated": self.rated, "idle": self.idle},
                "encoder": {"channels": 1, "slots": self.slots},
                "left": {"motor": {"enable": 5, "in1": 6, "in2": 7}, "encoder": {"pin": 2}},
                "right": {"motor": {"enable": 8, "in1": 9, "in2": 10}, "encoder": {"pin": 3}},
            },
            "body": {
                "front": round(0.6 * self.track, 3),
                "back": round(1.2 * self.track, 3),
                "width": self.track + 0.03,
            },
            "limits": {name: getattr(self, name) for name in LIMITS},
            "simulation": self.simulation,
        }


def draw_design(seed: int, number: int) -> RobotDesign:
    """Robot `number` of the matrix with this seed."""
    rng = Random(f"robot {seed} {number}")
    while True:
        track = _log_uniform(rng, 0.070, 0.400)
        diameter = _log_uniform(rng, 0.030, min(0.200, DIAMETER_TRACK_RATIO_MAX * track))
        rated = _log_uniform(rng, 30.0, 400.0) * 2 * pi / 60
        slots = round(_log_uniform(rng, 8, 4096))
        is_coarse = pi * diameter / slots > PITCH_TRACK_RATIO_MAX * track
        if not is_coarse and rated * slots / (2 * pi) <= EDGE_RATE_MAX:
            break
    top_speed = rated * diameter / 2
    speed = min(rng.uniform(0.35, 0.85) * top_speed, 1.0)
    lag = _log_uniform(rng, 0.04, 0.2)
    acceleration = min(_log_uniform(rng, 0.2, 2.0), 4.0 * speed / lag)
    board = rng.choice(("edges", "counts"))
    if number >= STOCK_FIRST:
        board, acceleration = "stock", 0.5 * acceleration  # as late as its commands come
    return RobotDesign(
        number=number,
        board=board,
        track=round(track, 4),
        diameter=round(diameter, 4),
        slots=slots,
        rated=round(rated, 3),
        glitch=default_glitch(slots, rated),
        speed=round(speed, 3),
        turn_rate=round(rng.uniform(0.4, 1.0) * min(2 * speed / track, 6.0), 3),
        acceleration=round(acceleration, 3),
        braking=round(rng.uniform(1.0, 1.5) * acceleration, 3),
        idle=rng.choice(("coast", "coast", "brake")),
        lag=(round(0.9 * lag, 4), round(1.1 * lag, 4)),
        simulation=_draw_simulation(rng, lag),
    )


def _draw_simulation(rng: Random, lag: float) -> Tree:
    start = rng.uniform(0.05, 0.18)
    return {
        "motor": {
            "lag": [0.9 * lag, 1.1 * lag],
            "gain_spread": rng.uniform(0.02, 0.12),
            "start_duty": [0.8 * start, 1.2 * start],
            "keep_share": rng.uniform(0.6, 0.95),
            "ripple": rng.uniform(0.0, 0.04),
            "coasting": rng.choice(("linear", "coulomb")),
            "backlash": f"{rng.choice((0.0, rng.uniform(0.0, 1.0))):.4f} deg",
        },
        "encoder": {
            "slot_spread": rng.uniform(0.0, 0.05),
            "duty_spread": rng.uniform(0.0, 0.08),
            "jitter": _log_uniform(rng, 1e-6, 1e-4),
        },
        "slip": _log_uniform(rng, 0.0002, 0.001),
        "battery": {"sag": rng.uniform(0.02, 0.12)},
        "geometry": {"track_spread": 0.02, "diameter_spread": 0.01},
    }


def _log_uniform(rng: Random, low: float, high: float) -> float:
    return exp(rng.uniform(log(low), log(high)))


def yaml_text(tree: dict[str, Any]) -> str:
    """`tree` as a file that a person could have written."""
    return "".join(f"{key}: {_flow(value)}\n" for key, value in tree.items())


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(inner) for inner in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.10f}".rstrip("0") if abs(value) > 1e-9 else "0.0"
    return str(value)
