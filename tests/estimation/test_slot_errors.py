"""What is known of a disc's flanks before it turns."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.estimation.slot_errors import SlotErrors
from diffbotctl.estimation.wheel_odometer import MEASURED_OPEN_SHARE_SD, LinkTiming, WheelOdometer


@pytest.mark.parametrize("slots", [20, 100])  # the errors of so many are not learnt
@pytest.mark.parametrize("both", [False, True])
def test_a_flank_seen_backward_lies_off_by_what_the_open_share_is_off_a_half(slots, both):
    places = SlotErrors(slots, 0.03, 0.01, open_share_error=-0.08, learns_backward=both)
    for slot in range(slots):
        assert places.edge_estimate(slot, is_forward=True).error == 0.0
        assert places.edge_estimate(slot, is_forward=False).error == -0.08


@pytest.mark.parametrize(
    "share, error, sd",
    [(None, 0.0, 0.05), (0.42, -0.08, MEASURED_OPEN_SHARE_SD), (0.5, 0.0, MEASURED_OPEN_SHARE_SD)],
)
def test_a_measured_open_share_is_where_odometry_begins(share, error, sd):
    side = load_robot("book_2wd").robot.drive.left
    side.encoder.open_share = share
    disc = WheelOdometer(side, 0, 0, LinkTiming(0.0, 0.0, False)).filter.motion.disc
    told = disc.edge_estimate(3, is_forward=False)
    assert told.error == pytest.approx(error)
    assert told.variance == pytest.approx(0.03**2 + sd**2)  # the slot itself is cut to 3 %
