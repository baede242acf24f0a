"""What was done on an emulated board does not count for a real one."""

import os
from pathlib import Path

import pytest

from diffbotctl.cli.start_guide import SetupGuide
from diffbotctl.cli.start_steps import CHAPTERS, GuideProgress
from diffbotctl.drivers.robot_ports import mark_emulated

ALL = [chapter.key for chapter in CHAPTERS]
OWN, RESULTS = "robots/mine.yaml", "robots/mine.simulated.yaml"


@pytest.fixture
def ports(tmp_path, monkeypatch):
    """The devices of an emulated board and of another one; the robot has both files."""
    monkeypatch.chdir(tmp_path)
    Path("robots").mkdir()
    for file in (OWN, RESULTS):
        Path(file).touch()
    ends = [*os.openpty(), *os.openpty()]
    emulated, real = os.ttyname(ends[1]), os.ttyname(ends[3])
    mark_emulated(emulated)
    yield {"emulated": emulated, "real": real}
    for end in ends:
        os.close(end)


def visit(port):
    progress = GuideProgress(Path("start.json"), "here")
    guide = SetupGuide(progress, OWN, port, None, None)
    return guide, progress


@pytest.mark.parametrize("first, then", [("emulated", "real"), ("real", "emulated")])
def test_another_kind_of_board_begins_with_the_board(ports, first, then):
    _, progress = visit(ports[first])
    for key in ALL:
        progress.finish(key)
    guide, progress = visit(ports[first])
    assert progress.done == ALL  # the next visit with the same board
    assert guide.robot == (RESULTS if first == "emulated" else OWN)
    guide, progress = visit(ports[then])
    assert progress.done == ["simulated", "robot"]
    assert guide.robot == (RESULTS if then == "emulated" else OWN)


def test_without_its_results_an_emulated_board_is_begun_anew(ports):
    _, progress = visit(ports["emulated"])
    for key in ALL:
        progress.finish(key)
    Path(RESULTS).unlink()
    _, progress = visit(ports["emulated"])
    assert progress.done == ["simulated", "robot"]
