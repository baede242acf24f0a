"""Talker and listener."""

from diffbotctl.blocks.listener import Listener
from diffbotctl.blocks.talker import Talker
from diffbotctl.messages import Text


def test_the_talker_counts():
    talker = Talker(greeting="hi", period=0.1)
    assert talker.react(100, 100) == Text(100, "hi 1")
    assert talker.react(150, None) is None
    assert talker.react(200, 200) == Text(200, "hi 2")
    talker.reset()
    assert talker.react(300, 300) == Text(300, "hi 1")


def test_the_listener_answers():
    assert Listener().react(100, Text(90, "hi 1")) == Text(90, "heard: hi 1")
    assert Listener().react(100, None) is None
