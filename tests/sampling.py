"""Parameters of a test that `make test` takes; the others have the mark `nightly`."""

from itertools import product

import pytest


def by_day(number, values):
    """All `values` (a tuple is one of several names), those after the first `number` by night."""
    return [
        pytest.param(
            *(value if type(value) is tuple else [value]),
            marks=() if place < number else pytest.mark.nightly,
        )
        for place, value in enumerate(values)
    ]


def each_once(**factors):
    """Decorator: all combinations of the factors, by day so few that each value is in one."""
    all_values = [list(values) for values in factors.values()]
    rounds = range(max(map(len, all_values)))
    days = {tuple(turn % len(values) for values in all_values) for turn in rounds}
    combinations = [
        pytest.param(
            *(values[at] for values, at in zip(all_values, places, strict=True)),
            marks=() if places in days else pytest.mark.nightly,
        )
        for places in product(*(range(len(values)) for values in all_values))
    ]
    return pytest.mark.parametrize(tuple(factors), combinations)
