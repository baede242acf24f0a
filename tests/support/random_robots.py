"""Robots drawn at random, with the perturbations of the matrix, as the files of a person.

Nothing is drawn to suit an estimator or a controller: sizes, encoders, motors, gears and floors are
spread over what kits and shops sell, and what the robot file states of them has the errors of a
ruler and of a calibration.
"""

from __future__ import annotations

from collections.abc import Callable
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
            "limits": {
                "speed": self.speed,
                "turn_rate": self.turn_rate,
                "acceleration": self.acceleration,
                "braking": self.braking,
            },
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


class Perturbation(NamedTuple):
    """A change of the simulated robot.

    `lasting`: it is there when the robot is calibrated; the others begin afterwards. `fatal`: from
    its beginning on no goal can be reached.
    """

    apply: Callable[[Tree, RobotDesign, Random], None]
    lasting: bool = False
    fatal: bool = False


def _none(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    """No perturbation."""


def _missed(share: float) -> Callable[[Tree, RobotDesign, Random], None]:
    def apply(simulation: Tree, design: RobotDesign, rng: Random) -> None:
        simulation["encoder"]["missed"] = share

    return apply


def _doubled(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["encoder"]["doubled"] = rng.uniform(0.005, 0.03)


def _covered(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["encoder"]["covered"] = rng.choice((1, 1, 2))


def _chatter(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["encoder"]["bounce"] = min(rng.uniform(1.5, 4.0) * design.glitch, 0.01)
    simulation["encoder"]["bounce_share"] = rng.uniform(0.01, 0.1)


def _jitter(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    shortest = design.pitch / design.speed
    simulation["encoder"]["jitter"] = min(rng.uniform(0.02, 0.1) * shortest, 0.002)


def _battery_step(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["disturbances"] = [{"start": rng.uniform(0.5, 4.0), "supply": 0.85}]


def _battery_dies(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    start = rng.uniform(0.5, 3.0)
    simulation["disturbances"] = [{"start": start + number, "supply": 0.6} for number in range(4)]


def _drag(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left_drag", "right_drag"))
    simulation["disturbances"] = [{"start": rng.uniform(0.0, 3.0), side: rng.uniform(0.05, 0.25)}]


def _blocked(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left_drag", "right_drag"))
    simulation["disturbances"] = [{"start": rng.uniform(0.0, 4.0), side: 3.0}]


def _halved(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left_halved", "right_halved"))
    simulation["disturbances"] = [{"start": rng.choice((0.0, rng.uniform(0.0, 4.0))), side: True}]


def _halved_for_a_time(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left_halved", "right_halved"))
    start = rng.uniform(0.0, 3.0)
    end = start + rng.uniform(1.0, 4.0)
    simulation["disturbances"] = [{"start": start, "end": end, side: True}]


def _silent_for_moments(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left_silent", "right_silent"))
    gaps, end = [], 0.0
    for _ in range(rng.randint(1, 4)):
        start = end + rng.uniform(0.3, 3.0)
        end = start + rng.uniform(0.05, 0.4)
        gaps.append({"start": start, "end": end, side: True})
    simulation["disturbances"] = gaps


def _both_halved(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["disturbances"] = [{"start": 0.0, "left_halved": True, "right_halved": True}]


def _sag(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["battery"]["sag"] = rng.uniform(0.25, 0.4)


def _gain(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["motor"]["gain_spread"] = rng.uniform(0.3, 0.5)


def _lag(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    lag = rng.choice((rng.uniform(0.03, 0.04), rng.uniform(0.25, 0.4)))
    simulation["motor"]["lag"] = [lag, lag]


def _start_duty(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["motor"]["start_duty"] = [0.25, 0.4]


def _slip(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["slip"] = 0.003


def _backlash(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["motor"]["backlash"] = f"{rng.uniform(3.0, 5.0):.4f} deg"


def _cogging(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["motor"]["ripple"] = rng.uniform(0.1, 0.3)


def _heavy(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    """The motors were calibrated with raised wheels, and now have to move the robot."""
    factor, load = rng.uniform(1.0, 2.5), rng.uniform(0.0, 0.2)
    motor = simulation["motor"]
    motor["lag"] = [factor * lag for lag in motor["lag"]]
    loads = {f"{side}_drag": load * rng.uniform(0.8, 1.2) for side in ("left", "right")}
    simulation["disturbances"] = [{"start": 0.0, **loads}]


PERTURBATIONS: dict[str, Perturbation] = {
    "none": Perturbation(_none),
    "missed_1": Perturbation(_missed(0.01)),
    "missed_5": Perturbation(_missed(0.05)),
    "doubled": Perturbation(_doubled),
    "covered": Perturbation(_covered),
    "chatter": Perturbation(_chatter),
    "jitter": Perturbation(_jitter),
    "battery_step": Perturbation(_battery_step),
    "battery_dies": Perturbation(_battery_dies, fatal=True),
    "drag": Perturbation(_drag),
    "heavy": Perturbation(_heavy),
    "blocked": Perturbation(_blocked, fatal=True),
    "sag": Perturbation(_sag, lasting=True),
    "gain": Perturbation(_gain, lasting=True),
    "lag": Perturbation(_lag, lasting=True),
    "start_duty": Perturbation(_start_duty, lasting=True),
    "slip": Perturbation(_slip, lasting=True),
    "backlash": Perturbation(_backlash, lasting=True),
    "cogging": Perturbation(_cogging, lasting=True),
}
# No odometry can follow a wheel whose encoder does not show what it does: what counts is what is
# reported, not whether the goal is reached.
ENCODER_FAULTS: dict[str, Perturbation] = {
    "halved": Perturbation(_halved),
    "halved_for_a_time": Perturbation(_halved_for_a_time),
    "both_halved": Perturbation(_both_halved),
    "silent_for_moments": Perturbation(_silent_for_moments),
}
