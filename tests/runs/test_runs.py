"""Whole runs of the shipped pipelines, engine and plant, without a screen."""

import pytest

from diffbotctl.config.load import load
from diffbotctl.messages import Goal
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run


def go(pipeline, robot=None, sets=(), **options):
    options.setdefault("fast", True)
    options.setdefault("duration", 120.0)
    return Run(load(pipeline, robot, sets), RunOptions(**options)).go()


@pytest.mark.parametrize("robot", ["book_2wd", "book_2wd_counts", "book_2wd_stock"])
def test_the_shipped_goal_is_reached_on_every_kind_of_board(robot):
    result = go("goal", robot, seed=11)
    assert (result.reached, result.ending.code) == (1, 0)
    assert result.ending.stopped is True


@pytest.mark.parametrize("pipeline, goals", [("square", 4), ("distance", 1)])
def test_the_other_pipelines_reach_all_their_goals(pipeline, goals):
    result = go(pipeline, seed=4)
    assert (result.reached, result.ending.code) == (goals, 0)


@pytest.mark.parametrize(
    "x, y, heading",
    [
        (-0.5, 0.0, 0.0),  # behind
        (0.0, 0.5, None),  # beside, any heading
        (1.8, 0.0, -3.0),  # beyond the 1.5 m where the book's follower gave up
        (0.0, 0.1, 0.0),
    ],
)
def test_goals_that_the_book_s_program_did_not_reach(x, y, heading):
    result = go("goal", sets=["world.walls=[]"], goals=(Goal(0, 0, x, y, heading),), seed=2)
    assert result.reached == 1


def test_a_wall_blocks_the_goal_and_the_robot_stops_before_it():
    sets = ["world.walls=[{from: [0.6 m, -1 m], to: [0.6 m, 1 m]}]", "follower.patience=2 s"]
    result = go("goal", sets=sets, goals=(Goal(0, 0, 1.0, 0.0, None),), seed=3)
    assert result.reached == 0 and result.ending.code == 1
    assert "blocked" in result.ending.cause
    assert result.truth.pose.x + 0.08 < 0.6  # the body's front has not touched it


def test_same_seed_same_digest_and_another_seed_another():
    first, again, other = (go("goal", seed=seed, digest=True).digest for seed in (5, 5, 6))
    assert first == again != other


def test_paced_and_unpaced_runs_have_one_digest():
    goal = (Goal(0, 0, 0.1, 0.0, None),)
    fast = go("goal", goals=goal, seed=5, digest=True)
    paced = go("goal", goals=goal, seed=5, digest=True, fast=False)
    assert fast.digest == paced.digest
