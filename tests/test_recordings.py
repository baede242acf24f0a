"""Recordings are computed again bit for bit.

How each was made, and what it covers, is in data/recordings/README.md. Where a change of behaviour
is intended, `python -m tests.test_recordings` records what the blocks make of the same inputs now;
the files that differ are committed with the change.
"""

import os
import sys
import tempfile
from pathlib import Path

import pytest

from diffbotctl.block import Block, Every, FromRobot, In, Out, action
from diffbotctl.messages import Odometry, Text, Twist
from diffbotctl.params import Param
from diffbotctl.recording.reader import RecordingReader
from diffbotctl.replay.recorded_run import read_run
from diffbotctl.replay.replay import ReplayOptions, replay, replay_run

FOLDER = Path(__file__).parent / "data" / "recordings"
NAMES = [
    "counts",
    "ease",
    "edges",
    "emulated",
    "hello",
    "obstacle",
    "operator",
    "path",
    "stock",
    "turtle",
    "turtles",
    "wander",
]
KINDS_MIN = 20  # message classes in all of them


class Ease(Block):
    """A user's own block, which ease.mcap was recorded with: let through a share of a velocity."""

    share = Param(float, default=1.0, unit="1", above=0.0, maximum=1.0, live=True, help="Of both.")
    rounds = Param(int, default=2, minimum=1, maximum=9, live=True, help="Ticks from text to text.")
    mode = Param(
        str, default="both", choices=("both", "turns"), live=True, help="What is made smaller."
    )
    speed = FromRobot("limits.speed")

    tick = Every(0.2)
    requested = In(Twist, fresh_for=0.5)
    odometry = In(Odometry, trigger=False, optional=True)
    twist = Out(Twist)
    text = Out(Text)

    def reset(self):
        self.ticks = 0
        self.extra = 1.0

    def changed(self, name):
        self.log.info(f"{name} is {getattr(self, name)}")

    @action
    def press(self, now, factor=0.5):
        """Make everything smaller by one more factor."""
        if not 0.0 < factor <= 1.0:
            raise ValueError("the factor must be above 0 and at most 1")
        self.extra *= factor

    def react(self, now, tick, requested, odometry):
        text = None
        if tick is not None:
            self.ticks += 1
            if self.ticks % self.rounds == 0 and odometry is not None:
                text = Text(tick, f"{self.mode}: {odometry.linear / self.speed:.3f} of the limit")
        if requested is None:
            return None, text
        turning = requested.angular * self.share * self.extra
        moving = requested.linear * (self.share * self.extra if self.mode == "both" else 1.0)
        return Twist(now, moving, turning), text


def offer_ease(folder: Path) -> None:
    """Make `folder` one of the path with an installed package that offers the block `ease`."""
    info = folder / "easy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: easy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[diffbotctl.blocks]\nease = tests.test_recordings:Ease\n"
    )


@pytest.fixture(autouse=True)
def package(tmp_path, monkeypatch):
    offer_ease(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))


@pytest.mark.parametrize("name", NAMES)
def test_every_message_is_computed_again_bit_for_bit(name):
    done = replay(FOLDER / f"{name}.mcap", check=True)
    assert done.difference is None and not done.left_out
    assert done.compared > 10


def test_they_have_most_message_classes():
    kinds = set()
    for name in NAMES:
        kinds |= {
            type(item.message) for item in RecordingReader(FOLDER / f"{name}.mcap").messages()
        }
    assert len(kinds) >= KINDS_MIN


def renew() -> None:
    """Replace each recording that is computed differently now by what it is computed to."""
    with tempfile.TemporaryDirectory() as folder:
        offer_ease(Path(folder))
        sys.path.insert(0, folder)
        os.chdir(FOLDER)  # the new files name the old ones
        for name in NAMES:
            path, new = Path(f"{name}.mcap"), Path(folder) / f"{name}.mcap"
            if replay(path, check=True).difference is not None:
                replay_run(read_run(path), ReplayOptions(record=new))
                path.write_bytes(new.read_bytes())
                print(f"{path} renewed")


if __name__ == "__main__":
    renew()
