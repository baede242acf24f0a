"""Which wheels are seen to turn."""

import pytest

from diffbotctl.emulator.virtual_board import WheelReport

MS = 1_000_000


def told(*looks):
    """What is said while (ms, left, right) ... are looked at."""
    seen = WheelReport()
    said = [seen.look(time * MS, (left, right)) for time, left, right in looks]
    return [each for each in said if each]


@pytest.mark.parametrize(
    "looks, said",
    [
        ([(0, 0, 0), (500, 0, 0)], []),
        (
            [(0, 0, 0), (1, 5, 0), (100, 5, 0), (200, 0, 0), (300, 0, 0)],
            ["the left wheel turns forward, the right wheel stands", "both wheels stand"],
        ),
        # over after 50 ms: no eye sees that
        ([(0, 5, 0), (50, 0, 0), (500, 0, 0)], []),
        # a wheel that trembles below 0.3 rad/s stands
        ([(0, 0.2, -0.2), (500, -0.2, 0.2)], []),
        # through zero: one wheel turns back, told once it has lasted
        (
            [(0, 5, 5), (100, 5, 5), (200, 0, 5), (210, -5, 5), (300, -5, 5), (400, -5, 5)],
            [
                "both wheels turn forward",
                "the left wheel turns backward, the right wheel turns forward",
            ],
        ),
    ],
)
def test_what_is_seen(looks, said):
    assert told(*looks) == said
