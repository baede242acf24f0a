"""The perturbations of the matrix, of robots that are drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

from diffbotctl.trials.random_robots import RobotDesign, Tree


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


def _fault(fault: str, at: float, **more: Any) -> Tree:
    """A fault of the simulation; `for` is written `lasting`."""
    keys = {"lasting": "for"}
    return {"fault": fault, "at": at, **{keys.get(key, key): value for key, value in more.items()}}


def _battery_step(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["faults"] = [_fault("battery_step", rng.uniform(0.5, 4.0), size=0.85)]


def _battery_dies(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    start = rng.uniform(0.5, 3.0)
    simulation["faults"] = [_fault("battery_step", start + number, size=0.6) for number in range(4)]


def _side(rng: Random) -> str:
    return rng.choice(("left", "right"))


def _drag(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side, start = _side(rng), rng.uniform(0.0, 3.0)
    size = rng.uniform(0.05, 0.25)
    simulation["faults"] = [_fault("wheel_drag", start, side=side, size=size)]


def _blocked(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = _side(rng)
    simulation["faults"] = [_fault("wheel_blocked", rng.uniform(0.0, 4.0), side=side)]


def _halved(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side, start = _side(rng), rng.choice((0.0, rng.uniform(0.0, 4.0)))
    simulation["faults"] = [_fault("edges_halved", start, side=side)]


def _halved_for_a_time(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side, start = _side(rng), rng.uniform(0.0, 3.0)
    lasting = rng.uniform(1.0, 4.0)
    simulation["faults"] = [_fault("edges_halved", start, lasting=lasting, side=side)]


def _silent_for_moments(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = _side(rng)
    gaps, end = [], 0.0
    for _ in range(rng.randint(1, 4)):
        start = end + rng.uniform(0.3, 3.0)
        end = start + rng.uniform(0.05, 0.4)
        gaps.append(_fault("edges_silent", start, lasting=end - start, side=side))
    simulation["faults"] = gaps


def _both_halved(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["faults"] = [_fault("edges_halved", 0.0)]


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
    simulation["faults"] = [
        _fault("wheel_drag", 0.0, side=side, size=load * rng.uniform(0.8, 1.2))
        for side in ("left", "right")
    ]


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
