"""Statistics of a link, calculated by hand, and measured on a link of known delays."""

import pytest

from diffbotctl.bluetooth.link_stats import (
    Arrival,
    LinkFigures,
    frame_delays,
    link_figures,
    percentile,
)
from diffbotctl.bluetooth.rate_advice import advise_rate, max_telemetry_rate
from diffbotctl.time import MILLISECOND as MS
from tests.support.radio_module import RadioModule
from tests.support.virtual_board import board, diffbotctl, flat

# Four frames, taken each 25 ms by a clock that is 700 ms behind; number 2 never came.
FRAMES = [
    Arrival(1000 * MS, 290 * MS, 62),  # 10 ms on the way
    Arrival(1040 * MS, 315 * MS, 63),  # 25 ms: 15 later than the fastest
    Arrival(1050 * MS, 340 * MS, 0),  # 10 ms; the numbers go round at 64
    Arrival(1130 * MS, 390 * MS, 2),  # 40 ms: 30 later; after 80 ms of silence
]


def test_figures_by_hand():
    found = link_figures(FRAMES, [0.030, 0.050, 0.040], damaged=1, sequences=64)
    assert found.frames == 4 and found.damaged == 1
    assert found.rate == pytest.approx(3 / 0.130)
    assert found.lost == pytest.approx(1 / 5)
    assert (found.latency, found.latency_worst) == (0.040, 0.050)
    assert found.jitter_worst == pytest.approx(0.030)
    assert found.silence == pytest.approx(0.080)


def test_too_little_is_refused():
    with pytest.raises(ValueError):
        link_figures(FRAMES[:1], [0.1], 0, 64)
    with pytest.raises(ValueError):
        link_figures(FRAMES, [], 0, 64)


def test_clock_drift_is_not_jitter():
    # 200 parts in a million, a bad crystal: 12 ms in the minute that this takes.
    received = [
        Arrival(k * 25 * MS, round(k * 25 * MS * (1 - 200e-6)), k % 64) for k in range(2400)
    ]
    assert max(frame_delays(received)) <= 0.0040 + 1e-9  # of the 20 s that are looked at together


@pytest.mark.parametrize(
    ("part", "value"), [(0.5, 2.0), (0.95, 4.0), (0.75, 3.0), (0.01, 1.0), (1.0, 4.0)]
)
def test_percentile(part, value):
    assert percentile([4.0, 1.0, 3.0, 2.0], part) == value


GOOD = LinkFigures(400, 40.0, 0.0, 0, 0.04, 0.06, 0.03, 0.04, 0.08)


@pytest.mark.parametrize(
    ("baud", "frame", "most"),
    [
        (9600, 22, 38),  # 962 bytes a second, nine tenths of them: 39.3 frames
        (9600, 18, 48),  # 48.1
        (115200, 22, 100),  # the firmware's most
        (9600, 36, 24),  # 24.0
    ],
)
def test_max_telemetry_rate(baud, frame, most):
    assert max_telemetry_rate(baud, frame) == most


@pytest.mark.parametrize(
    ("figures", "baud", "frame", "expected"),
    [
        (GOOD, 9600, 22, (38, 9600, 0.3)),
        (GOOD, 115200, 22, (100, 115200, 0.3)),
        # 200 ms of two repeats, 150 of lateness, 50 in hand: 400.
        (GOOD._replace(jitter_worst=0.15), 9600, 22, (38, 9600, 0.4)),
        # Beyond the longest dead-man.
        (GOOD._replace(jitter_worst=0.9), 9600, 22, (38, 9600, 0.5)),
        # Frames of 27 bytes: 32 a second at 9600 baud, too few; 19200 baud carry 64.
        (GOOD, 9600, 27, (64, 19200, 0.3)),
    ],
)
def test_rate_advice(figures, baud, frame, expected):
    assert advise_rate(figures, baud, frame)[:3] == pytest.approx(expected)


def test_every_change_has_a_reason():
    assert advise_rate(GOOD, 9600, 22).reasons == ()
    assert "bluetooth baud 19200" in advise_rate(GOOD, 9600, 27).reasons[0]
    (late,) = advise_rate(GOOD._replace(jitter_worst=0.15), 9600, 22).reasons
    assert "150 ms late" in late
    assert any(
        "lost" in reason for reason in advise_rate(GOOD._replace(lost=0.2), 9600, 22).reasons
    )


def test_a_link_of_known_delays_is_measured(tmp_path):
    with board() as virtual:
        with RadioModule(
            virtual.radio, tmp_path / "radio", delay=(0.030, 0.060), loss=0.1
        ) as radio:
            code, output = diffbotctl(
                "bluetooth", "test", radio.device, "--robot", "book_2wd", "--for", 6
            )
        duty = virtual.board.duty
    assert code == 0, output
    output = flat(output)
    words = output.split()
    lost = float(words[words.index("lost,") - 1].rstrip("%"))
    answer = float(words[words.index("answer") + 2])
    assert 3.0 < lost < 25.0  # of some 240 frames a tenth; four standard deviations
    assert answer > 60  # twice the least delay, and the time on the wire
    assert duty == [0.0, 0.0]
    assert "%" in output and "jitter" in output and "silence" in output


def test_a_bad_port_is_reported_before_the_measurement():
    code, output = diffbotctl("bluetooth", "test", "98:D3:31:FC:12", "--robot", "book_2wd")
    assert code == 2 and "E-BLUETOOTH-ADDRESS" in output
