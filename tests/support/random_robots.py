"""The perturbations of the matrix, of robots that are drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

from diffbotctl.trials.random_robots import RobotDesign, Tree

Apply = Callable[[Tree, RobotDesign, Random], None]


class Perturbation(NamedTuple):
    """A change of the simulated robot.

    `lasting`: it is there when the robot is calibrated; the others begin afterwards. `fatal`: from
    its beginning on no goal can be reached.
    """

    apply: Apply
    lasting: bool = False
    fatal: bool = False


def _part(section: str, **values: object) -> Apply:
    """Values of a section of the simulation; of a pair of floats one between them is drawn."""

    def apply(simulation: Tree, design: RobotDesign, rng: Random) -> None:
        simulation[section] |= {key: _drawn(value, rng) for key, value in values.items()}

    return apply


def _drawn(value: Any, rng: Random) -> Any:
    return rng.uniform(*value) if isinstance(value, tuple) else value


def _fault(fault: str, **more: Any) -> Apply:
    """A fault in the words of a file of trials; `for` is `lasting`."""

    def apply(simulation: Tree, design: RobotDesign, rng: Random) -> None:
        side = {"side": rng.choice(("left", "right"))} if more.get("side") == "either" else {}
        drawn = {key: _drawn(value, rng) for key, value in more.items()} | side
        simulation["faults"] = [_entry(fault, **drawn)]

    return apply


def _entry(fault: str, at: float, **more: Any) -> Tree:
    keys = {"lasting": "for"}
    return {"fault": fault, "at": at, **{keys.get(key, key): value for key, value in more.items()}}


def _covered(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["encoder"]["covered"] = rng.choice((1, 1, 2))


def _chatter(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["encoder"]["bounce"] = min(rng.uniform(1.5, 4.0) * design.glitch, 0.01)
    simulation["encoder"]["bounce_share"] = rng.uniform(0.01, 0.1)


def _jitter(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    shortest = design.pitch / design.speed
    simulation["encoder"]["jitter"] = min(rng.uniform(0.02, 0.1) * shortest, 0.002)


def _battery_dies(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    start = rng.uniform(0.5, 3.0)
    simulation["faults"] = [_entry("battery_step", start + number, size=0.6) for number in range(4)]


def _halved(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side, start = rng.choice(("left", "right")), rng.choice((0.0, rng.uniform(0.0, 4.0)))
    simulation["faults"] = [_entry("edges_halved", start, side=side)]


def _silent_for_moments(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    side = rng.choice(("left", "right"))
    gaps, end = [], 0.0
    for _ in range(rng.randint(1, 4)):
        start = end + rng.uniform(0.3, 3.0)
        end = start + rng.uniform(0.05, 0.4)
        gaps.append(_entry("edges_silent", start, lasting=end - start, side=side))
    simulation["faults"] = gaps


def _lag(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    lag = rng.choice((rng.uniform(0.03, 0.04), rng.uniform(0.25, 0.4)))
    simulation["motor"]["lag"] = [lag, lag]


def _slip(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["slip"] = 0.003


def _backlash(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    simulation["motor"]["backlash"] = f"{rng.uniform(3.0, 5.0):.4f} deg"


def _heavy(simulation: Tree, design: RobotDesign, rng: Random) -> None:
    """The motors were calibrated with raised wheels, and now have to move the robot."""
    factor, load = rng.uniform(1.0, 2.5), rng.uniform(0.0, 0.2)
    motor = simulation["motor"]
    motor["lag"] = [factor * lag for lag in motor["lag"]]
    simulation["faults"] = [
        _entry("wheel_drag", 0.0, side=side, size=load * rng.uniform(0.8, 1.2))
        for side in ("left", "right")
    ]


PERTURBATIONS: dict[str, Perturbation] = {
    "none": Perturbation(_part("encoder")),
    "missed_1": Perturbation(_part("encoder", missed=0.01)),
    "missed_5": Perturbation(_part("encoder", missed=0.05)),
    "doubled": Perturbation(_part("encoder", doubled=(0.005, 0.03))),
    "covered": Perturbation(_covered),
    "chatter": Perturbation(_chatter),
    "jitter": Perturbation(_jitter),
    "battery_step": Perturbation(_fault("battery_step", at=(0.5, 4.0), size=0.85)),
    "battery_dies": Perturbation(_battery_dies, fatal=True),
    "drag": Perturbation(_fault("wheel_drag", at=(0.0, 3.0), side="either", size=(0.05, 0.25))),
    "heavy": Perturbation(_heavy),
    "blocked": Perturbation(_fault("wheel_blocked", at=(0.0, 4.0), side="either"), fatal=True),
    "sag": Perturbation(_part("battery", sag=(0.25, 0.4)), lasting=True),
    "gain": Perturbation(_part("motor", gain_spread=(0.3, 0.5)), lasting=True),
    "lag": Perturbation(_lag, lasting=True),
    "start_duty": Perturbation(_part("motor", start_duty=[0.25, 0.4]), lasting=True),
    "slip": Perturbation(_slip, lasting=True),
    "backlash": Perturbation(_backlash, lasting=True),
    "cogging": Perturbation(_part("motor", ripple=(0.1, 0.3)), lasting=True),
}
# No odometry can follow a wheel whose encoder does not show what it does: what counts is what is
# reported, not whether the goal is reached.
ENCODER_FAULTS: dict[str, Perturbation] = {
    "halved": Perturbation(_halved),
    "halved_for_a_time": Perturbation(
        _fault("edges_halved", at=(0.0, 3.0), lasting=(1.0, 4.0), side="either")
    ),
    "both_halved": Perturbation(_fault("edges_halved", at=0.0)),
    "silent_for_moments": Perturbation(_silent_for_moments),
}
