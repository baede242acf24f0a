"""A package of somebody else with its own message types and blocks, as pip would install it.

Two of its message classes are plain NamedTuples without units; one has the name of a built-in one.
"""

from __future__ import annotations

from pathlib import Path

NAME = "odd_noses"
MESSAGES = '''
from typing import Annotated, Literal, NamedTuple

from diffbotctl.messages import Field, Time


class Box(NamedTuple):
    x: float
    label: str = "none"


class Gas(NamedTuple):
    time: int
    ppm: float


class Face(NamedTuple):
    """A face in front of the robot."""

    time: Time
    x: Annotated[float, Field("m", "Position.")]
    name: str
    corners: tuple[float, float]
    mood: Literal["glad", "sad"]
    boxes: tuple[Box, ...] = ()
    seen: bool | None = None
    level: float | None = None


class Range(NamedTuple):
    time: int
    near: Annotated[float, Field("cm", "Not the built-in Range.")]
'''
BLOCKS = '''
from diffbotctl.block import Block, In, Out, action
from diffbotctl.messages import Odometry
from diffbotctl.messages import Range as Distance
from diffbotctl.params import Param
from odd_noses.messages import Box, Face, Gas, Range

NAN = float("nan")


class Smell(Block):
    """Publish messages of this package."""

    gain = Param(float, default=1.0, live=True, help="Factor of ppm.")
    odometry = In(Odometry)
    gas = Out(Gas)
    face = Out(Face)
    own = Out(Range)

    def reset(self):
        self.count = 0.0

    @action(by="1")
    def raise_count(self, now, by=1.0):
        """Raise the count; returns it."""
        self.count += by
        return self.count

    @action(near="m")
    def describe(self, now, name: str, near=1.0, mood: str = "glad"):
        """Describe a face."""
        if name == "none":
            raise ValueError("there is no face")
        return ("{name} is {mood}".format(name=name, mood=mood), near, NAN)

    @action
    def itself(self, now):
        """Return what no answer can carry."""
        return self

    def react(self, now, odometry):
        if odometry is None:
            return None
        self.count += 1
        boxes = (Box(NAN, "nan"), Box(self.count))
        face = Face(now, odometry.x, "nan", (NAN, 1), "sad", boxes, True, float("-inf"))
        return Gas(now, self.gain * self.count), face, Range(now, 1e-320)


class Sniff(Block):
    """Take messages of this package, and a built-in one of the same name."""

    gas = In(Gas)
    own = In(Range, fresh_for=0.5)
    distance = In(Distance, trigger=False)
    back = Out(Gas)

    def react(self, now, gas, own, distance):
        if gas is None or own is None or distance is None:
            return None
        return Gas(now, -gas.ppm * distance.distance)
'''
ENTRIES = """
[diffbotctl.blocks]
smell = odd_noses.blocks:Smell
sniff = odd_noses.blocks:Sniff

[diffbotctl.messages]
Face = odd_noses.messages:Face
Gas = odd_noses.messages:Gas
Range = odd_noses.messages:Range
"""
PIPELINE = """
format: 1
kind: pipeline
include: goal
blocks:
  nose: {block: smell, in: {odometry: odometry.odometry}}
  sniff: {block: sniff, in: {gas: nose.gas, own: nose.own, distance: range.range}}
"""


def install(folder: Path) -> Path:
    """Install the package into `folder`, for PYTHONPATH, and return its pipeline beside it."""
    package = folder / NAME
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "messages.py").write_text(MESSAGES)
    (package / "blocks.py").write_text(BLOCKS)
    info = folder / f"{NAME}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {NAME}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    pipeline = folder.parent / "noses.yaml"
    pipeline.write_text(PIPELINE)
    return pipeline
