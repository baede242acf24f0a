"""Slot errors before the disc turns."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.estimation.slot_errors import SlotErrors
from diffbotctl.estimation.wheel_odometer import MEASURED_OPEN_SHARE_SD, LinkTiming, WheelOdometer


@pytest.mark.parametrize("slots", [20, 100])  # too many to be learnt
def test_backward_edges_have_the_error_of_the_open_share(slots):
    places = SlotErrors(slots, 0.03, 0.01, open_share_error=-0.08)
    for slot in range(slots):
        assert places.edge_estimate(slot, is_forward=True).error == 0.0
        assert places.edge_estimate(slot, is_forward=False).error == -0.08


@pytest.mark.parametrize(
    "share, error, sd",
    [(None, 0.0, 0.05), (0.42, -0.08, MEASURED_OPEN_SHARE_SD), (0.5, 0.0, MEASURED_OPEN_SHARE_SD)],
)
def test_odometry_starts_from_the_measured_open_share(share, error, sd):
    side = load_robot("book_2wd").robot.drive.left
    side.encoder.open_share = share
    disc = WheelOdometer(side, 0, 0, LinkTiming(0.0, 0.0, False)).filter.motion.disc
    estimate = disc.edge_estimate(3, is_forward=False)
    assert estimate.error == pytest.approx(error)
    assert estimate.variance == pytest.approx(0.03**2 + sd**2)  # tolerance of a slot: 3 %
