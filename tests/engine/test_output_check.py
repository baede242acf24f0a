"""What a block may return: the class of the message, the type of each field, finite numbers."""

import json
from fractions import Fraction
from math import inf, nan

import numpy
import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.config import registry
from diffbotctl.config.load import load
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.loop import Engine
from diffbotctl.engine.output_check import OutputError, check_output
from diffbotctl.errors import RunError
from diffbotctl.graph import Graph, Node
from diffbotctl.messages import Goal, Odometry, Path, Range, Scan, Stop, Text, Twist, Volts
from diffbotctl.runs.options import RunOptions
from diffbotctl.runs.run import Run


class Single(Block):
    twist = Out(Twist)


class Pair(Block):
    twist = Out(Twist)
    stop = Out(Stop)


def of(kind):
    return type("One", (Block,), {"out": Out(kind)})()


STATE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def leaves(value):
    """All values of a message that are no tuples."""
    return (
        [leaf for part in value for leaf in leaves(part)] if isinstance(value, tuple) else [value]
    )


@pytest.mark.parametrize(
    ("block", "output"),
    [
        (Single(), Twist(numpy.int64(1), numpy.float32(0.1), Fraction(1, 2))),
        (of(Scan), Scan(1, numpy.float32(0.0), 0.1, tuple(numpy.array([1.0, inf])))),
        (of(Path), Path(1, (Goal(1, numpy.int32(2), numpy.float16(0.5), 0.0, None),))),
        (
            of(Odometry),
            Odometry(1, 0, 0, numpy.int8(2), 0, 0, (numpy.float64(1), *STATE[1:])),
        ),
    ],
)
def test_numbers_of_other_classes_become_plain_ones(block, output):
    plain = check_output(block, output)
    assert plain == output and type(plain) is type(output)
    assert json.loads(json.dumps(plain)) is not None
    assert {type(leaf) for leaf in leaves(plain)} <= {int, float, str, type(None)}
    assert check_output(block, plain) is plain


class Numpy(Block):
    """Drives forward at a speed that numpy has computed."""

    twist = In(Twist)
    out = Out(Twist, name="twist")

    def react(self, now, twist):
        return twist and Twist(now, numpy.float32(0.5) * numpy.float32(twist.linear), 0.0)


def test_a_run_goes_on_with_numbers_of_numpy(tmp_path, monkeypatch):
    monkeypatch.setitem(registry.BLOCKS, "numpy", f"{__name__}:Numpy")
    file = tmp_path / "numpy.yaml"
    file.write_text(
        """
format: 1
kind: pipeline
robot: {use: book_2wd, in: {wheels: kinematics.wheels}}
blocks:
  odometry: {block: odometry, in: {encoders: robot.encoders}}
  follower: {block: goal_follower, in: {odometry: odometry.odometry, goal: operator.goal}}
  half: {block: numpy, in: {twist: follower.twist}}
  kinematics: {block: diff_drive, in: {twist: half.twist}}
"""
    )
    options = RunOptions(fast=True, duration=2.0, goals=(Goal(0, 0, 2.0, 0.0, None),))
    run = Run(load(str(file)), options)
    result = run.go()
    assert result.failure is None, str(result.failure)
    assert run.plant.chassis.travel > 0.1


@pytest.mark.parametrize(
    ("block", "output"),
    [
        (Single(), None),
        (Single(), Twist(1, 0.5, 0)),
        (Single(), Twist(1, numpy.float64(0.5), numpy.float32(0.1))),
        (Pair(), None),
        (Pair(), (None, None)),
        (Pair(), (Twist(1, 0.0, 0.0), Stop(1, "", "", False))),
        (of(Volts), Volts(1, nan)),  # a fault of the board
        (of(Scan), Scan(1, 0.0, 0.1, (inf, 0.0))),  # clear
        (of(Goal), Goal(1, 2, 0.0, 0.0, None)),
        (of(Path), Path(1, (Goal(1, 2, 0.0, 0.0, 1.0),))),
        (of(Odometry), Odometry(1, 0.0, 0.0, 0.0, 0.0, 0.0, STATE)),
    ],
)
def test_what_fits_passes(block, output):
    check_output(block, output)


@pytest.mark.parametrize(
    ("block", "output", "text"),
    [
        (Single(), Twist(1, "fast", 0.0), "output twist: linear is the text 'fast', not a number"),
        (Single(), Twist(1, nan, 0.0), "linear is nan, not a finite number"),
        (Single(), Twist(1, 0.0, -inf), "angular is -inf, not a finite number"),
        (Single(), Twist(1, None, 0.0), "linear is None, not a number"),
        (Single(), Twist(1, True, 0.0), "linear is True (bool), not a number"),
        (Single(), Twist(1.5, 0.0, 0.0), "time is 1.5 (float), not an integer"),
        (Single(), Text(1, "no"), "instead of a Twist"),
        (Single(), (1, 0.5, 0.0), "instead of a Twist"),
        (Single(), 0.5, "0.5 (float) instead of a Twist"),
        (Pair(), Twist(1, 0.0, 0.0), "a tuple of 2, one for each output: twist, stop"),
        (Pair(), (Twist(1, 0.0, 0.0),), "a tuple of 2"),
        (Pair(), (None, Stop(1, 7, "", False)), "output stop: code is 7 (int), not a text"),
        (of(Range), Range(1, 0.2, "fine"), "state is the text 'fine', not one of 'clear'"),
        (of(Scan), Scan(1, 0.0, 0.1, [1.0]), "distances is [1.0] (list)"),
        (of(Scan), Scan(1, 0.0, 0.1, (1.0, "x")), "distances"),
        (of(Goal), Goal(1, 2, 0.0, 0.0, nan), "heading is nan"),
        (of(Odometry), Odometry(1, 0.0, 0.0, 0.0, 0.0, 0.0, STATE[:5]), "covariance"),
        (of(Odometry), Odometry(1, 0.0, 0.0, 0.0, 0.0, 0.0, (nan, *STATE[1:])), "covariance"),
        (of(Path), Path(1, (Goal(1, 2, 0.0, nan, None),)), "y is nan, not a finite number"),
        (of(Path), Path(1, (Goal(1, 2, "0.5", 0.0, None),)), "x is the text '0.5', not a number"),
        (Block(), 3, "it has no output"),
    ],
)
def test_what_does_not_fit_is_named(block, output, text):
    with pytest.raises(OutputError) as error:
        check_output(block, output)
    assert text in str(error.value)


class Late(Block):
    """Right 30 times, then wrong."""

    go = In(Text)
    twist = Out(Twist)

    def reset(self):
        self.count = 0

    def react(self, now, go):
        self.count += 1
        return Twist(now, "fast" if self.count > 30 else 0.1, 0.0)


def test_a_block_of_somebody_else_is_checked_at_any_time():
    engine = Engine(Graph([Node("late", Late(), {"go": "a.b"})], {"a.b": Text}), [], VirtualClock())
    for number in range(30):
        engine.deliver(number, [("a.b", Text(number, ""))])
    with pytest.raises(RunError) as error:
        engine.deliver(30, [("a.b", Text(30, ""))])
    problem = error.value.problems[0]
    assert (problem.code, problem.line) == ("E-BLOCK-OUTPUT", Late.react.__code__.co_firstlineno)
    assert problem.cause.startswith("block late: output twist: ")
    assert "linear is the text 'fast'" in problem.cause
