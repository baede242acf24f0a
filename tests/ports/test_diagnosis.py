"""Each situation of a port is diagnosed correctly, with its fix."""

import pytest

from tests.support.trials.ports import SITUATIONS, problems_of, right


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda each: each.name)
def test_each_situation_is_diagnosed(situation, tmp_path):
    problems = problems_of(situation, tmp_path)
    assert right(situation, problems), [problem.render() for problem in problems]


def test_the_check_can_fail(tmp_path):
    """The same check with wrong expectations."""
    free = SITUATIONS[0]
    assert not right(free._replace(code="E-PORT-BUSY"), problems_of(free, tmp_path / "a"))
    held = next(each for each in SITUATIONS if each.name == "held by screen")
    assert not right(held._replace(code=""), problems_of(held, tmp_path / "b"))
    assert not right(held._replace(fix="chmod 777"), problems_of(held, tmp_path / "c"))


def test_no_fix_recommends_chmod():
    for situation in SITUATIONS:
        assert "chmod" not in situation.fix or "Never chmod 777" in situation.fix
