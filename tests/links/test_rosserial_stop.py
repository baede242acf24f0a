"""Stops by another process: the parser is brought to the start of a frame, wherever it was."""

from random import Random
from struct import pack

import pytest

from diffbotctl.links.rosserial_frames import encode
from diffbotctl.links.rosserial_stop import BoardParser, StandstillDetector, StopOrder, filler
from diffbotctl.links.rosserial_wheels import pair_frames
from diffbotctl.time import MILLISECOND as MS


def every_cut(written):
    for size in range(len(written) + 1):
        parser = BoardParser()
        parser.feed(written[:size])
        yield parser


def test_the_filler_ends_every_cut_of_a_pair_without_a_false_frame():
    rng = Random(7)
    for _ in range(300):
        written = pair_frames((100, 101), rng.randint(-255, 255), rng.randint(-255, 255))
        fill = filler(written)
        for parser in every_cut(written):
            assert parser.is_waiting or parser.feed(fill) == 0
            assert parser.is_waiting
        assert len(fill) <= 2 * len(written)


def test_the_filler_ends_other_frames_too():
    for written in (encode(0), encode(10, bytes(8)), encode(6, bytes(12)), bytes(64)):
        fill = filler(written)
        for parser in every_cut(written):
            parser.feed(fill)
            assert parser.is_waiting


def test_zeros_alone_would_turn_one_wheel_to_full_speed():
    # -101 is 9b ff ff ff; cut after 9b ff, zeros make 0xff9b of it, and their sum fits by chance.
    frame = encode(100, pack("<i", -100))
    cut = BoardParser()
    cut.feed(frame[:9])
    assert cut.feed(bytes(len(frame) - 9)) == 1
    cut = BoardParser()
    cut.feed(frame[:9])
    assert cut.feed(filler(frame)) == 0


def test_the_board_s_parser_takes_whole_frames_and_skips_the_rest():
    parser = BoardParser()
    assert parser.feed(b"\x00\xff\x00" + encode(100, bytes(4)) + encode(101, bytes(4))) == 2
    assert parser.feed(encode(100, bytes(4))[:-1] + b"\x00") == 0


def test_an_order_survives_the_channel():
    order = StopOrder(pair_frames((100, 101), 0, 0), 125, 126)
    assert StopOrder.unpack(order.pack()) == order


@pytest.mark.parametrize("moving", [False, True])
def test_standstill_needs_equal_counts_of_both_wheels_for_half_a_second(moving):
    detector = StandstillDetector(StopOrder(b"", 125, 126))
    for step in range(10):
        now = step * 60 * MS
        detector.receive(now, encode(125, pack("<i", 40)))
        assert not detector.stands or step == 9
        right = 7 + step if moving else 7
        detector.receive(now, encode(126, pack("<i", right)) + encode(127, pack("<f", step)))
    assert detector.stands is not moving


def test_silence_is_no_standstill():
    detector = StandstillDetector(StopOrder(b"", 125, 126))
    detector.receive(0, encode(125, pack("<i", 4)) + encode(126, pack("<i", 4)))
    detector.receive(9_000 * MS, b"")
    assert not detector.stands
