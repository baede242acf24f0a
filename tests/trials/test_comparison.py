"""What runs prove, by published figures, and what a comparison with others finds."""

import json
import re
from fractions import Fraction
from math import comb

import pytest

from diffbotctl.errors import UsageError
from diffbotctl.trials.comparison import ComparedRun, compare, read_baseline
from diffbotctl.trials.plan import read_plan
from diffbotctl.trials.report import html
from diffbotctl.trials.sections import Expectation
from diffbotctl.trials.statistics import mean_difference, paired_shares, proven_share
from diffbotctl.trials.summary import record
from diffbotctl.trials.verdict import judge
from tests.trials.test_trials import trials_file
from tests.trials.test_verdict import GOOD, STOPPED


@pytest.mark.parametrize(
    ("passed", "runs", "share"),
    [
        (30, 30, 0.05 ** (1 / 30)),  # 0.905: all of 30
        (300, 300, 0.990),  # the rule of three: 1 - 3 / 300
        (9, 10, 0.606),  # tables of Clopper and Pearson, one-sided 95 %
        (0, 10, 0.0),
    ],
)
def test_what_runs_prove(passed, runs, share):
    assert proven_share(passed, runs) == pytest.approx(share, abs=0.001)


@pytest.mark.parametrize("runs", [1, 2, 7, 25])
def test_what_runs_prove_is_the_exact_bound(runs):
    for passed in range(1, runs + 1):
        bound = Fraction(proven_share(passed, runs))
        lower, upper = (
            sum(comb(runs, k) * p**k * (1 - p) ** (runs - k) for k in range(passed, runs + 1))
            for p in (bound - Fraction(1, 10**9), bound + Fraction(1, 10**9))
        )
        assert lower < Fraction(1, 20) < upper


