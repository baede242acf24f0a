"""What the ring keeps, and from where it can be replayed."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.recording.black_box import EngineState
from diffbotctl.recording.black_box_store import InputRing


def filled(span, most, events_sent):
    """A ring with these items: a number is a batch of one instant, ("state", t) a state."""
    ring = InputRing(span, most, packet_size=1)  # each batch is a packet
    for each in events_sent:
        if isinstance(each, tuple):
            ring.add_state(EngineState(each[1], b"state"))
        else:
            ring.add_batch(each, pickle.dumps([(each, "input")]))
    return ring


@pytest.mark.parametrize(
    "events_sent, begin, times, known",
    [
        # Younger than the span: all of it, from the start of the run.
        ([1, 2, ("state", 2), 3], None, [1, 2, 3], True),
        # At 13 the state at 3 is 10 old: what came before it is not needed any more.
        ([1, 3, ("state", 3), 5, 12], None, [1, 3, 5, 12], True),
        ([1, 3, ("state", 3), 5, 13], 3, [5, 13], True),
        # Two states are old enough: the later one serves.
        ([1, ("state", 1), 2, ("state", 2), 3, 14], 2, [3, 14], True),
        # The younger state is not old enough to begin there.
        ([1, ("state", 1), 2, ("state", 9), 10, 12], 1, [2, 10, 12], True),
        # No states: after twice the span it forgets to one span, and knows nothing of before.
        ([1, 11, 21], None, [1, 11, 21], True),
        ([1, 11, 22], None, [22], False),
        ([1, 11, 13, 22], None, [13, 22], False),
        # A state that comes after all makes the rest known again once it is old.
        ([1, 22, ("state", 22), 23, 33], 22, [23, 33], True),
        ([], None, [], True),
    ],
)
def test_the_ring_keeps_a_span_of_ten(events_sent, begin, times, known):
    ring = filled(10, 1 << 20, events_sent)
    assert [instant[0] for instant in ring.instants()] == times
    assert (ring.begin.time if ring.begin else None, ring.known) == (begin, known)


EVENTS = st.lists(st.tuples(st.integers(1, 5), st.booleans()), max_size=200)


@given(EVENTS, st.integers(200, 4000))
def test_its_size_is_bounded_and_its_times_rise(events, most):
    time, events_sent = 0, []
    for step, state in events:
        time += step
        events_sent.append(time)
        if state:
            events_sent.append(("state", time))
    ring = filled(50, most, events_sent)
    kept = [instant[0] for instant in ring.instants()]
    assert kept == sorted(kept) and kept == [each for each in events_sent if each in kept]
    parts = [data for _, data in ring.packets] + [state.data for state in ring.states]
    assert ring.size == sum(map(len, parts))
    assert ring.size <= most + 100  # the newest batch always fits
    if ring.begin is not None and kept:
        assert kept[0] > ring.begin.time


@given(st.lists(st.booleans(), max_size=300), st.integers(1, 500))
def test_compressed_instants_come_back_in_order(states, packet):
    ring = InputRing(10_000, 1 << 20, packet)
    for time, state in enumerate(states):
        ring.add_batch(time, pickle.dumps([(time, "a"), (time, "b")]))
        if state:
            ring.add_state(EngineState(time, b"state"))
    expected = [(time, word) for time in range(len(states)) for word in "ab"]
    assert list(ring.instants()) == expected
