"""Saved views: what is written is read again, and a wrong file is refused with its places."""

import json

import pytest
import yaml
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from diffbotctl.cli.check import check
from diffbotctl.config.lookup import folder
from diffbotctl.errors import ConfigurationError
from diffbotctl.ui.saved_view import (
    SCREEN_PANELS,
    ViewSettings,
    read_view,
    save_view,
    view_text,
)
from tests.support.reference.schemas import view

SCHEMA = Draft202012Validator(json.loads((folder("schemas") / "view.schema.json").read_text()))
METRES = st.floats(-900, 900).map(lambda value: round(value, 3))
VIEWS = st.builds(
    ViewSettings,
    panel=st.sampled_from(SCREEN_PANELS),
    fields=st.lists(st.from_regex(r"[a-z]{1,5}\.[a-z_]{1,5}\.[a-z]", fullmatch=True)).map(tuple),
    span=st.sampled_from((7.5, 15.0, 30.0, 120.0)),
    place=st.none() | st.tuples(METRES, METRES, st.sampled_from((0.05, 2.125, 5000.0))),
    follows=st.just(False),
)


@given(VIEWS)
def test_what_is_written_is_read_again_and_fits_the_schema(tmp_path_factory, saved):
    path = tmp_path_factory.mktemp("view") / "v.yaml"
    assert "saved" in save_view(path, saved)
    assert read_view(str(path)) == saved
    assert not list(SCHEMA.iter_errors(yaml.safe_load(path.read_text())))


def test_following_is_kept(tmp_path):
    saved = ViewSettings(place=(1.0, 2.0, 3.0), follows=True)
    (tmp_path / "v.yaml").write_text(view_text(saved))
    assert read_view(str(tmp_path / "v.yaml")) == saved


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("panel: mpa\n", ["E-CHOICE"]),
        ("plots: {span: 5 m}\n", ["E-UNIT"]),
        ("plots: {span: 500}\n", ["E-BOUNDS"]),
        ("plots: {fileds: [a.b.c]}\n", ["E-KEY-UNKNOWN"]),
        ("map: {x: 1 m}\n", ["E-KEY-MISSING"]),
    ],
)
def test_a_wrong_view_is_refused_with_its_place(tmp_path, text, codes):
    path = tmp_path / "v.yaml"
    path.write_text(f"format: 1\nkind: view\n{text}")
    with pytest.raises(ConfigurationError) as caught:
        read_view(str(path))
    assert [problem.code for problem in caught.value.problems] == codes
    assert "v.yaml:3:" in str(caught.value)
    result = CliRunner().invoke(check, [str(path)])
    assert result.output.count("v.yaml:3:") == len(codes) and codes[0] in result.output
    assert not SCHEMA.is_valid(yaml.safe_load(path.read_text()))


def test_check_knows_a_view(tmp_path):
    save_view(tmp_path / "v.yaml", ViewSettings())
    result = CliRunner().invoke(check, [str(tmp_path / "v.yaml")])
    assert result.output == f"{tmp_path / 'v.yaml'}: no errors\n"


def test_no_other_file_is_overwritten(tmp_path):
    robot = tmp_path / "robot.yaml"
    robot.write_text("format: 1\nkind: robot\n")
    assert "is no view" in save_view(robot, ViewSettings())
    assert robot.read_text() == "format: 1\nkind: robot\n"
    assert "cannot be written" in save_view(tmp_path / "no" / "v.yaml", ViewSettings())


def test_every_key_has_help():
    assert all(entry["description"] for entry in view()["properties"].values())
