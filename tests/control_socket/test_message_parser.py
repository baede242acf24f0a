"""Messages of other programs: the short way for usual ones reads what the full check reads."""

from math import inf, nan
from typing import Annotated, NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.message_parser import TEXT_MAX_LENGTH, MessageError, message_parser
from diffbotctl.messages import Field, Text, Twist

VALUES = st.one_of(
    st.sampled_from([True, 1, -1, 10**30, 0.5, 3.0, inf, -inf, nan, "", "text", "inf", None, []]),
    st.just("x" * (TEXT_MAX_LENGTH + 1)),
)


class Sample(NamedTuple):
    """All types of usual fields; `time` does not come first."""

    share: Annotated[float, Field("1", "", 0.0, 1.0)]
    time: int
    count: int
    free: float
    seen: bool
    text: str = "none"


FIELDS = ["share", "count", "free", "seen", "text", "other"]


def outcome(parse, values):
    try:
        return repr(parse(values, 7))
    except MessageError as error:
        return str(error)


@given(st.dictionaries(st.sampled_from(FIELDS), VALUES))
def test_both_ways_read_the_same(values):
    usual, full = message_parser(Sample), message_parser(Sample)
    # With a field more no message is usual; the full check ignores `time`.
    assert outcome(usual, values) == outcome(full, {**values, "time": None})


def test_usual_messages_are_stamped():
    values = {"share": 0.5, "count": 3, "free": -1e300, "seen": False, "text": "a"}
    assert message_parser(Sample)(values, 7) == Sample(0.5, 7, 3, -1e300, False, "a")
    assert message_parser(Text)({"text": "a"}, 7) == Text(7, "a")
    assert message_parser(Twist)({"linear": 1, "angular": 0.0}, 7) == Twist(7, 1, 0.0)
