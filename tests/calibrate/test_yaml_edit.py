"""Changing one value of a YAML file leaves every other character as it is."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.calibrate.yaml_edit import with_entry

FLOW = """\
# mine
blocks:
  guard: {block: obstacle_stop, with: {margin: 5 cm, debounce: 2}}  # in front
  path: {block: path}   # round
# the end
"""
BLOCK = """\
blocks:
  guard:
    block: obstacle_stop
    with:
      margin: 5 cm   # of air

      # debounce stays
      debounce: 2  # readings
    # behind it
world: {}
"""


@pytest.mark.parametrize(
    "text, path, written, changed, into",
    [
        (FLOW, "blocks.guard.with.margin", "8 cm", "margin: 5 cm", "margin: 8 cm"),
        (FLOW, "blocks.guard.with.resume", "wait", "debounce: 2}", "debounce: 2, resume: wait}"),
        (FLOW, "blocks.path.with.side", "1 m", "block: path}", "block: path, with: {side: 1 m}}"),
        (
            FLOW,
            "blocks.mux.with.held_for",
            "0.3 s",
            "# round\n",
            "# round\n  mux: {with: {held_for: 0.3 s}}\n",
        ),
        (BLOCK, "blocks.guard.with.margin", "8 cm", "5 cm", "8 cm"),
        (
            BLOCK,
            "blocks.guard.with.resume",
            "wait",
            "# readings\n",
            "# readings\n      resume: wait\n",
        ),
        (BLOCK, "world.walls", "[]", "world: {}", "world: {walls: []}"),
        ("a: 1", "b.c", "2", "a: 1", "a: 1\nb: {c: 2}"),
    ],
)
def test_only_one_value_changes(text, path, written, changed, into):
    assert text.count(changed) == 1
    assert with_entry(text, path.split("."), written) == text.replace(changed, into)


@pytest.mark.parametrize(
    "text", ["- 1\n", "blocks: 3\n", "blocks: &a {guard: {with: &b {margin: 1}}}\nc: *b\n"]
)
def test_an_unsafe_change_is_refused(text):
    with pytest.raises(ValueError):
        with_entry(text, ["blocks", "guard", "with", "margin"], "2")


KEYS = st.sampled_from(["a", "b", "c"])
TREES = st.recursive(
    st.integers() | st.text("xyz", min_size=1),
    lambda inner: st.dictionaries(KEYS, inner, min_size=1, max_size=3),
    max_leaves=8,
)


@given(
    st.dictionaries(KEYS, TREES, min_size=1),
    st.lists(KEYS, min_size=1, max_size=3),
    st.booleans() | st.none(),
)
def test_in_any_layout_the_result_is_as_expected_or_refused(tree, path, flow):
    text = yaml.safe_dump(tree, default_flow_style=flow)
    try:
        after = with_entry(text, path, "0.5 m")
    except ValueError:
        return
    place = yaml.safe_load(after)
    for step in path:
        place = place[step]
    assert place == "0.5 m"
