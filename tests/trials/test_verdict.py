"""What is not met of an expectation, by figures worked out by hand."""

from math import radians

import pytest

from diffbotctl.trials.sections import Expectation, StopExpectation
from diffbotctl.trials.summary import worst_first
from diffbotctl.trials.trial_run import StopRecord, TrialResult
from diffbotctl.trials.verdict import judge

GOOD = TrialResult(
    "healthy/book_2wd/0",
    "healthy",
    "book_2wd",
    0,
    "reached",
    "all goals reached",
    time=6.5,
    reached=1,
    goals=1,
    error=0.004,
    heading_error=radians(1.0),
    estimate_error=0.003,
    estimate_sigmas=1.5,
    farther=0.0,
    clearance=0.5,
    fault_at=1.0,
)
# It stands from 3.4 s on; the fault began at 1 s.
STOPPED = GOOD._replace(
    outcome="stopped",
    cause="wheel_fault: the left wheel does not turn",
    reached=0,
    error=0.8,
    stops=(
        StopRecord(0.5, "obstacle", "0.1 m ahead"),
        StopRecord(3.4, "wheel_fault", "the left wheel does not turn"),
    ),
)
UNSURE = GOOD._replace(outcome="reached_unsure", cause="goal 1 reached, but the pose is uncertain")


def stop(**fields):
    return {"stop": StopExpectation(**fields)}


@pytest.mark.parametrize(
    ("found", "expected", "unmet"),
    [
        (GOOD, {}, ""),
        (GOOD, {"reach": 7.0, "error": 0.005, "time": 6.5, "unsure": "never"}, ""),
        (GOOD, {"reach": 6.0}, "reached after 6.5 s, not within 6 s"),
        (GOOD._replace(goals=2), {"reach": 7.0}, "not reached (reached)"),
        (STOPPED, {"reach": 9.0}, "not reached (stopped): wheel_fault: the left wheel"),
        (GOOD, {"error": 0.003}, "true error 4.0 mm, more than 3 mm"),
        (GOOD, {"heading_error": radians(0.5)}, "heading 1.0 deg, more than 0.5 deg"),
        (GOOD, {"time": 6.0}, "time 6.5 s, more than 6 s"),
        (GOOD._replace(farther=0.2), {"farther": 0.1}, "by 200.0 mm, more than 100 mm"),
        (GOOD._replace(error=None), {"error": 0.1}, "true error: unknown without a goal"),
        (GOOD._replace(heading_error=None), {"heading_error": 0.1}, "without a goal with a head"),
        (GOOD._replace(farther=None), {"farther": 0.1}, "unknown without a goal"),
        (GOOD._replace(error=None, heading_error=None, farther=None), {}, ""),
        (GOOD, {"clearance": 0.4}, ""),
        (GOOD, {"clearance": 0.6}, "500 mm from a wall or obstacle, less than 600 mm"),
        (GOOD._replace(clearance=0.0), {}, "it touched a wall or an obstacle"),
        (UNSURE, {"reach": 7.0}, "reached, but unsure"),
        (UNSURE, {"reach": 7.0, "unsure": "allowed"}, ""),
        (UNSURE, {"reach": 7.0, "unsure": "required"}, ""),
        (UNSURE, {}, ""),
        (GOOD, {"unsure": "required"}, "does not state that the pose is uncertain"),
        (STOPPED, stop(within=2.5), ""),
        (STOPPED, stop(within=2.0), "stop 2.4 s after the fault, not within 2 s"),
        (STOPPED, stop(within=3.0, code="wheel_fault", cause="left wheel"), ""),
        (STOPPED, stop(within=3.0, code="battery_low"), "no stop battery_low: wheel_fault: the"),
        (STOPPED, stop(within=3.0, cause="right"), "no stop with the cause 'right'"),
        (GOOD, stop(), "no stop: reached"),
        (GOOD._replace(outcome="crashed", cause="E"), {"time": 9.0}, "crashed: E"),
    ],
)
def test_what_is_not_met(found, expected, unmet):
    judged = judge(found, Expectation(**expected))
    assert judged.passed is (unmet == "")
    assert unmet in "; ".join(judged.unmet)


def test_safety_outweighs_what_was_expected_and_this_the_error():
    touching = GOOD._replace(name="touching", clearance=0.0)
    late = GOOD._replace(name="late", time=90.0)
    far = GOOD._replace(name="far", error=0.1)
    ordered = worst_first(
        [judge(each, Expectation(time=60.0)) for each in (GOOD, far, late, touching)]
    )
    assert [each.result.name for each in ordered] == ["touching", "late", "far", GOOD.name]
