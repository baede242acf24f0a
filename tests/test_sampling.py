"""The sample of `make test`: each value once; all combinations by night."""

import subprocess
import sys
from pathlib import Path

from tests.sampling import by_day, each_once

TESTS = Path(__file__).parent


def is_nightly(parameter):
    return any(mark.name == "nightly" for mark in parameter.marks)


def test_each_value_of_each_factor_is_in_a_test_by_day():
    parameters = each_once(board=["mega", "uno", "pico"], axis=[0, 1]).mark.args[1]
    assert len(parameters) == 6
    days = [each.values for each in parameters if not is_nightly(each)]
    assert len(days) == 3
    assert [set(values) for values in zip(*days, strict=True)] == [{"mega", "uno", "pico"}, {0, 1}]


def test_the_first_values_are_by_day_and_a_tuple_is_several_parameters():
    first, second = by_day(1, [("uno", 5), ("nano", 6)])
    assert first.values == ("uno", 5) and not is_nightly(first) and is_nightly(second)


def test_nightly_tests_are_listed_and_left_out():
    def collected(*words):
        command = [sys.executable, "-m", "pytest", "--collect-only", "-q", *words]
        done = subprocess.run(
            [*command, TESTS / "runs" / "test_boards.py"], capture_output=True, text=True
        )
        return int(done.stdout.split(": ")[1].split()[0])

    assert collected() + collected("-m", "nightly") == collected("-m", "nightly or not nightly")
