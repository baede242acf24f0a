"""Ultrasonic sensors of a simulated robot: the first echo from a cone ahead."""

from __future__ import annotations

from math import inf, radians
from random import Random

from diffbotctl.config.simulation import EchoFault, SensorTruth
from diffbotctl.geometry.distance_sensors import ECHOES, SPEED_OF_SOUND, EchoFacts, echo_distance
from diffbotctl.messages import Range
from diffbotctl.plant.chassis import Pose
from diffbotctl.plant.world import World

# An HC-SR04 detects objects within 15 degrees of its axis, those at the edge only if large.
RAYS = tuple(radians(angle) for angle in (-12, -6, 0, 6, 12))
ENDLESS_US, SILENT_US, NOTHING_US = 0xFFFF, 0, 60_000  # as the emulator takes them
SHORTEST_US = 100  # the sensor detects nothing while its burst leaves


class EchoSensor:
    """One HC-SR04."""

    def __init__(self, kind: str, truth: SensorTruth, rng: Random) -> None:
        self.facts: EchoFacts = ECHOES[kind]
        self.fault: EchoFault = truth.echo
        self._spread, self._rng = truth.echo_spread, rng

    def distance(self, world: World, pose: Pose) -> float:
        """Distance (m) of the nearest object in the cone, with noise; inf when there is none."""
        nearest = min(world.distance(pose.x, pose.y, pose.heading + ray) for ray in RAYS)
        if nearest == inf:
            return inf
        return max(nearest + self._rng.gauss(0.0, self._spread), 0.0)

    def reading(self, now: int, world: World, pose: Pose) -> Range:
        """What a board makes of a measurement."""
        if self.fault != "plain":
            return Range(now, 0.0, "fault")
        distance = self.distance(world, pose)
        if distance == inf:
            return Range(now, self.facts.reach, "clear")
        return Range(now, *echo_distance(2 * distance / SPEED_OF_SOUND, self.facts))

    def echo_us(self, world: World, pose: Pose) -> int:
        """Length of the echo in us for an emulated board."""
        if self.fault != "plain":
            return ENDLESS_US if self.fault == "endless" else SILENT_US
        distance = self.distance(world, pose)
        if distance == inf:
            return NOTHING_US
        return min(max(round(2e6 * distance / SPEED_OF_SOUND), SHORTEST_US), NOTHING_US)
