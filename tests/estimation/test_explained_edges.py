"""Edges that the duty of a motor explains, in sums over the last seconds of driving."""

from __future__ import annotations

from math import exp
from types import SimpleNamespace

import pytest

from diffbotctl.estimation.explained_edges import MEMORY_S, ExplainedEdges, whole

FRAME = 0.02  # s
COUNTS = 400
RATED, STATIC = 10.0, 0.1  # rad/s, duty


def side(decay=None):
    loop = SimpleNamespace(static=STATIC, speed=None, proportional=None, integral=None)
    motor = SimpleNamespace(
        rated=RATED, lag=0.1, loop=loop, decay=decay, friction=None, is_shorted=False
    )
    return SimpleNamespace(motor=motor, encoder=SimpleNamespace(counts=COUNTS))


def driven(frames, edges, duty, decay="slow"):
    explained = ExplainedEdges(side(decay))
    for _ in range(frames):
        explained.add(FRAME, edges, duty)
    return explained


def ratio(explained):
    """Of all classes of duties, by the first curve."""
    return whole(explained.ratios[0])


def test_a_constant_duty_explains_the_edges_of_its_settled_speed():
    """Duty 0.55 settles at (0.55 - 0.1) / 0.9 x 10 = 5 rad/s: 400 / 2 pi x 5 = 318.3 edges/s. A
    memory of 5 s holds 318.3 x 0.02 / (1 - exp(-0.02 / 5)) of them after a long time."""
    found = ratio(driven(3000, 6, 0.55))
    assert found.explained == pytest.approx(
        318.3 * FRAME / (1.0 - exp(-FRAME / MEMORY_S)), rel=1e-3
    )
    assert found.counted == pytest.approx(6.0 / (1.0 - exp(-FRAME / MEMORY_S)), rel=1e-3)


def test_each_duty_has_its_class():
    """0.15, 0.3, 0.5 and 0.9 are 0.05, 0.2, 0.4 and 0.8 beyond the static duty."""
    for index, duty in enumerate((0.15, 0.3, 0.5, 0.9)):
        classes = driven(50, 6, duty).ratios[0]
        assert [one.explained > 0.0 for one in classes] == [n == index for n in range(4)]


def test_where_the_decay_is_unknown_both_curves_are_followed():
    """With fast decay it settles at 10 x 1.05 / 0.9 x 0.45 / 0.6 = 8.75 rad/s."""
    slow, fast = map(whole, driven(1000, 6, 0.55, decay=None).ratios)
    assert fast.explained / slow.explained == pytest.approx(8.75 / 5.0, rel=1e-3)
    assert fast.counted == slow.counted


def test_a_load_takes_less_of_the_edges_at_a_high_duty():
    low, high = (ratio(driven(1000, 6, duty)) for duty in (0.3, 0.9))
    # Of all of the duty: rated speed / 0.9 over the settled speed, 11.1 / 2.2 and 11.1 / 8.9.
    assert low.load / low.explained == pytest.approx(5.0, rel=0.01)
    assert high.load / high.explained == pytest.approx(1.25, rel=0.01)


def test_a_standing_wheel_explains_nothing():
    """Its duty does not overcome the friction of the start: it stands with a duty of 0.3."""
    explained = driven(50, 0, 0.3)
    assert explained.driven == 0.0 and ratio(explained).explained == 0.0


@pytest.mark.parametrize(
    ("span", "duty"), [(FRAME, 0.0), (FRAME, 0.11), (0.13, 0.55), (FRAME, -0.55)]
)
def test_frames_without_a_duty_near_friction_too_long_or_against_the_motion_do_not_count(
    span, duty
):
    explained = driven(20, 6, 0.55)
    before = explained.driven
    explained.add(span, 6, duty)
    assert explained.driven == before