@pytest.mark.parametrize("runs", [1030, 100_000])
def test_what_many_runs_prove_is_about_the_normal_bound(runs):
    for passed in (runs // 2, runs * 9 // 10):
        share = passed / runs
        normal = share - 1.645 * (share * (1.0 - share) / runs) ** 0.5
        assert proven_share(passed, runs) == pytest.approx(normal, abs=2.0 / runs)
    assert proven_share(runs, runs) == pytest.approx(0.05 ** (1 / runs), abs=1e-9)


def test_the_interval_of_a_mean_difference():
    # 10 values 1 to 10: mean 5.5, standard deviation 3.028, t of 9 degrees 2.262.
    found = mean_difference([float(value) for value in range(1, 11)])
    half = 2.262 * 3.0277 / 10**0.5
    assert (found.value, found.low, found.high) == pytest.approx(
        (5.5, 5.5 - half, 5.5 + half), abs=0.01
    )
    assert found.is_proven and not mean_difference([-1.0, 0.0, 1.0]).is_proven
    assert mean_difference([1.0, 2.0]) is None


def test_the_interval_of_paired_shares():
    same = [(True, True)] * 20
    assert paired_shares(same).value == 0.0 and not paired_shares(same).is_proven
    worse = paired_shares(same + [(True, False)] * 10)
    assert worse.value == pytest.approx(-1 / 3) and worse.high < 0.0


def runs(passed=10, error=0.004, time=6.0, name="healthy"):
    return [
        ComparedRun(f"{name}/{seed}", seed < passed, error + 0.0001 * seed, time + 0.01 * seed)
        for seed in range(10)
    ]


@pytest.mark.parametrize(
    ("before", "after", "is_regression"),
    [
        (runs(), runs(), False),
        (runs(), runs(passed=9), True),
        (runs(passed=8), runs(passed=9), False),
        (runs(), runs(error=0.006), True),
        (runs(), runs(error=0.0042), False),  # proven, but less than a tenth
        (runs(), runs(time=7.0), True),
        (runs(), runs(time=5.0, error=0.002), False),
        (runs(), runs(name="other"), False),  # paired by their places
    ],
)
def test_a_regression(before, after, is_regression):
    comparison = compare("base", before, after, by_name=before[0].name == after[0].name)
    assert comparison.is_regression is is_regression
    assert len(comparison.pairs) == 10
    lines = list(comparison.lines())
    assert lines[0] == "against base, 10 pairs with equal seeds:"
    assert max(map(len, lines)) <= 80
    assert lines[-1].startswith("REGRESSION") is is_regression


@pytest.mark.parametrize(
    ("after", "worse"),
    [
        (runs(error=0.006), "the error"),
        (runs(time=7.0), "the time"),
        (runs(error=0.006, time=7.0), "the error and the time"),
        (runs(passed=9), "healthy/9"),
    ],
)
def test_a_regression_names_what_is_worse(after, worse):
    *_, last = compare("base", runs(), after, by_name=True).lines()
    assert last == f"REGRESSION: worse than base: {worse}"


def test_a_baseline_is_what_json_has_printed(tmp_path):
    judged = [judge(GOOD, Expectation()), judge(STOPPED, Expectation(reach=9.0))]
    file = tmp_path / "base.json"
    file.write_text("".join(f"{json.dumps(record(each))}\n" for each in judged))
    found = read_baseline(file, {GOOD.name})
    assert found == [ComparedRun.of(each) for each in judged]
    assert [run.passed for run in found] == [True, False]
    with pytest.raises(UsageError, match="it has none of these runs"):
        read_baseline(file, {"other"})
    with pytest.raises(UsageError, match="No such file"):
        read_baseline(tmp_path / "other.json", {GOOD.name})


def line(**changed):
    return json.dumps({**record(judge(GOOD, Expectation())), **changed})


@pytest.mark.parametrize(
    "wrong",
    [
        "nothing",
        "[" * 100_000,
        "5",
        "{",
        '{"run": "a"}',
        line(run=5),
        line(passed="yes"),
        line(outcome=None),
        line(outcome=[]),
        line(error="abc"),
        line(error=float("nan")),
        line(error=float("inf")),
        line(error=True),
        line(error=10**400),
        line(outcome="stopped", error="abc"),
        line(time="5"),
        line(time=None),
    ],
    ids=lambda text: text[-40:],
)
def test_a_wrong_line_of_a_baseline_is_named(tmp_path, wrong):
    file = tmp_path / "base.json"
    file.write_text(f"{line()}\n{wrong}\n{line()}\n")
    with pytest.raises(UsageError) as caught:
        read_baseline(file, {GOOD.name})
    (problem,) = caught.value.problems
    assert (problem.code, problem.place) == ("E-TRIALS-BASELINE", f"{file}:2")


@pytest.mark.parametrize(
    ("before", "after", "pairs", "unpaired"),
    [
        (runs(), runs(), 10, (0, 0)),
        (runs(), runs()[2:], 8, (2, 0)),
        (runs()[:5], runs()[3:], 2, (3, 5)),
        (runs()[:9] + runs(name="other")[:1], runs(), 9, (1, 1)),  # equal counts
    ],
)
def test_runs_are_paired_with_those_of_a_file_by_their_names_alone(before, after, pairs, unpaired):
    comparison = compare("base.json", before, after, by_name=True)
    assert all(first.name == second.name for first, second in comparison.pairs)
    assert (len(comparison.pairs), comparison.unpaired) == (pairs, unpaired)
    head, second, *_ = comparison.lines()
    assert head == f"against base.json, {pairs} pairs with equal seeds:"
    others, these = unpaired
    counts = f"  without a partner of the same name: {these} of these, {others} of the other"
    assert (second == counts) is any(unpaired)


def test_the_report_is_one_file_with_the_failed_runs_first(tmp_path):
    plan = read_plan(str(trials_file(tmp_path)))
    path = tuple((0.001 * step, 0.0005 * step) for step in range(120))
    judged = [
        judge(
            GOOD._replace(name=trial.name, case=trial.case, path=path, cause="<b>", error=0.2),
            Expectation(error=0.1 if trial.case == "blocked" else 1.0),
        )
        for trial in plan.trials
    ]
    text = html(plan, judged, 12.0)
    assert not re.search(r"https?://|src=|href=", text)
    names = [name.replace("<wbr>", "") for name in re.findall(r"<b>(.*?)</b>", text)]
    assert [name.split("/")[0] for name in names] == ["blocked", "blocked", "healthy", "healthy"]
    assert f"--only {names[0]} --watch" in text and "prefers-color-scheme:dark" in text
    assert text.count("<svg") == 4
    assert len(text) - len(html(plan, judged[:2], 12.0)) < 2 * 4500  # 1 MB for 210 runs
