"""The schemas: up to date, strict, and consistent with the section reader."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from diffbotctl.config import lookup, registry
from diffbotctl.config.section_reader import read_scalar
from diffbotctl.config.yaml_reader import parse
from diffbotctl.errors import ConfigurationError, Source
from diffbotctl.params import Param, Pin, Section, declared
from tests.support.reference import schemas
from tests.support.reference.schemas import of_declaration


@pytest.mark.parametrize("name", schemas.SCHEMAS)
def test_the_committed_schema_is_the_generated_one(name):
    committed = (lookup.folder("schemas") / name).read_text(encoding="utf-8")
    generated = schemas.text(schemas.SCHEMAS[name]())
    assert committed == generated, "run python -m tests.support.reference.schemas, read the diff"


@pytest.mark.parametrize("name", schemas.SCHEMAS)
def test_the_schema_is_valid(name):
    Draft202012Validator.check_schema(schemas.SCHEMAS[name]())


def every_property(schema, path="$"):
    if isinstance(schema, dict):
        for key, value in schema.get("properties", {}).items():
            if isinstance(value, dict):
                yield f"{path}.{key}", value
        for key, value in schema.items():
            yield from every_property(value, f"{path}.{key}")
    elif isinstance(schema, list):
        for item in schema:
            yield from every_property(item, path)


@pytest.mark.parametrize("name", schemas.SCHEMAS)
def test_every_key_is_described(name):
    schema = schemas.SCHEMAS[name]()
    for entry in ("BlockEntry", "DriveSection"):
        schema["$defs"].get(entry, {}).pop("if", None)
    for path, value in every_property(schema):
        if path.startswith("$.then.") or schemas.COMPLETE in path:
            continue  # only which keys are required
        if ".if" in path or ".then.in" in path or path.endswith((".then.with", ".then.in")):
            continue  # conditions; their keys are described elsewhere
        assert value.get("description"), f"{path} needs a sentence of help"


@pytest.mark.parametrize("name", schemas.SCHEMAS)
def test_every_mapping_of_known_keys_is_closed(name):
    def check(schema, path):
        if isinstance(schema, dict):
            if "properties" in schema and schema.get("type") == "object":
                assert schema["additionalProperties"] is False, path
            for key, value in schema.items():
                check(value, f"{path}.{key}")
        elif isinstance(schema, list):
            for item in schema:
                check(item, path)

    check(schemas.SCHEMAS[name](), "$")


def test_the_schema_finds_mistakes():
    schema = schemas.pipeline()
    head = {"format": 1, "kind": "pipeline"}
    wrong = [
        {**head, "blocks": {"a": {"block": "talker", "with": {"greting": "x"}}}},
        {**head, "blocks": {"a": {"block": "listener", "in": {"txt": "a.text"}}}},
        {**head, "blocks": {"a": {"block": "talker"}}, "goals": [{"x": "1 deg"}]},
        {**head},
    ]
    for content in wrong:
        assert not Draft202012Validator(schema).is_valid(content), content
    fine = {**head, "include": "goal", "goals": [{"x": "$side"}]}
    assert Draft202012Validator(schema).is_valid(fine)


class Leaves(Section):
    """One setting of each kind."""

    length = Param(float, unit="m", help="A length.")
    speed = Param(float, unit="m/s", help="A speed.")
    braking = Param(float, unit="m/s2", help="An acceleration.")
    share = Param(float, unit="1", help="A ratio.")
    gain = Param(float, help="A plain number.")
    count = Param(int, help="A whole number.")
    flag = Param(bool, help="True or false.")
    words = Param(str, help="A text.")
    pin = Param(Pin, help="A pin.")
    choice = Param(str, choices=("left", "right"), help="A word.")
    baud = Param(int, choices=(9600, 115200), help="A number of a few.")
    bounded = Param(int, minimum=1, maximum=9, help="A number within bounds.")
    maybe = Param(float, unit="s", none=True, default=None, help="A time, or none.")


WRITTEN = st.sampled_from(
    [
        "1",
        "0",
        "-3",
        "2.5",
        "1e-3",
        "65 mm",
        "65mm",
        "65  mm",
        ".5 m",
        "1. m",
        "10 %",
        "3 m/s",
        "3 m/s2",
        "3 m/s²",
        "90 deg",
        "1 furlong",
        "m",
        "mm 5",
        "5 5",
        "true",
        "yes",
        "none",
        "null",
        "~",
        "A0",
        "A",
        "B1",
        "54",
        "9600",
        "left",
        "lefty",
        "''",
        "'5'",
        "'5 mm'",
        "12:30",
        ".inf",
        "[1]",
        "{a: 1}",
        "9",
        "10",
        "1.0",
    ]
) | st.from_regex(r"[0-9 .eE+-]{1,6}( ?(mm|m|s|deg|%))?", fullmatch=True)


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(sorted(declared(Leaves))), WRITTEN)
def test_the_schema_and_the_section_reader_agree(name, written):
    """A schema cannot express bounds of quantities with a unit, so `Leaves` has none."""
    try:
        value = parse(Source("a.yaml", f"key: {written}\n")).at("key")
    except ConfigurationError:
        return
    if isinstance(value.data, dict | list):
        return
    if name == "pin" and isinstance(value.data, float):
        return  # JSON Schema takes 5. for the integer 5; the reader requires a pin label
    setting = declared(Leaves)[name]
    fits = Draft202012Validator(of_declaration(setting, {})).is_valid(value.plain())
    if value.data is None and setting.none:
        return  # the reader requires the word none
    word = setting.none and value.text == "none" and not value.quoted
    _, problem = (None, None) if word else read_scalar(value, setting.kind, setting)
    if problem is not None and problem.code == "E-BOUNDS" and isinstance(value.data, str):
        return  # 1E8mm: the largest magnitude of its kind, which no pattern expresses
    assert fits is (problem is None), problem


def test_every_parameter_of_a_block_has_a_help_sentence():
    for name in registry.BLOCKS:
        for setting in declared(registry.block(name)).values():
            assert setting.help.endswith("."), f"{name}.{setting.key} needs a sentence"
