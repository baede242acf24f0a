"""A proof prints each row, keeps it, and prints what changed since the last one; its sections."""

import re
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest

from tests.support.trials import proof
from tests.support.trials.row import NoData, Row
from tests.support.trials.section import Section, drawn

ROOT = Path(__file__).parent.parent


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a proof of these sections: its exit code, and the lines that it prints."""
    monkeypatch.setattr(proof, "cache", lambda: tmp_path)

    def run_once(*sections, brief=False, only=None, scale=1.0):
        options = Namespace(list=False, brief=brief, section=only, seed=5, scale=scale)
        code = proof.prove("prove", sections, options)
        return code, capsys.readouterr().out.splitlines()

    return run_once


def figures(seed, trials):
    yield Row("stops", f"{trials} of {trials}, seed {seed}", "all", trials > 1)


def test_a_row_is_one_line_with_its_section(run):
    code, lines = run(Section("motion", figures, {"trials": 9}))
    assert (code, lines) == (
        0,
        [
            "MET    motion: stops: 9 of 9, seed 5 (all)",
            "prove: 0 rows missed, 0 sections broken off",
        ],
    )


def test_a_smaller_share_measures_at_least_one_case(run):
    assert run(Section("motion", figures, {"trials": 2}), scale=0.1)[1][0] == (
        "MISSED motion: stops: 1 of 1, seed 5 (all)"
    )


def test_what_was_met_the_last_time_and_is_missed_now_is_printed_and_the_other_way_round(run):
    good, bad = Section("motion", figures, {"trials": 2}), Section("motion", figures, {"trials": 1})
    other = Section("wander", figures, {"trials": 2})
    assert run(good, other)[0] == 0
    code, lines = run(bad, other, only=["motion"])  # the rows of the other one are kept
    assert code == 1
    assert lines[1:] == [
        "CHANGED MISSED motion: stops: 1 of 1, seed 5 (all); it was MET with 2 of 2, seed 5",
        "prove: 1 rows missed, 0 sections broken off",
    ]
    assert "CHANGED" not in "".join(run(bad, other)[1])
    assert any(line.startswith("CHANGED MET    motion") for line in run(good, other)[1])


def test_a_brief_sample_is_small_and_statistics_of_it_are_not_judged(run):
    judged = Section("stops", figures, {"trials": 9}, {"trials": 1})
    statistics = Section("motion", figures, {"trials": 9}, {"trials": 1}, is_statistical=True)
    code, lines = run(judged, statistics, brief=True)
    assert code == 1
    assert [line.split(":")[0] for line in lines] == ["MISSED stops", "RAN    motion", "prove"]


def test_a_section_without_a_brief_form_is_named_with_the_reason(run):
    code, lines = run(Section("long", figures, {"trials": 9}, "it takes a day"), brief=True)
    assert code == 0
    assert lines[0] == "ONLY IN FULL long: it takes a day"


def test_a_section_that_breaks_off_or_is_empty_is_neither_met_nor_missed(run):
    def failing():
        yield Row("first", "1", "1", True)
        raise BrokenPipeError("the run has ended")

    code, lines = run(Section("loads", failing), Section("empty", lambda: iter(())))
    assert code == 2
    assert [line.split(": ")[0] for line in lines[:3]] == [
        "MET    loads",
        "BROKEN OFF loads",
        "BROKEN OFF empty",
    ]
    assert lines[-1] == "prove: 0 rows missed, 2 sections broken off"


def test_a_row_without_data_is_not_missed(run):
    code, lines = run(Section("ros2", lambda: iter([NoData("chain", "no rclpy", "x", True)])))
    assert code == 0 and lines[0].startswith("NO DATA ros2: chain")


def test_a_damaged_table_is_replaced(run, tmp_path):
    (tmp_path / "prove.tsv").write_text("nonsense\n")
    assert run(Section("motion", figures, {"trials": 2}))[0] == 0
    assert (tmp_path / "prove.tsv").read_text().startswith("MET\tmotion\tstops")


def test_cases_are_drawn_by_the_seed_in_their_order():
    assert drawn("abc", 3, 1) == drawn("abc", 99, 2) == ["a", "b", "c"]
    assert len({tuple(drawn("abcdef", 2, seed)) for seed in range(9)}) > 1
    assert all(drawn("abcdef", 3, seed) == sorted(drawn("abcdef", 3, seed)) for seed in range(9))


@pytest.mark.parametrize("module", ["prove", "prove.bench"])
def test_every_section_has_a_name_of_one_word_and_both_sizes(module):
    words = [sys.executable, "-m", module, "--list"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    lines = [line.split("\t") for line in done.stdout.splitlines()]
    assert len({name for name, _, _ in lines}) == len(lines) > 4
    for name, full, brief in lines:
        assert re.fullmatch(r"[a-z][a-z0-9-]+", name)
        assert full.startswith("full ") and brief.startswith("brief ")


def test_a_section_that_does_not_exist_is_refused():
    words = [sys.executable, "-m", "prove.bench", "--section", "nonsense"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "nonsense" in done.stderr
