"""An instant that takes too long: a warning with the block's name, and a stop."""

import re
import time

import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.instant_monitor import InstantMonitor, instant_limits
from diffbotctl.engine.loop import Engine
from diffbotctl.graph import Graph, Node
from diffbotctl.messages import LogLine, Stop, Text
from diffbotctl.time import SECOND

SOURCES = {"a.b": Text, "operator.log": LogLine, "operator.halt": Stop}


class Sleeper(Block):
    """Sleep for as many seconds as the text states."""

    text = In(Text)
    slept = Out(Text)

    def react(self, now, text):
        time.sleep(float(text.text))
        return Text(now, "slept")


def events_of(naps, deadman=0.3):
    """The events of a run with a reaction for each of these times (s)."""
    events = []
    engine = Engine(
        Graph([Node("sleeper", Sleeper(), {"text": "a.b"})], SOURCES),
        [],
        VirtualClock(),
        limits=instant_limits(deadman, 20.0, is_real=False),
        sinks={
            "operator.log": [lambda now, line: events.append(line)],
            "operator.halt": [lambda now, stop: events.append(stop)],
        },
    )
    for number, nap in enumerate(naps):
        engine.monitor.begin()
        engine.deliver(10 * number, [("a.b", Text(0, str(nap)))])
        waits = engine.stop_waits
        engine._deliver_events(engine.monitor)
        assert waits == any(isinstance(event, Stop) for event in events[-1:])
    return events


def took(stop, names):
    """The times (s) in a cause, without those in which a busy machine ran something else."""
    return [float(text) for text in re.findall(rf"(?:{names}) (0\.\d+) s", stop.cause)]


def test_a_quick_block_causes_nothing():
    assert events_of([0.0, 0.001]) == []


def test_the_first_overrun_is_a_warning_with_the_block_s_name():
    warning, *more = events_of([0.07, 0.07])
    assert warning.level == "warning" and "block sleeper took" in warning.text
    assert "every 50 ms" in warning.text and not more


def test_more_than_half_the_dead_man_s_time_stops():
    warning, stop = events_of([0.2])
    assert warning.level == "warning"
    assert (stop.code, stop.latched) == ("block_overrun", True)
    assert took(stop, "block sleeper took") == [pytest.approx(0.2, abs=0.05)]


def test_two_blocks_that_are_slow_together_stop_and_are_named():
    stops = []
    graph = Graph(
        [
            Node("first", Sleeper(), {"text": "a.b"}),
            Node("second", Sleeper(), {"text": "a.b"}),
        ],
        SOURCES,
    )
    engine = Engine(
        graph,
        [],
        VirtualClock(),
        limits=instant_limits(1.0, 1.0, is_real=False),
        sinks={"operator.halt": [lambda now, stop: stops.append(stop)]},
    )
    engine.monitor.begin()
    engine.deliver(0, [("a.b", Text(0, "0.4"))])
    engine._deliver_events(engine.monitor)
    (stop,) = stops
    assert (stop.code, stop.latched) == ("block_overrun", True)
    assert took(stop, "first|second") == [pytest.approx(0.4, abs=0.05)] * 2
    engine.monitor.begin()
    engine.deliver(10, [("a.b", Text(0, "0.1"))])
    engine._deliver_events(engine.monitor)
    assert len(stops) == 1, "the times of two steps are not added"


def test_time_that_blocks_took_is_not_reported_as_a_computer_that_did_not_run():
    monitor = InstantMonitor(instant_limits(2.0, 1.0, is_real=True))
    monitor.begin()
    for name in ("left", "right"):
        monitor.timed(name, time.sleep)(0.4)
    assert not monitor.take_events()
    monitor.check_step(round(1.3 * SECOND))
    (event,) = monitor.take_events()
    assert event.message.code == "block_overrun"
    assert took(event.message, "left|right") == [pytest.approx(0.4, abs=0.05)] * 2
    monitor.close()


@pytest.mark.parametrize(
    ("is_real", "late", "code"),
    [(True, 0.31, "host_frozen"), (True, 0.29, None), (False, 5.0, None)],
)
def test_a_late_wake_up_stops_a_real_robot(is_real, late, code):
    monitor = InstantMonitor(instant_limits(0.3, 20.0, is_real))
    monitor.check_wake_up(round(late * SECOND))
    assert [event.message.code for event in monitor.take_events()] == ([code] if code else [])
    monitor.close()


def test_a_suspended_engine_is_distinguished_from_one_that_computes():
    monitor = InstantMonitor(instant_limits(0.3, 20.0, is_real=True))
    monitor.begin()
    monitor.check_step(round(2.0 * SECOND))
    (event,) = monitor.take_events()
    assert event.message.code == "host_frozen" and "did not run for 2.00 s" in event.message.cause
    monitor.close()


def test_a_long_step_without_a_slow_block_stops_a_real_robot():
    monitor = InstantMonitor(instant_limits(0.3, 20.0, is_real=True))
    monitor.begin()
    begin, spent_before = time.monotonic_ns(), time.thread_time_ns()
    while time.thread_time_ns() - spent_before < 0.2 * SECOND:
        pass
    monitor.check_step(time.monotonic_ns() - begin)
    (event,) = monitor.take_events()
    assert event.message.code == "block_overrun" and "no slow block" in event.message.cause
    monitor.close()


@pytest.mark.parametrize("check", ["check_step", "check_wake_up"])
def test_a_pause_of_a_robot_that_stands_is_a_warning_once(check):
    monitor = InstantMonitor(instant_limits(0.3, 20.0, is_real=True), is_driving=lambda: False)
    monitor.begin()
    for _ in range(2):
        getattr(monitor, check)(round(2.0 * SECOND))
    (event,) = monitor.take_events()
    assert event.message.level == "warning" and "2.00 s" in event.message.text
    assert not monitor.stops
    monitor.close()
