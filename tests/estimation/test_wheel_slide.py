"""Wheels that slide, by their turns and those of a gyro: cases worked out by hand."""

from dataclasses import dataclass
from math import radians, sqrt

import pytest

from diffbotctl.estimation.geometry_deviation import GeometryDeviation
from diffbotctl.estimation.gyro_turn import TurnStep
from diffbotctl.estimation.wheel_slide import WheelSlide

TRACK = 0.2


@dataclass
class Wheel:
    """How well the travel of a wheel is known, m2."""

    variance: float = 0.0
    end_variance: float = 0.0
    disagreement: float = 0.0
    fault_share: float = 0.0


def slide_of(frames, left, right, turned, slip=0.0, geometry=(), scale_sd=0.0, heading=0.0):
    """After `frames` in each of which the wheels travelled so and the robot turned so."""
    slide = WheelSlide(TRACK, slip, geometry, scale_sd)
    for _ in range(frames):
        slide.add(left, right, TurnStep(turned, 0.0, 0.02), heading)
    return slide


@pytest.mark.parametrize(
    ("frames", "left", "right", "turned", "excess"),
    [
        (10, 0.01, 0.01, 0.0, 0.0),  # straight
        (10, -0.01, 0.01, 0.1, 0.0),  # a turn on the spot
        (10, -0.01, 0.01, 0.096, 0.0),  # of which a track 4 % too narrow makes more
        (10, -0.01, 0.01, 0.08, 0.2),  # a fifth of it slides
        (10, -0.01, 0.01, 0.12, -0.2),  # as if a wheel had travelled further than it turned
        (10, 0.0, 0.01, 0.0, 0.5),  # a wheel spins in place
        (10, 0.0, -0.01, 0.0, -0.5),
        (10, 0.01, 0.01, 0.05, -0.5),  # the left wheel spins on a straight way
        (10, 0.01, 0.0106, 0.0, 0.0),  # 1.7 deg
        (10, 0.01, 0.0108, 0.0, 0.04),  # 2.3 deg
    ],
)
def test_turns_that_differ(frames, left, right, turned, excess):
    slide = slide_of(frames, left, right, turned)
    found = slide.find(Wheel(), Wheel(), 0.0)
    assert (0.0 if found is None else found.turn) == pytest.approx(excess)
    assert slide.has_slid == (excess != 0.0)
    assert slide.find(Wheel(), Wheel(), 0.0) is None  # compared anew


@pytest.mark.parametrize(
    ("wheel", "changes", "bias_sd"),
    [
        (Wheel(variance=0.01**2 / 2), {}, 0.0),
        (Wheel(end_variance=0.01**2 / 2), {}, 0.0),
        (Wheel(disagreement=0.01**2 / 2), {}, 0.0),
        (Wheel(fault_share=0.1), {}, 0.0),
        (Wheel(), {"slip": 0.01 / sqrt(0.22)}, 0.0),
        (Wheel(), {"geometry": (GeometryDeviation(left=0.1),)}, 0.0),
        (Wheel(), {"geometry": (GeometryDeviation(right=0.1),)}, 0.0),
        (Wheel(), {"scale_sd": 0.5}, 0.0),
        (Wheel(), {}, 0.25),
    ],
)
def test_what_the_known_errors_explain_is_no_slide(wheel, changes, bias_sd):
    """0.1 rad on 0.1 m, twice what is noticed of exact wheels; each error has an sd of 0.05 rad."""
    assert slide_of(10, 0.01, 0.012, 0.0).find(Wheel(), Wheel(), 0.0)
    turned = 0.1 if "scale_sd" in changes else 0.0
    slide = slide_of(10, 0.01, 0.012 + TRACK * turned / 10, turned / 10, **changes)
    before = slide_of(10, 0.01, 0.012 + TRACK * turned / 10, turned / 10)
    assert before.find(Wheel(), Wheel(), 0.0)
    assert slide.find(wheel, wheel, bias_sd) is None
    assert not slide.has_slid


def test_a_slide_in_a_turn_on_the_spot_is_that_of_either_wheel():
    """0.1 m: the axle has moved by half of it, forward or backward."""
    slide = slide_of(10, -0.01, 0.01, 0.05)
    assert slide.find(Wheel(), Wheel(), 0.0) == pytest.approx((0.5, 0.0, 0.0))
    assert slide.slid.around == pytest.approx(0.05**2)
    assert not any(slide.slid.along)


