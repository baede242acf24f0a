"""Equal inputs give equal runs: one digest over every message, in every kind of process."""

import os
import re
import select
import subprocess
import tty
from random import Random

import pytest

from tests.sampling import by_day
from tests.support.background import BackgroundDevice
from tests.support.book_board import BookBoardPort
from tests.support.command_process import command_line
from tests.support.trials.child_faults import SensingBoard

LONGEST = 60  # s


def digest(*words, hash_seed="random"):
    """The digest that a command prints, run as a process of its own."""
    done = subprocess.run(
        command_line(*words),
        stdin=subprocess.DEVNULL,
        text=True,
        capture_output=True,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        timeout=LONGEST,
        check=False,
    )
    found = re.search(r"digest\s+([0-9a-f]{64})", done.stdout)
    assert found, done.stdout + done.stderr
    return found[1], done.stdout


GOAL = ("run", "goal", "--robot", "book_2wd", "--goal", "0.1 0", "--seed", "4", "--quiet")


def test_hash_seeds_paced_unpaced_and_replayed(tmp_path):
    log = tmp_path / "goal.mcap"
    seen = {
        digest(*GOAL, "--fast", "--digest", hash_seed="0")[0],
        digest(*GOAL, "--fast", "--digest", "--record", log, hash_seed="1")[0],
        digest(*GOAL, "--digest", hash_seed="2")[0],
        digest("replay", log, "--check", hash_seed="3")[0],
    }
    assert len(seen) == 1


class Shaken(BackgroundDevice):
    """A pseudo-terminal that passes bytes in pieces with random pauses."""

    def __init__(self, board, seed):
        self.board = board
        self.chance = Random(seed)
        self.ours, self.theirs = os.openpty()
        tty.setraw(self.theirs)
        self.name = os.ttyname(self.theirs)
        self.far = os.open(board.name, os.O_RDWR | os.O_NOCTTY)
        self.begin()

    def live(self):
        while not self.over.is_set():
            ready, _, _ = select.select([self.ours, self.far], [], [], 0.05)
            for file in ready:
                data = os.read(file, 4096)
                while data:
                    size = self.chance.randint(1, 9)
                    os.write(self.far if file == self.ours else self.ours, data[:size])
                    data = data[size:]
                    if self.chance.random() < 0.3:
                        self.over.wait(self.chance.uniform(0.0, 0.012))

    def let_go(self):
        for file in (self.ours, self.theirs, self.far):
            os.close(file)


@pytest.mark.parametrize("seed", by_day(1, [1, 2]))
def test_a_live_run_over_a_line_that_splits_and_pauses_is_replayed_as_it_was(tmp_path, seed):
    log = tmp_path / "live.mcap"
    board = BookBoardPort(SensingBoard())  # a constant voltage would be a fault after 3 s
    line = Shaken(board, seed)
    try:
        live, output = digest(
            "run",
            "goal",
            "--robot",
            "book_2wd_stock",
            "--port",
            line.name,
            "--goal",
            "0.15 0.05",
            "--set",
            "robot.drive.polarity=checked_by_hand",
            "--for",
            "30s",  # on a busy machine; it ends at the goal
            "--record",
            log,
            "--digest",
            "--quiet",
        )
    finally:
        line.close()
        board.close()
    assert float(re.search(r"path ([\d.]+) m", output)[1]) > 0.02, output
    replayed, output = digest("replay", log, "--check")
    assert "bit for bit" in output
    assert replayed == live
