"""How far released wheels travel, learnt from releases of wheels that obey a known law."""

import pytest

from diffbotctl.control.coast import Coast

LAG = 0.1  # s, stated


def after(law, speeds):
    """What is learnt from releases at `speeds` (m/s) of wheels that travel `law(speed)` m."""
    coast = Coast(LAG)
    for speed in speeds:
        planned = coast.at(speed)
        coast = coast._replace(release_speed=speed, release_time=planned)
        coast = coast.learn(speed * planned - law(speed), LAG)
    return coast


@pytest.mark.parametrize(
    "law",
    [
        lambda speed: 0.1 * speed,
        lambda speed: 0.3 * speed,  # the lag is three times the stated one
        lambda speed: 0.08 * speed + speed * speed / (2 * 0.8),  # dead time and dry friction
    ],
)
def test_the_travel_is_learnt_at_all_speeds(law):
    coast = after(law, [0.3, 0.06, 0.2, 0.1, 0.3, 0.05])
    for speed in (0.05, 0.15, 0.3):
        assert speed * coast.at(speed) == pytest.approx(law(speed), abs=0.006)


def test_one_release_shows_most():
    assert after(lambda speed: 0.3 * speed, [0.25]).at(0.25) == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize(
    ("reported", "expected"),
    [
        (0.0, 0.1),  # nothing is reported
        (0.05, 0.1),  # nor does a shorter time count
        # Variance learnt 0.25^2 + (0.5 * 0.2)^2 = 0.0725, reported 0.1^2: 0.1 + 0.2 * 0.8788.
        (0.3, 0.2758),
    ],
)
def test_what_odometry_reports_counts_by_its_variance(reported, expected):
    assert Coast(LAG).expected(0.2, reported) == pytest.approx(expected, abs=1e-4)


def test_after_some_releases_what_odometry_reports_hardly_counts():
    coast = after(lambda speed: 0.1 * speed, [0.3, 0.1] * 4)
    assert coast.expected(0.2, 0.3) == pytest.approx(0.1, abs=0.02)
