"""The real firmware binary in the emulator, in lockstep with the plant, as a user runs it."""

from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run


def go(seed):
    options = RunOptions(port="emulated", fast=True, seed=seed, duration=60.0, digest=True)
    return Run(load("goal"), options).go()


def test_the_real_binary_drives_to_the_goal_and_twice_the_same():
    first, again = go(3), go(3)
    assert first.reached == 1 and first.ending.stopped is True
    assert first.link.damaged == 0 and first.link.lost == 0
    assert first.digest == again.digest


def test_falling_edges_work_like_rising_ones(tmp_path):
    robot = tmp_path / "falling.yaml"
    robot.write_text(
        "format: 1\nkind: robot\ninclude: book_2wd\ndrive: {encoder: {edge: falling}}\n"
    )
    setup = load("goal", str(robot))
    for port in ("sim", "emulated"):
        result = Run(setup, RunOptions(port=port, fast=True, seed=2, duration=60.0)).go()
        assert result.reached == 1, port
        assert abs(result.truth.pose.x - 1.0) < 0.05 and abs(result.truth.pose.y - 0.5) < 0.05
