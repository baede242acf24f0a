"""Whole runs of the robots that exist in the simulator only."""

from math import hypot

import pytest

from diffbotctl.config.load import load
from diffbotctl.messages import Goal
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run
from tests.sampling import each_once


def go(pipeline, robot=None, sets=(), **options):
    options = {"fast": True, "duration": 120.0, **options}
    return Run(load(pipeline, robot, sets), RunOptions(**options)).go()


GOALS = {"distance": 1, "square": 4, "goal": 1}


@each_once(robot=["turtle", "turtlebot3_burger"], pipeline=GOALS, seed=[0, 5])
def test_the_pipelines_for_every_robot_drive_them_too(robot, pipeline, seed):
    result = go(pipeline, robot, seed=seed)
    assert (result.reached, result.ending.code) == (GOALS[pipeline], 0)
    assert result.ending.stopped is True
    assert not result.stops
    estimated, true = result.odometry, result.truth.pose
    assert hypot(estimated.x - true.x, estimated.y - true.y) < 0.03


def test_the_turtle_reaches_goals_in_its_field():
    result = go("turtle", goals=(Goal(0, 0, 8.0, 8.0, None), Goal(0, 0, 2.0, 9.0, 0.0)))
    assert result.reached == 2
    # goal, pose and truth are all in the frame of the field
    for pose in (result.odometry, result.truth.pose):
        assert (pose.x, pose.y) == pytest.approx((2.0, 9.0), abs=0.1)


def test_a_wall_stops_the_burger_at_its_margin():
    sets = ["world.walls=[{from: [0.6 m, -1 m], to: [0.6 m, 1 m]}]", "follower.patience=2 s"]
    result = go("goal", "turtlebot3_burger", sets, goals=(Goal(0, 0, 1.0, 0.0, None),), seed=3)
    assert (result.reached, result.ending.code) == (0, 1)
    assert "obstacle" in [stop.code for stop in result.stops]
    # 38 mm of body before the axle and 50 mm of margin: it should stand near 0.512 m
    assert 0.45 < result.truth.pose.x < 0.6 - 0.038


def test_the_burger_stays_within_its_limits():
    run = Run(load("wander"), RunOptions(fast=True, duration=20.0, seed=2))
    fastest = [0.0, 0.0]
    plant = run.plant

    def look():
        radius, (left, right) = 0.033, plant.wheels
        fastest[0] = max(fastest[0], abs(left.speed + right.speed) * radius / 2)
        fastest[1] = max(fastest[1], abs(right.speed - left.speed) * radius / 0.160)

    run.engine.idle = look
    run.go()
    assert 0.15 < fastest[0] < 0.22 * 1.05  # its loop may overshoot by a little
    assert 0.8 < fastest[1] < 2.84
