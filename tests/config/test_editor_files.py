"""What an editor with our schemas reports in the files that we ship, and show in the documents."""

import json
import re
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from diffbotctl.config.configuration import Pipeline
from diffbotctl.config.robot import DriveSection, Robot
from diffbotctl.params import declared

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCED = re.compile(r"^```yaml\n(.*?)^```", re.M | re.S)
INDENTED = re.compile(r"(?:^    .*\n)+", re.M)
HEAD = {"format": 1, "include": "another"}  # of a file that states only what differs
# Where a fragment may belong: the kind of the file, and its keys there.
PLACES = {
    "robot": {setting.key for setting in declared(Robot).values()},
    "pipeline": {setting.key for setting in declared(Pipeline).values()},
    "drive": {setting.key for setting in declared(DriveSection).values()},
}


def mistakes(kind, content):
    """What the schema of `kind` does not allow in a file."""
    schema = json.loads((ROOT / "schemas" / f"{kind}.schema.json").read_text())
    errors = Draft202012Validator(schema).iter_errors(content)
    return [f"{error.json_path}: {error.message}" for error in errors]


def whole_file(content):
    """Kind and content of the file that a shown text is, or belongs to; None if to neither."""
    if "kind" in content:
        return content["kind"], content
    for place, keys in PLACES.items():
        if content and content.keys() <= keys:
            if place == "drive":
                return "robot", {**HEAD, "kind": "robot", "drive": content}
            return place, {**HEAD, "kind": place, **content}
    return None


def shown_files():
    """The robot, pipeline and view files of the documents: page, line, kind, content."""
    for page in PAGES:
        text = page.read_text()
        for block in [*FENCED.finditer(text), *INDENTED.finditer(text)]:
            indent = "" if block[0].startswith("```") else "    "
            shown = block[1] if not indent else re.sub(f"^{indent}", "", block[0], flags=re.M)
            try:
                content = yaml.safe_load(shown)
            except yaml.YAMLError:
                continue  # commands, and code
            found = whole_file(content) if isinstance(content, dict) else None
            if found is not None and found[0] != "lesson":
                line = text.count("\n", 0, block.start()) + 1
                yield pytest.param(*found, id=f"{page.name}:{line}")


SHOWN = list(shown_files())


@pytest.mark.parametrize(("kind", "content"), SHOWN)
def test_a_documented_file_has_no_mistake_for_an_editor(kind, content):
    assert not mistakes(kind, content)


def test_the_documented_files_are_found():
    assert {shown.values[0] for shown in SHOWN} == {"robot", "pipeline", "trials", "view"}
    fenced = sum(len(FENCED.findall(page.read_text())) for page in PAGES)
    answers = 3  # of calibrations and a lesson, which have no schema
    assert len(SHOWN) >= fenced - answers


SHIPPED = sorted([*(ROOT / "robots").glob("*.yaml"), *(ROOT / "pipelines").glob("*.yaml")])


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_file_has_no_mistake_for_an_editor(path):
    text = path.read_text()
    kind = path.parent.name.removesuffix("s")
    assert text.startswith(f"# yaml-language-server: $schema=../schemas/{kind}.schema.json\n")
    assert not mistakes(kind, yaml.safe_load(text))


INCOMPLETE = (
    ("robot", {"drive": {"track": "142 mm"}}, "'left' is a required property"),
    ("robot", {"sensors": {"front": {"pin": "A1"}}}, "'type' is a required property"),
    ("robot", {"calibration": {"drive.track": {"sd": 1.0}}}, "'value' is a required property"),
    ("pipeline", {"blocks": {"guard": {"in": {}}}}, "'block' is a required property"),
    ("pipeline", {"sources": {"lidar": {"timeout": 1}}}, "'driver' is a required property"),
    ("pipeline", {"programs": {"nose": {"timeout": 1}}}, "'run' is a required property"),
)


@pytest.mark.parametrize(("kind", "part", "missing"), INCOMPLETE)
def test_only_with_an_include_a_mapping_may_be_incomplete(kind, part, missing):
    content = {"format": 1, "kind": kind, **part}
    assert any(mistake.endswith(missing) for mistake in mistakes(kind, content))
    assert not mistakes(kind, {**content, "include": "another"})


def test_the_items_of_a_list_are_complete_also_with_an_include():
    """Includes are merged by mappings; a list replaces the included one."""
    wall = {**HEAD, "kind": "pipeline", "world": {"walls": [{"from": [0, 0]}]}}
    assert mistakes("pipeline", wall) == ["$.world.walls[0]: 'to' is a required property"]


def test_unknown_keys_are_mistakes_also_with_an_include():
    robot = {**HEAD, "kind": "robot", "drive": {"trak": "142 mm"}}
    assert ["trak" in mistake for mistake in mistakes("robot", robot)] == [True]
