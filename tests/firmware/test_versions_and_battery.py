"""The shipped image: hosts of other versions, and a low battery."""

from dataclasses import replace

import pytest

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import encode_payload, pack
from diffbotctl.links.diffbot_frames import CapabilityCode, ModeCode, RefusalCode
from tests.support.board_bench import BOOK, PICO, RADIO, BoardBench, speed

BATTERY = 2  # analog channel
# 3:1 divider: 6.6 V are 2.2 V at the pin.
WATCHED = replace(BOOK, battery_channel=BATTERY, battery_divider=3.0, battery_low=6.6)


@pytest.mark.parametrize(
    ("settings", "missing"), [(BOOK, {CapabilityCode.EVERY_EDGE}), (PICO, set())]
)
def test_the_hello_states_lengths_and_capabilities(settings, missing):
    with BoardBench(settings=settings) as bench:
        bench.wait(30)
        hello = bench.ask()
        assert hello.version == frames.VERSION == 3
        assert hello.receive == frames.RECEIVE_MOST
        assert hello.settings_size == len(pack(BOOK.frame()))
        capabilities = {code for code in CapabilityCode if hello.capabilities >> code & 1}
        assert capabilities == set(CapabilityCode) - missing


@pytest.mark.parametrize(
    ("more", "refusal"),
    [(b"\0" * 10, RefusalCode.NONE), (b"\0\0\1", RefusalCode.UNKNOWN)],
)
def test_settings_of_a_later_host(more, refusal):
    """Fields that the board does not know must be zero."""
    with BoardBench() as bench:
        bench.wait(30)
        bench.ask()
        bench.send(RADIO, encode_payload(pack(BOOK.frame()) + more))
        arrived = bench.wait(150)
        answer = next(h.frame for h in arrived if isinstance(h.frame, frames.AnswerFrame))
        assert answer.refusal == refusal
        assert answer.settings == (0 if refusal else BOOK.mark())


def drive(bench, seconds, millivolts):
    """Drive for a while; the mode at the end."""
    bench.turn(seconds + 0.2)
    for number in range(round(seconds * 20)):
        bench.send(RADIO, speed(number, 5, 5))
        bench.run(bench.now + 50_000_000, {BATTERY: millivolts})
    return ModeCode(bench.state().mode)


def flags(bench):
    items = [each.frame for each in bench.received if isinstance(each.frame, frames.StatusFrame)]
    return [item.value for item in items if item.item == frames.ItemCode.FLAGS][-1]


def test_a_low_battery_is_reported_and_then_stops_the_robot():
    with BoardBench(settings=WATCHED) as bench:
        bench.ready()
        bench.run(bench.now + 100_000_000, {BATTERY: 2400})
        bench.claim()
        assert drive(bench, 1.5, 2150) is ModeCode.SPEED  # as when it accelerates
        assert not flags(bench) & frames.FLAG_BATTERY
        assert drive(bench, 2.0, 2150) is ModeCode.SPEED
        assert flags(bench) & frames.FLAG_BATTERY
        assert drive(bench, 8.0, 2150) is ModeCode.BATTERY
        assert bench.duty == [0.0, 0.0]
        bench.claim()
        assert drive(bench, 0.2, 2400) is ModeCode.BATTERY  # until an operator consents
        bench.send(RADIO, frames.ActionFrame(frames.ActionCode.CLEAR, 0))
        bench.claim()
        assert drive(bench, 1.0, 2150) is ModeCode.BATTERY  # it is still low


def test_a_battery_that_recovers_lets_the_robot_drive_again():
    with BoardBench(settings=WATCHED) as bench:
        bench.ready()
        for _ in range(120):
            bench.run(bench.now + 100_000_000, {BATTERY: 2150})
        assert ModeCode(bench.state().mode) is not ModeCode.BATTERY  # it stands: only reported
        assert flags(bench) & frames.FLAG_BATTERY
        for _ in range(20):
            bench.run(bench.now + 100_000_000, {BATTERY: 2400})
        bench.claim()
        assert drive(bench, 0.5, 2400) is ModeCode.SPEED


def test_a_battery_that_is_not_measured_is_not_low():
    with BoardBench() as bench:
        bench.ready()
        bench.claim()
        assert drive(bench, 12.0, 0) is ModeCode.SPEED
        assert not flags(bench) & frames.FLAG_BATTERY
