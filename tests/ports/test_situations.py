"""Each situation of a port is named rightly, with its fix."""

import pytest

from diffbotctl.testing.trials.ports import SITUATIONS, right, said


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda each: each.name)
def test_what_is_said(situation, tmp_path):
    problems = said(situation, tmp_path)
    assert right(situation, problems), [problem.render() for problem in problems]


def test_the_judgement_can_be_wrong(tmp_path):
    """The same check on what is not so."""
    free = SITUATIONS[0]
    assert not right(free._replace(code="E-PORT-BUSY"), said(free, tmp_path / "a"))
    held = next(each for each in SITUATIONS if each.name == "held by screen")
    assert not right(held._replace(code=""), said(held, tmp_path / "b"))
    assert not right(held._replace(fix="chmod 777"), said(held, tmp_path / "c"))


def test_nobody_is_told_to_chmod():
    for situation in SITUATIONS:
        assert "chmod" not in situation.fix or "Never chmod 777" in situation.fix
