"""What a program of a pipeline may write: each line is checked before it becomes a message."""

import json
from pathlib import Path

import pytest

from diffbotctl.config.configuration import ProgramUse
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.messages import Text
from diffbotctl.programs.link import ProgramLink


@pytest.fixture
def link():
    outputs = {"nose.smell": Text}
    return ProgramLink(ProgramUse("nose", ("./nose",), Path(), {}, outputs, timeout=0.5))


def test_a_message_is_stamped_by_the_engine(link):
    (delivery,) = link.messages(7, b'{"smell": {"text": "coffee"}}')
    assert delivery == ("nose.smell", Text(7, "coffee"))


@pytest.mark.parametrize("time", [0, 7, 10**18, -1, None, "now"])
def test_a_time_of_its_own_is_refused(link, time):
    line = json.dumps({"smell": {"time": time, "text": "coffee"}}).encode()
    with pytest.raises(RefusalError, match="leave it out"):
        link.messages(7, line)
