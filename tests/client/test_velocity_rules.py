"""The rules for velocities, event by event, in times of their own."""

from math import hypot, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.client.velocity_rules import (
    FLOOD_SPAN_S,
    RENEWAL_PERIOD_S,
    SILENCE_MAX_S,
    DriveState,
    EngineOrder,
    Limits,
    VelocityRules,
    VelocitySource,
)

LIMITS = Limits(0.3, 4.0)
TELEOP = frozenset({"01"})
NO_PUBLISHERS = frozenset()


def source(number, publishers=TELEOP):
    return VelocitySource(publishers, "/teleop", number)


def moving(sequence=5):
    """Rules of a robot that moves since 10 s."""
    rules = VelocityRules(LIMITS)
    orders = rules.velocity_received(10.0, 0.2, 0.5, source(sequence))
    assert orders == [EngineOrder("drive", 0.2, 0.5)]
    return rules


def methods(orders):
    return [order.method for order in orders]


def silent(sequence=5):
    rules = moving(sequence)
    assert methods(rules.time_passed(10.0 + SILENCE_MAX_S)) == ["operator_lost"]
    return rules


@pytest.mark.parametrize(
    ("velocity", "scaled"),
    [
        ((0.2, 1.0), (0.2, 1.0)),
        ((0.6, 1.0), (0.3, 0.5)),  # twice the speed: both halved
        ((0.1, -8.0), (0.05, -4.0)),
        ((-1.2, 16.0), (-0.3, 4.0)),  # both four times too much
        ((0.6, 2.0), (0.3, 1.0)),
    ],
)
def test_a_velocity_beyond_a_limit_is_scaled_in_both_components(velocity, scaled):
    assert LIMITS.scaled(*velocity) == pytest.approx(scaled)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_scaled_velocity_is_within_the_limits_and_on_the_same_arc(linear, angular):
    v, w = LIMITS.scaled(linear, angular)
    assert abs(v) <= LIMITS.speed and abs(w) <= LIMITS.turn_rate
    assert v * angular == pytest.approx(w * linear, abs=1e-9 * hypot(linear, angular))


def test_a_robot_without_limits_is_driven_as_asked():
    assert Limits(inf, inf).scaled(7.0, 9.0) == (7.0, 9.0)


def test_a_velocity_is_repeated_between_messages_and_no_sooner():
    rules = moving()
    assert rules.time_passed(10.0 + 0.5 * RENEWAL_PERIOD_S) == []
    assert rules.deadline() == pytest.approx(10.0 + RENEWAL_PERIOD_S)
    assert methods(rules.time_passed(10.0 + RENEWAL_PERIOD_S)) == ["drive"]


def test_a_velocity_right_after_another_waits_for_its_turn():
    rules = moving()
    assert rules.velocity_received(10.002, 0.1, 0.0, source(6)) == []
    assert rules.deadline() == pytest.approx(10.01)
    assert rules.time_passed(10.011) == [EngineOrder("drive", 0.1, 0.0)]


def test_a_zero_passes_at_once_and_silence_after_it_latches_nothing():
    rules = moving()
    assert methods(rules.velocity_received(10.001, 0.0, 0.0, source(6))) == ["release"]
    assert rules.deadline() == inf and rules.time_passed(99.0) == []
    assert rules.publishers_changed(NO_PUBLISHERS) == []
    orders = rules.velocity_received(100.0, 0.1, 0.0, source(1, frozenset({"02"})))
    assert methods(orders) == ["drive"]


def test_a_zero_at_rest_sends_nothing():
    assert VelocityRules(LIMITS).velocity_received(1.0, 0.0, 0.0, source(1)) == []


def test_silence_while_moving_stops_and_only_a_zero_of_the_same_publisher_rearms():
    rules = silent()
    assert rules.velocity_received(11.0, 0.2, 0.0, source(6)) == []
    assert rules.velocity_received(11.1, 0.0, 0.0, source(1, frozenset({"02"}))) == []
    assert rules.state is DriveState.SILENT
    assert methods(rules.velocity_received(11.2, 0.0, 0.0, source(7))) == ["rearm"]
    assert methods(rules.velocity_received(11.3, 0.2, 0.0, source(8))) == ["drive"]


def test_a_zero_is_not_trusted_while_another_publisher_has_joined():
    rules = silent()
    joined = TELEOP | {"02"}
    assert rules.velocity_received(11.0, 0.0, 0.0, source(900, joined)) == []
    assert rules.state is DriveState.SILENT


def test_a_publisher_that_is_gone_while_moving_needs_resume():
    rules = moving()
    orders = rules.publishers_changed(NO_PUBLISHERS)
    assert methods(orders) == ["operator_lost"] and "/teleop has ended" in orders[0].reason
    assert rules.velocity_received(11.0, 0.0, 0.0, source(6)) == []
    assert rules.velocity_received(11.1, 0.2, 0.0, source(7)) == []
    rules.stop_ended()
    assert methods(rules.velocity_received(12.0, 0.2, 0.0, source(8))) == ["drive"]


