"""A driven wheel without edges for a moment: what is reported as lost, computed by hand."""

import pytest

from diffbotctl.estimation.unexplained_edges import EdgeGaps

FRAME = 0.025  # s
RATED = 1000.0  # edges/s


def lost(*parts):
    """Variances, one a frame, of `parts`: (frames, edges in each, commanded rate)."""
    gaps = EdgeGaps(RATED)
    return gaps, [
        gaps.update(FRAME, edges, commanded)
        for frames, edges, commanded in parts
        for _ in range(frames)
    ]


STEADY, DARK = (8, 10, 400.0), (8, 0, 400.0)  # 400 edges/s; 0.2 s without


def test_edges_that_end_and_come_back_at_once_may_be_lost():
    gaps, variances = lost(STEADY, DARK, STEADY)
    # 0.2 s, and a frame for the parts of both frames around it, of 400 edges/s; 0.6 of that.
    assert variances[:17] == [0.0] * 17
    assert variances[17] == pytest.approx((0.6 * 0.225 * 400.0) ** 2)
    assert variances[18:] == [0.0] * 6
    assert gaps.text.startswith("hardly an edge came for 0.22 s")
    gaps.pose_is_set()
    assert gaps.text == ""


def test_the_board_drives_a_wheel_faster_that_gives_no_edges():
    _, variances = lost(STEADY, DARK, (2, 20, 400.0))
    assert variances[-1] == pytest.approx((0.6 * 0.225 * 800.0) ** 2)


def test_a_loose_wire_may_pick_up_the_mains():
    # 100 a second, two or three in a frame in which ten are expected.
    _, variances = lost(STEADY, (4, 2, 400.0), (4, 3, 400.0), STEADY)
    assert sum(variances) == pytest.approx((0.6 * 0.225 * 400.0) ** 2)


def test_a_coarse_encoder():
    # 20 edges/s of 100 at the rated speed, one in two frames: 6 are expected in 12 frames.
    gaps = EdgeGaps(100.0)
    frames = [1, 0] * 8 + [0] * 11 + [1, 0] * 3
    variances = [gaps.update(FRAME, edges, 20.0) for edges in frames]
    assert sum(variances) == pytest.approx((0.6 * 13 * FRAME * 20.0) ** 2, rel=0.1)
    assert not any(gaps.update(FRAME, edges, 20.0) for edges in [0, 1] * 20)


@pytest.mark.parametrize(
    ("what", "parts"),
    [
        ("held, and free again", (STEADY, DARK, (2, 4, 400.0), STEADY)),
        ("too few are missing: 4", (STEADY, (1, 0, 160.0), (9, 4, 400.0))),
        ("the drive is reversed", (STEADY, (4, 0, 400.0), (4, 0, -400.0), (8, 10, -400.0))),
        ("the drive ends", (STEADY, (4, 0, 400.0), (4, 0, 0.0), STEADY)),
        ("it is driven slowly, and friction holds it", (STEADY, (8, 0, 200.0), STEADY)),
        ("a tenth of the rated speed", ((8, 2, 80.0), (8, 0, 80.0), (8, 2, 80.0))),
        ("it slows down", (*((1, edges, 400.0) for edges in (10, 10, 10, 8, 5, 4)), DARK, STEADY)),
        ("a start", ((8, 0, 400.0), STEADY)),
        ("for 1.6 s", (STEADY, (64, 0, 400.0), STEADY)),
    ],
)
def test_nothing_is_lost(what, parts):
    gaps, variances = lost(*parts)
    assert not any(variances) and gaps.text == ""
