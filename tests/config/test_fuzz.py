"""Any input, however wrong, gives a list of problems, never an exception."""

import json
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from diffbotctl.config import lookup
from diffbotctl.config.load import check, load
from diffbotctl.errors import Problem, UserError

SHIPPED = {
    path: path.read_bytes()
    for kind in ("robots", "pipelines")
    for path in sorted(lookup.folder(kind).glob("*.yaml"))
}
SCRAPS = [
    b"{",
    b"}",
    b"[",
    b"]",
    b":",
    b": ",
    b",",
    b"\n",
    b"\t",
    b"  ",
    b"- ",
    b"#",
    b"&a ",
    b"*a",
    b"!!",
    b"|",
    b">",
    b"'",
    b'"',
    b"$",
    b"$x",
    b"$$",
    b"~",
    b"null",
    b"yes",
    b"0",
    b"-1",
    b"1e9",
    b"017",
    b"1,5 m",
    b"65 mm",
    b"deg",
    b"robot.",
    b"operator.goal",
    b"in: ",
    b"with: ",
    b"none",
    b"\xff",
    b"\x00",
    b"\xc3\xa9",
    b"include: ",
    b"vars: ",
    b"<<: ",
    b"---\n",
    b"A99",
    b"...",
]
QUICK = settings(
    max_examples=50,  # `python -m prove --section hostile-files` draws more of the same kinds
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    """An empty working directory; shipped robots are found by name."""
    monkeypatch.chdir(tmp_path)


def problems_of(content: bytes, kind: str) -> tuple[Problem, ...]:
    Path(kind).mkdir(exist_ok=True)
    file = Path(kind) / "fuzzed.yaml"
    file.write_bytes(content)
    problems = check(str(file))
    for problem in problems:
        text = problem.render()
        assert problem.code in text
        assert "\x1b" not in text  # no control sequence of the file reaches the terminal
    return problems


def mutations():
    """A shipped file with up to four deletions, repetitions and insertions."""
    place = st.floats(0, 1, exclude_max=True)
    change = st.tuples(
        st.sampled_from(["cut", "double", "put"]), place, place, st.sampled_from(SCRAPS)
    )
    return st.tuples(st.sampled_from(sorted(SHIPPED)), st.lists(change, min_size=1, max_size=4))


def mutated(content: bytes, changes) -> bytes:
    for what, where, length, scrap in changes:
        begin = int(where * len(content))
        end = begin + int(length * 40)
        if what == "cut":
            content = content[:begin] + content[end:]
        elif what == "double":
            content = content[:end] + content[begin:end] + content[end:]
        else:
            content = content[:begin] + scrap + content[begin:]
    return content


@QUICK
@given(mutations())
def test_a_damaged_shipped_file_gives_problems(case):
    path, changes = case
    problems_of(mutated(SHIPPED[path], changes), path.parent.name)


@QUICK
@given(st.binary(max_size=400))
def test_random_bytes_give_problems(content):
    assert problems_of(content, "pipelines")


@QUICK
@given(st.lists(st.sampled_from(SCRAPS), max_size=40))
def test_random_scraps_of_yaml_give_problems(scraps):
    problems_of(b"format: 1\nkind: robot\ninclude: book_2wd\n" + b"".join(scraps), "robots")


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**6), 10**6)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.sampled_from(["65 mm", "90 deg", "", "none", "$x", "a.b", "robot.front", "A0", "5 m5"])
    | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=6,
)
ROBOT_KEYS = (
    "board",
    "link",
    "drive",
    "sensors",
    "body",
    "limits",
    "simulation",
    "calibration",
    "vars",
    "include",
    "battery",
    "format",
    "kind",
)
PIPELINE_KEYS = ("robot", "blocks", "goals", "world", "vars", "include", "format", "kind")


@QUICK
@given(st.sampled_from(ROBOT_KEYS), VALUES, st.booleans())
def test_any_value_for_any_section_of_a_robot_gives_problems(key, value, is_whole):
    head = "" if is_whole and key in ("format", "kind", "include") else "format: 1\n"
    body = f"{head}kind: robot\ninclude: book_2wd\n{json.dumps({key: value})[1:-1]}\n"
    problems_of(body.encode(), "robots")


@QUICK
@given(st.sampled_from(PIPELINE_KEYS), VALUES)
def test_any_value_for_any_section_of_a_pipeline_gives_problems(key, value):
    body = f"format: 1\nkind: pipeline\ninclude: goal\n{json.dumps({key: value})[1:-1]}\n"
    problems_of(body.encode(), "pipelines")


def paths(data, before=()):
    """Every path in nested mappings and lists."""
    if isinstance(data, dict | list):
        for key in data if isinstance(data, dict) else range(len(data)):
            yield (*before, key)
            yield from paths(data[key], (*before, key))


@QUICK
@given(st.data())
def test_a_shipped_file_with_one_value_changed_gives_problems(data):
    """The YAML stays valid, so these reach the section reader and the checks."""
    source = data.draw(st.sampled_from(sorted(SHIPPED)))
    content = yaml.safe_load(SHIPPED[source])
    *steps, last = data.draw(st.sampled_from(list(paths(content))))
    parent = content
    for step in steps:
        parent = parent[step]
    change = data.draw(st.sampled_from(["replace", "delete", "rename"]))
    value = parent.pop(last) if change != "replace" else data.draw(VALUES)
    if change == "replace":
        parent[last] = value
    elif change == "rename" and isinstance(parent, dict):
        parent[data.draw(st.text(max_size=6))] = value
    problems_of(json.dumps(content).encode(), source.parent.name)


@QUICK
@given(st.text(max_size=40))
def test_any_set_gives_problems(text):
    for first in ("", "follower.tolerance=", "robot.limits.speed=", "follower."):
        check("goal", None, [first + text])


NAMES = {file.stem for file in lookup.folder("pipelines").glob("*.yaml")}


@QUICK
@given(st.text(max_size=30).filter(lambda name: name not in NAMES))
def test_any_name_gives_problems(name):
    try:
        load(name)
    except UserError as error:
        assert error.problems
    else:
        raise AssertionError("nothing of that name should exist here")


def test_the_shipped_files_have_no_problem(monkeypatch):
    os.chdir(lookup.folder("robots").parent)
    for path in SHIPPED:
        assert not [p for p in check(str(path)) if p.severity == "error"], path
