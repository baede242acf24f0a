"""Recordings made with version 0.1 are read and replayed bit for bit by this version.

How each was made, and what it covers, is in data/recordings_v0_1/README.md. They are never made
anew: what version 0.1 wrote stays as it is.
"""

from pathlib import Path
from typing import NamedTuple

import pytest

# All that this test needs of the program; after a rename only these lines change.
from diffbotctl.block import Block, Every, FromRobot, In, Out, action
from diffbotctl.messages import Odometry, Text, Twist
from diffbotctl.params import Param
from diffbotctl.replay.replay import replay
from diffbotctl.replay.source import read_run
from diffbotctl.time import SECOND

BLOCKS = "diffbotctl.blocks"  # the entry point by which packages offer their blocks

FOLDER = Path(__file__).parent / "data" / "recordings_v0_1"


class Frozen(NamedTuple):
    """What the replay of a recording came to in version 0.1."""

    compared: int
    """messages that `--check` compares with the recorded ones; 0 where it refuses"""
    digest: str


CHECKED = {
    "edges.mcap": Frozen(1302, "527517cd8eac56d304340b30aa0474d509db9a45d82be51462898deaa5a2688f"),
    "counts.mcap": Frozen(1687, "f6c9a65112b3a6786d87ad4110868ebd453f4bbef7c37d93bc8526e2d33dc037"),
    "stock.mcap": Frozen(859, "9651f42017fe45bd3dcc6bd3d0abcb9c92563239dc626576fde227c8014bf483"),
    "emulated.mcap": Frozen(
        900, "778c87b6b3ea3b67efb212814848b6d4b9bd1e1347e504a7aeae94da2f642e92"
    ),
    "path.mcap": Frozen(1141, "d66a2a0b89b0447af82a9293035d10ad67018c96bbe17dfc0fd2b568dc907e17"),
    "wander.mcap": Frozen(610, "1858fffab89600439617c3b2f28aa54b84922fd9293e21e8d993fe7d841f1ca8"),
    "turtle.mcap": Frozen(522, "ef43c1165626b687026b5c4b4b347b54e82341304e96f952432dd85f961b055d"),
    "obstacle.mcap": Frozen(
        1117, "1a3d0b1108c593020350c3f3a2e3dd55f82fd169fdff5260227188ccf7875fb2"
    ),
    "operator.mcap": Frozen(
        1162, "34a78d4659d3622aca93f1ac0f394a9fe069108de2ad48a679e0dbe60bd8c340"
    ),
    "ease.mcap": Frozen(1089, "771f4be3b568ff5eca266d9b5209bf4ba736451133f1716ad3551ad1d281c85e"),
}

# A recovered recording has no end, and a flight nothing of the blocks: `--check` refuses both.
UNCHECKED = {
    "hello.mcap": Frozen(0, "d9d4da6b2dd7ca1855881bbfe5c2424e75e7f9e968341cc0fae624feaa24ae39"),
    "flight.mcap": Frozen(0, "d57896ab4e686117a02f69baac09694fcc36aac9025273b119c3d5c7902cdfb0"),
}

ALL = {**CHECKED, **UNCHECKED}


class Ease(Block):
    """A user's own block, which ease.mcap was recorded with: let through a share of a velocity."""

    share = Param(float, default=1.0, unit="1", above=0.0, most=1.0, live=True, help="Of both.")
    rounds = Param(int, default=2, least=1, most=9, live=True, help="Ticks from word to word.")
    mode = Param(
        str, default="both", choices=("both", "turns"), live=True, help="What is made smaller."
    )
    speed = FromRobot("limits.speed")

    tick = Every(0.2)
    wanted = In(Twist, fresh_for=0.5)
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

    def react(self, now, tick, wanted, odometry):
        text = None
        if tick is not None:
            self.ticks += 1
            if self.ticks % self.rounds == 0 and odometry is not None:
                text = Text(tick, f"{self.mode}: {odometry.linear / self.speed:.3f} of the limit")
        if wanted is None:
            return None, text
        turning = wanted.angular * self.share * self.extra
        moving = wanted.linear * (self.share * self.extra if self.mode == "both" else 1.0)
        return Twist(now, moving, turning), text


@pytest.fixture(autouse=True)
def package(tmp_path, monkeypatch):
    """An installed package of a user, which offers the block `ease`."""
    info = tmp_path / "easy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: easy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{BLOCKS}]\nease = {__name__}:Ease\n")
    monkeypatch.syspath_prepend(str(tmp_path))


def test_all_twelve_are_there():
    assert len(ALL) == 12
    assert {path.name for path in FOLDER.glob("*.mcap")} == set(ALL)


@pytest.mark.parametrize("name", CHECKED)
def test_every_message_is_made_anew_bit_for_bit(name):
    done = replay(FOLDER / name, check=True)
    assert done.difference is None
    assert done.compared == CHECKED[name].compared > 0
    assert done.digest == CHECKED[name].digest


@pytest.mark.parametrize("name", UNCHECKED)
def test_what_cannot_be_checked_is_replayed_to_its_end(name):
    run = read_run(FOLDER / name)
    done = replay(run.path)
    assert done.ending.code == 0 and done.ending.time > run.last
    assert done.digest == UNCHECKED[name].digest


def test_a_flight_begins_in_the_state_that_was_saved():
    run = read_run(FOLDER / "flight.mcap")
    assert run.is_flight and run.begins == "state"
    assert run.state is not None and run.state[0] > 30 * SECOND
