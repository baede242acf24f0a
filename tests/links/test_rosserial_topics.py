"""The table of topics, from clean, damaged and contradicting answers."""

import struct

import pytest

from diffbotctl.links.rosserial_topics import (
    BOOL,
    EMPTY,
    FLOAT32,
    INT32,
    PUBLISHER,
    SUBSCRIBER,
    TopicNames,
    Topics,
    read_topic_info,
)


def info(number, name, kind=INT32, buffer=512):
    """The payload of a TopicInfo."""
    texts = b"".join(struct.pack("<I", len(text)) + text.encode() for text in (name, *kind))
    return struct.pack("<H", number) + texts + struct.pack("<i", buffer)


BOOK = [
    (PUBLISHER, info(125, "left_ticks")),
    (PUBLISHER, info(126, "right_ticks")),
    (PUBLISHER, info(127, "obstacle_distance", FLOAT32)),
    (SUBSCRIBER, info(100, "set_left_speed")),
    (SUBSCRIBER, info(101, "set_right_speed")),
    (SUBSCRIBER, info(102, "reset", BOOL)),
]


def topics_from(answers, names=TopicNames()):  # noqa: B008  (a NamedTuple never changes)
    topics = Topics(names)
    for role, payload in answers:
        topics.learn(role, payload)
    return topics


def test_recorded_topic_info_is_read():
    payload = bytes.fromhex(
        "7d000a0000006c6566745f7469636b730e0000007374645f6d7367732f496e743332"
        "200000006461353930396662653337386165616638356535343765383330636331626237"
        "00020000"
    )
    found = read_topic_info(payload)
    assert found == (125, "left_ticks", INT32, 512)
    assert all(read_topic_info(payload[:cut]) is None for cut in range(len(payload)))


def test_order_of_answers_does_not_matter():
    assert topics_from(reversed(BOOK)).complete
    assert topics_from(BOOK).numbers == topics_from(reversed(BOOK)).numbers


@pytest.mark.parametrize("absent", range(6))
def test_each_topic_is_needed_and_a_later_answer_fills_it_in(absent):
    topics = topics_from(BOOK[:absent] + BOOK[absent + 1 :])
    assert not topics.complete and len(topics.missing) == 1
    topics.learn(*BOOK[absent])
    assert topics.complete


def test_leading_slash_and_empty_reset():
    slashed = [
        *BOOK[:3],
        (SUBSCRIBER, info(100, "/set_left_speed")),
        (SUBSCRIBER, info(101, "/set_right_speed")),
        (SUBSCRIBER, info(102, "/reset", EMPTY)),
    ]
    assert topics_from(slashed).complete
    assert topics_from(slashed, TopicNames(*(f"/{name}" for name in TopicNames()))).complete


def test_topic_without_a_name_is_not_needed():
    assert topics_from(BOOK[:5], TopicNames(reset="")).complete
    assert topics_from(BOOK[:2] + BOOK[3:], TopicNames(distance="")).complete


@pytest.mark.parametrize(
    "damaged",
    [
        info(7, "set_left_speed"),  # below the first topic's number
        info(100, "set_left_speed", buffer=-1),
        info(100, "set_left_speed", ("std_msgs/Int16", INT32[1])),
        info(100, "set_left_speed", (INT32[0], FLOAT32[1])),
        info(100, "set_left_speeg"),
        info(100, "set_left_speed")[:-1],
    ],
)
def test_damaged_answer_is_ignored(damaged):
    topics = topics_from([*BOOK[:3], (SUBSCRIBER, damaged), *BOOK[4:]])
    assert "set_left_speed" in topics.missing and not topics.complete


def test_wrong_type_is_named():
    topics = topics_from([(SUBSCRIBER, info(100, "set_left_speed", ("std_msgs/Int16", "x")))])
    assert topics.problems == {
        "set_left_speed": "the sketch declares set_left_speed as std_msgs/Int16, "
        "this driver expects std_msgs/Int32"
    }


def test_one_number_for_two_topics_drops_both():
    topics = topics_from([*BOOK, (SUBSCRIBER, info(100, "set_right_speed"))])
    assert topics.missing == ["set_left_speed"] and not topics.complete


def test_gap_in_the_subscribers_numbers_is_not_trusted():
    # A flipped bit made 109 of 101, and another one corrected the sum.
    topics = topics_from([*BOOK[:4], (SUBSCRIBER, info(109, "set_right_speed")), BOOK[5]])
    assert not topics.missing and not topics.complete
    assert not topics.are_confirmed(["set_left_speed", "set_right_speed"])
    topics.learn(*BOOK[4])
    assert topics.complete
    assert topics.numbers["set_right_speed"] == 101


def test_other_subscribers_fill_the_numbers_between():
    shifted = [
        *BOOK[:3],
        (SUBSCRIBER, info(101, "set_left_speed")),
        (SUBSCRIBER, info(102, "set_right_speed")),
        (SUBSCRIBER, info(103, "reset", BOOL)),
    ]
    topics = topics_from(shifted)
    assert not topics.complete
    topics.learn(SUBSCRIBER, info(100, "lamp", BOOL))
    assert topics.complete


@pytest.mark.parametrize(
    ("topic", "length", "expected"),
    [
        (125, 4, True),
        (125, 500, False),  # ticks have four bytes
        (10, 8, True),
        (10, 9, False),
        (0, 90, True),
        (0, 17, False),  # less than a TopicInfo with empty texts
        (50, 4, False),  # no such topic
        (130, 300, True),  # a topic not known yet
    ],
)
def test_plausible_lengths(topic, length, expected):
    assert topics_from(BOOK).plausible(topic, length) is expected