def test_a_publisher_that_is_gone_after_its_silence_cannot_rearm():
    rules = silent()
    assert rules.publishers_changed(NO_PUBLISHERS) == []
    assert rules.velocity_received(11.0, 0.0, 0.0, source(6)) == []
    assert rules.state is DriveState.HELD


def test_another_publisher_may_end_while_one_drives():
    rules = VelocityRules(LIMITS)
    rules.velocity_received(10.0, 0.2, 0.0, source(5, TELEOP | {"02"}))
    assert rules.publishers_changed(TELEOP) == []
    assert methods(rules.velocity_received(10.1, 0.2, 0.0, source(6))) == ["drive"]
    assert methods(rules.time_passed(11.0)) == ["operator_lost"]
    assert rules.state is DriveState.SILENT


def test_silence_after_one_of_several_publishers_has_ended_needs_resume():
    rules = VelocityRules(LIMITS)
    rules.velocity_received(10.0, 0.2, 0.0, source(5, TELEOP | {"02"}))
    assert rules.publishers_changed(TELEOP) == []
    assert methods(rules.time_passed(10.0 + SILENCE_MAX_S)) == ["operator_lost"]
    assert rules.velocity_received(11.0, 0.0, 0.0, source(6)) == []
    assert rules.state is DriveState.HELD


def test_a_second_publisher_that_joins_changes_nothing_until_it_sends():
    rules = moving()
    joined = TELEOP | {"02"}
    assert rules.publishers_changed(joined) == []
    assert methods(rules.velocity_received(10.1, 0.2, 0.5, source(6, joined))) == ["drive"]
    orders = rules.velocity_received(10.2, 0.2, 0.0, source(1, joined))
    assert methods(orders) == ["stop"] and "several publishers" in orders[0].reason


@pytest.mark.parametrize("velocity", [(nan, 0.0), (0.1, nan), (inf, 0.0), (0.0, -inf)])
@pytest.mark.parametrize("rules", [VelocityRules(LIMITS), moving(), silent()])
def test_a_number_that_is_not_finite_stops_until_resume(rules, velocity):
    rules.state = DriveState.RESTING if rules.state is DriveState.HELD else rules.state
    assert methods(rules.velocity_received(10.1, *velocity, source(6))) == ["stop"]
    assert rules.velocity_received(10.2, *velocity, source(7)) == []  # once is enough
    assert rules.velocity_received(10.3, 0.0, 0.0, source(8)) == []
    assert rules.state is DriveState.HELD


def test_a_flood_stops_also_when_most_of_it_is_dropped_on_the_way():
    rules = moving(sequence=0)
    orders = []
    for step in range(1, 30):  # 100 a second arrive of 10,000
        orders += rules.velocity_received(10.0 + 0.01 * step, 0.2, 0.0, source(100 * step))
    stop = [order for order in orders if order.method != "drive"]
    assert methods(stop) == ["stop"] and "1000 velocities/s" in stop[0].reason


def test_a_flood_is_counted_where_the_middleware_numbers_nothing():
    rules = moving(sequence=None)
    times = [10.0 + 0.0001 * step for step in range(1, 3000)]
    orders = [o for t in times for o in rules.velocity_received(t, 0.2, 0.0, source(None))]
    assert "stop" in methods(orders)


def test_a_controller_of_200_hz_is_no_flood():
    rules = moving(sequence=0)
    for step in range(1, 200):
        now = 10.0 + 0.005 * step
        assert "stop" not in methods(rules.velocity_received(now, 0.2, 0.0, source(step)))
    assert 10 * FLOOD_SPAN_S <= 200 * 0.005  # the rate was measured several times


def test_after_a_refusal_a_zero_is_needed_and_the_stop_of_others_is_not_ended():
    rules = moving()
    rules.refused()
    assert rules.velocity_received(10.1, 0.2, 0.0, source(6)) == []
    assert rules.velocity_received(10.2, 0.0, 0.0, source(7)) == []
    assert methods(rules.velocity_received(10.3, 0.2, 0.0, source(8))) == ["drive"]


def test_the_name_of_a_node_may_be_known_later_than_its_velocity():
    rules = VelocityRules(LIMITS)
    rules.velocity_received(10.0, 0.2, 0.0, VelocitySource(TELEOP, "cmd_vel", 5))
    rules.publishers_named(frozenset({"02"}), "/other")
    rules.publishers_named(TELEOP, "/teleop")
    (order,) = rules.time_passed(10.0 + SILENCE_MAX_S)
    assert order.method == "operator_lost" and "/teleop was silent" in order.reason
