"""The progress of `make prove`: which section runs, the time so far, and what is left by the last
proof on this machine."""

import io
import json

import pytest

from tests.support.trials.progress import SectionTimes, time_text, with_progress
from tests.support.trials.row import Row

MINUTE = 60.0


class Watch:
    """A clock that the rows advance."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now

    def rows(self, *seconds):
        for each in seconds:
            self.now += each
            yield Row("what", "1", "1", True)


def proof(times, motion, wander):
    """The lines of a proof whose two sections take these times (s), and its number of rows."""
    watch, output = Watch(), io.StringIO()
    sections = [("motion", watch.rows(*motion)), ("wander", watch.rows(*wander))]
    rows = list(with_progress(sections, times, output, watch))
    return output.getvalue().splitlines(), len(rows)


def test_the_first_proof_knows_no_time_and_the_next_one_does(tmp_path):
    file = tmp_path / "cache" / "times.json"
    first = proof(SectionTimes(file), [600.0, 1200.0], [2400.0])
    assert first == (
        [
            "1 of 2  motion: 0 min so far",
            "1 of 2  motion, row 1: 10 min so far",
            "1 of 2  motion, row 2: 30 min so far",
            "2 of 2  wander: 30 min so far",
            "2 of 2  wander, row 1: 1 h 10 min so far",
        ],
        3,
    )
    second, _ = proof(SectionTimes(file), [300.0, 20.0, 20.0, 260.0], [2400.0])
    assert second == [
        "1 of 2  motion: 0 min so far, about 1 h 10 min left",
        "1 of 2  motion, row 1: 5 min so far, about 1 h 5 min left",
        "1 of 2  motion, row 4: 10 min so far, about 1 h 0 min left",
        "2 of 2  wander: 10 min so far, about 40 min left",
        "2 of 2  wander, row 1: 50 min so far, about 0 min left",
    ]


@pytest.mark.parametrize(
    ("left", "words"),
    [
        ([None, None], "2 min so far"),
        ([None, 10 * MINUTE], "2 min so far, more than 10 min left"),
        ([None, 0.5 * MINUTE], "2 min so far"),
        ([5 * MINUTE, 10 * MINUTE], "2 min so far, about 15 min left"),
    ],
)
def test_an_unknown_section_makes_the_time_left_a_lower_bound(left, words):
    assert time_text(2 * MINUTE, left) == words


@pytest.mark.parametrize("content", ["", "[1]", '{"motion": "long", "wander": -1}', "{"])
def test_a_damaged_file_is_no_estimate_and_is_replaced(tmp_path, content):
    file = tmp_path / "times.json"
    file.write_text(content)
    lines, _ = proof(SectionTimes(file), [60.0], [60.0])
    assert lines[0] == "1 of 2  motion: 0 min so far"
    assert json.loads(file.read_text()) == {"motion": 60.0, "wander": 60.0}


def test_a_file_that_cannot_be_written_ends_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    lines, rows = proof(SectionTimes(tmp_path / "file" / "times.json"), [6.0], [6.0])
    assert len(lines) == rows == 2


def test_a_section_that_fails_in_the_middle_is_a_missed_row_and_the_next_one_follows(
    tmp_path, capsys
):
    def failing():
        yield Row("first", "1", "1", True)
        raise BrokenPipeError("the run has ended\nfurther lines")

    sections = [("loads", failing()), ("wander", iter([Row("second", "2", "2", True)]))]
    rows = list(with_progress(sections, SectionTimes(tmp_path / "times.json"), io.StringIO()))
    assert [(name, row.what, row.figure, row.met) for name, row in rows] == [
        ("loads", "first", "1", True),
        ("loads", "all rows", "BrokenPipeError: the run has ended", False),
        ("wander", "second", "2", True),
    ]
    assert "in failing" in capsys.readouterr().err  # the traceback, for whoever mends it
