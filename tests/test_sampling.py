"""The sample of `make test`: each value once; all combinations by night."""

import subprocess
import sys
from pathlib import Path

from tests.sampling import by_day, each_once

ROOT = Path(__file__).parents[1]
SAMPLE = """
import pytest
from tests.sampling import by_day
@pytest.mark.parametrize("number", by_day(1, [1, 2, 3]))
def test_it(number):
    assert number
"""


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


def test_nightly_tests_are_listed_and_left_out(tmp_path):
    (tmp_path / "test_it.py").write_text(SAMPLE)

    def run(*words):
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-c",
            ROOT / "setup.cfg",
            "-p",
            "no:cacheprovider",
        ]
        options = {"cwd": ROOT, "capture_output": True, "text": True}
        return subprocess.run([*command, *words, tmp_path], **options).stdout

    assert "1 passed, 2 deselected" in run()
    assert "2/3 tests collected" in run("-m", "nightly", "--collect-only")
