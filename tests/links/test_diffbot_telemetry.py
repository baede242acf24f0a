"""What a board's frames tell of the way of our commands, by hand."""

from math import isnan

import pytest

from diffbotctl.links.diffbot_frames import COMMAND_AGE_NONE, StateFrame
from diffbotctl.links.diffbot_telemetry import COMMAND_AGE, TICK, SentCommand, Telemetry
from diffbotctl.time import MILLISECOND

WAY = 5  # ms from the board's stamp to the frame's arrival; the board's clock began with ours
NUMBER = 5  # of the command that matters


def state(board, command, age):
    """A frame stamped at `board` ms, whose command took hold `age` ms before; None: long ago."""
    units = COMMAND_AGE_NONE if age is None else age * MILLISECOND // COMMAND_AGE
    return StateFrame(
        boot=1,
        sequence=board // 25 % 64,
        dropped=0,
        reserved=0,
        mode=2,
        command_age=units,
        time=board * MILLISECOND // TICK,
        left=0,
        right=0,
        range=0,
        command=command,
        left_age=0,
        right_age=0,
    )


@pytest.mark.parametrize(
    ("written", "seen", "latency"),
    [
        # Written at 100 ms, took hold at 115, shown in the frame that arrives at 130.
        ([100], [(125, 10)], 30),
        # Another host's command of the same number, in force since 65 ms: no echo.
        ([100], [(125, 60)], None),
        # The same, in force for longer than a frame can tell.
        ([100], [(125, None)], None),
        # First the other's, then ours, which took hold at 130 ms and arrives at 155.
        ([100], [(125, 60), (150, 20)], 55),
        # Only the first frame that shows it counts.
        ([100], [(125, 10), (150, 35)], 30),
        # A stop goes out at 40 and again at 100 ms. What took hold at 75 is the first one, and when
        # that was written is no longer known; the second took hold at 140 and arrives at 155.
        ([40, 100], [(125, 50), (150, 10)], 55),
    ],
)
def test_latency_is_that_of_a_command_of_ours(written, seen, latency):
    telemetry = Telemetry(115200)
    for board in (0, 25, 50):
        telemetry.read((board + WAY) * MILLISECOND, state(board, NUMBER, None))
    for time in written:
        telemetry.wrote(NUMBER, SentCommand(time * MILLISECOND, 1.0, 1.0, "wheels"))
    for board, age in seen:
        telemetry.read((board + WAY) * MILLISECOND, state(board, NUMBER, age))
    if latency is None:
        assert isnan(telemetry.latency)
    else:
        assert telemetry.latency == pytest.approx(latency / 1000)
