"""Renamed and retired keys and values are accepted; the warning shows the new line."""

import pytest

from diffbotctl.config.load import load_robot
from diffbotctl.config.renamed_keys import RenamedKey, RenamedValue, RetiredKey, update_tree
from diffbotctl.config.yaml_reader import parse
from diffbotctl.errors import Source


@pytest.mark.parametrize(
    ("text", "change", "updated", "fix"),
    [
        (
            "a: {old: 5, b: 6}\n",
            RenamedKey(("a", "old"), "new"),
            {"a": {"b": 6, "new": 5}},
            "write `a: {new: 5, b: 6}`",
        ),
        (
            "a:\n  c: former  # a comment\n",
            RenamedValue(("a", "c"), "former", "present"),
            {"a": {"c": "present"}},
            "write `c: present  # a comment`",
        ),
        (
            "a: {c: 1}\nd: 2\n",
            RetiredKey(("a", "*"), "not read"),
            {"a": {}, "d": 2},
            "remove the key",
        ),
        ("a: {c: 1}\n", RenamedKey(("b", "c"), "d"), {"a": {"c": 1}}, None),
        ("a: {c: 1}\n", RenamedValue(("a", "c"), "2", "3"), {"a": {"c": 1}}, None),
    ],
)
def test_an_old_key_or_value_is_updated(text, change, updated, fix):
    problems = []
    assert update_tree(parse(Source("a.yaml", text)), [change], problems).plain() == updated
    assert [problem.fix for problem in problems] == ([] if fix is None else [fix])
    assert all(problem.severity == "warning" for problem in problems)


def test_a_robot_with_old_keys_is_the_same_robot(tmp_path):
    def robot(drive):
        file = tmp_path / "mine.yaml"
        file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\ndrive: {drive}\n")
        return load_robot(str(file))

    former = robot("{polarity: by_hand, motor: {start_duty: 0.2}}")
    present = robot("{polarity: checked_by_hand}")
    assert repr(former.robot) == repr(present.robot)
    assert [warning.code for warning in former.warnings] == ["W-OUTDATED", "W-OUTDATED"]
    assert present.warnings == ()
