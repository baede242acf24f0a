"""One recorded run of the shipped goal, for all that only look at it."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run


@pytest.fixture(scope="session")
def goal(tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "goal.mcap"
    Run(load("goal"), RunOptions(fast=True, record=path, seed=3)).go()
    return path


@pytest.fixture(scope="session")
def other(tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "other.mcap"
    Run(load("goal"), RunOptions(fast=True, record=path, seed=4)).go()
    return path
