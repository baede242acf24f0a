"""Reports of which wheels turn."""

import pytest

from diffbotctl.emulator.virtual_board import WheelReport
from diffbotctl.time import MILLISECOND as MS


def reports(*samples):
    """The reports for samples of (ms, left rad/s, right rad/s)."""
    report = WheelReport()
    lines = [report.update(time * MS, (left, right)) for time, left, right in samples]
    return [line for line in lines if line]


@pytest.mark.parametrize(
    "samples, lines",
    [
        ([(0, 0, 0), (500, 0, 0)], []),
        (
            [(0, 0, 0), (1, 5, 0), (100, 5, 0), (200, 0, 0), (300, 0, 0)],
            ["the left wheel turns forward, the right wheel stands", "both wheels stand"],
        ),
        # shorter than 60 ms: not reported
        ([(0, 5, 0), (50, 0, 0), (500, 0, 0)], []),
        # a wheel that moves below 0.3 rad/s stands
        ([(0, 0.2, -0.2), (500, -0.2, 0.2)], []),
        # through zero: one wheel reverses, reported after 60 ms
        (
            [(0, 5, 5), (100, 5, 5), (200, 0, 5), (210, -5, 5), (300, -5, 5), (400, -5, 5)],
            [
                "both wheels turn forward",
                "the left wheel turns backward, the right wheel turns forward",
            ],
        ),
    ],
)
def test_changes_of_motion_are_reported(samples, lines):
    assert reports(*samples) == lines