@pytest.mark.parametrize(
    ("left", "right", "turned", "lacking"),
    [
        (0.01, 0.02, 0.0, 0.05),  # the right wheel, forward
        (0.02, 0.01, 0.0, 0.05),  # the left one
        (-0.01, -0.02, 0.0, -0.05),  # the right one, backward
        (-0.02, -0.01, 0.0, -0.05),  # the left one
        (0.0, 0.01, 0.0, 0.05),  # the right one, on the spot
        (-0.01, 0.0, 0.0, -0.05),  # the left one, backward on the spot
        (-0.005, 0.015, 0.15, 0.0),  # that is unknown; the gyro turns further
    ],
)
def test_the_way_lacks_what_the_wheel_slides_that_may(left, right, turned, lacking):
    slide = slide_of(10, left, right, turned, heading=radians(180.0))
    found = slide.find(Wheel(), Wheel(), 0.0)
    assert found is not None
    assert (found.x, found.y) == pytest.approx((-lacking, 0.0))
    assert bool(slide.slid.around) is (lacking == 0.0)


@pytest.mark.parametrize("turned", [200.0, 360.0])
def test_in_a_long_turn_a_wheel_slides_in_an_unknown_direction(turned):
    """The right wheel goes round the left one, and slides by 0.1 m."""
    slide = WheelSlide(TRACK, 0.0, (), 0.0)
    length = TRACK * radians(turned) + 0.1
    for step in range(100):
        heading = radians(turned) * (step + 0.5) / 100
        slide.add(0.0, length / 100, TurnStep(radians(turned) / 100, 0.0, 0.02), heading)
    assert slide.find(Wheel(), Wheel(), 0.0) == pytest.approx((0.5, 0.0, 0.0))
    assert slide.slid.around == pytest.approx(0.05**2)


def test_slides_on_a_way_add_up_along_it():
    """0.1 m of one wheel to x and 0.1 m of it to y: half of it each."""
    slide = slide_of(10, 0.01, 0.02, 0.0)
    assert slide.find(Wheel(), Wheel(), 0.0) == pytest.approx((0.5, 0.05, 0.0))
    for _ in range(10):
        slide.add(0.01, 0.02, TurnStep(0.0, 0.0, 0.02), radians(90.0))
    assert slide.find(Wheel(), Wheel(), 0.0) == pytest.approx((0.5, 0.0, 0.05))
    assert slide.slid[:2] == pytest.approx((0.05, 0.05))
    assert slide.slid.along == pytest.approx((0.05, 0.05, 0.0))
    assert slide.slid.around == 0.0


def test_of_an_encoder_that_misses_edges_a_slide_is_not_taken_from_the_way():
    slide = slide_of(10, 0.01, 0.02, 0.0)
    assert slide.find(Wheel(fault_share=0.01), Wheel(), 0.0) == pytest.approx((0.5, 0.0, 0.0))
    assert slide.slid.along == pytest.approx((0.1, 0.0, 0.0))


def test_a_small_difference_does_not_become_a_slide_on_a_long_way():
    """0.3 % of both diameters, on 20 m: 17 deg in all."""
    slide = slide_of(0, 0.0, 0.0, 0.0)
    for _ in range(2000):
        slide.add(0.01, 0.01003, TurnStep(0.0, 0.0, 0.02), 0.0)
        assert slide.find(Wheel(), Wheel(), 0.0) is None


def test_on_how_much_both_turns_have_agreed():
    slide = slide_of(100, -0.01, 0.01, 0.1)
    assert slide.find(Wheel(), Wheel(), 0.0) is None
    assert slide.agreed_path == pytest.approx(1.0)
    slide.compare_from_here()
    assert slide.agreed_turn == pytest.approx(10.0)
    for _ in range(10):
        slide.add(0.0, 0.01, TurnStep(0.0, 0.0, 0.02), 0.0)
    assert slide.find(Wheel(), Wheel(), 0.0)
    assert (slide.agreed_path, slide.agreed_turn) == (0.0, 0.0)


def test_the_position_is_forgotten():
    slide = slide_of(10, 0.0, 0.01, 0.0)
    slide.find(Wheel(), Wheel(), 0.0)
    slide.forget()
    assert not slide.has_slid
