"""Turns of both wheels from the recorded frames of a board, finer than its counts.

Odometry knows the motors, the times of the edges, and that a wheel which coasts past a reversal is
counted in the wrong direction. Its estimate of a wheel's travel has about a third of the error of
the count.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from diffbotctl.blocks.odometry import OdometryBlock
from diffbotctl.calibrate.dead_reckoning import Floats
from diffbotctl.config.robot import Robot
from diffbotctl.messages import Encoders
from diffbotctl.runs.build_graph import build_block

TICK_RATIO = 0.3  # error of the estimate to that of the count


def estimated_turns(frames: Sequence[Encoders], robot: Robot) -> Floats:
    """(frames, 2): turns of the right and left wheel since the first frame."""
    block = build_block(OdometryBlock, robot, imu=None)
    block.reset()
    turns = np.zeros((len(frames), 2))
    start = np.zeros(2)
    lengths = [pi * side.wheel.diameter for side in (robot.drive.right, robot.drive.left)]
    for number, frame in enumerate(frames):
        block.react(frame.time, frame)
        assert block.wheels is not None
        left, right = block.wheels
        if number:
            turns[number] = (right.travel, left.travel)
            start += (right.start_correction, left.start_correction)
    # A better estimate of the phase at the start belongs to the first motion.
    turns[1:2] += start
    return np.asarray(np.cumsum(turns, axis=0) / lengths)
