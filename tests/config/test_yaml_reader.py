"""The YAML reader: words stay text, numbers are decimal, every value knows its place."""

import os
import time

import pytest

from diffbotctl.config import yaml_reader
from diffbotctl.errors import ConfigurationError, Source


def parsed(text):
    return yaml_reader.parse(Source("a.yaml", text)).plain()


def code_of(text):
    with pytest.raises(ConfigurationError) as caught:
        yaml_reader.parse(Source("a.yaml", text))
    return [problem.code for problem in caught.value.problems]


@pytest.mark.parametrize(
    "written, meant",
    [
        ("x", "x"),
        ("y", "y"),  # YAML 1.1 reads y and n as true and false
        ("n", "n"),
        ("yes", "yes"),
        ("on", "on"),
        ("Off", "Off"),
        ("true", True),
        ("False", False),
        ("1e-3", 0.001),  # YAML 1.1 reads text, because there is no point
        ("1.5e3", 1500.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-0.5", -0.5),
        ("+3", 3),
        ("0", 0),
        ("-0", 0),
        ("12:30", "12:30"),  # YAML 1.1 reads 750
        ("1_000", "1_000"),  # YAML 1.1 reads 1000
        (".inf", ".inf"),
        (".nan", ".nan"),
        ("2026-05-01", "2026-05-01"),  # YAML 1.1 reads a date
        ("1.10", 1.1),
        ("65 mm", "65 mm"),
        ("~", None),
        ("null", None),
        ("none", "none"),
        ("'12'", "12"),
        ('"true"', "true"),
        ("A0", "A0"),
        ("|\n  two\n  lines", "two\nlines\n"),
    ],
)
def test_scalars(written, meant):
    value = parsed(f"key: {written}\n")["key"]
    assert value == meant
    assert type(value) is type(meant)


def test_keys_are_text():
    text = "{x: 1, y: 2, n: 3, on: 4, no: 5, 1: 6, null: 7, true: 8, 017: 9}"
    assert list(parsed(text)) == ["x", "y", "n", "on", "no", "1", "null", "true", "017"]


@pytest.mark.parametrize(
    "text, code",
    [
        ("a: 017\n", "E-YAML-NUMBER"),
        ("a: 0o17\n", "E-YAML-NUMBER"),
        ("a: 0x1F\n", "E-YAML-NUMBER"),
        ("a: 0b101\n", "E-YAML-NUMBER"),
        ("a: 089\n", "E-YAML-NUMBER"),
        ("a: 1e400\n", "E-YAML-NUMBER"),
        ("a: " + "9" * 5000 + "\n", "E-YAML-NUMBER"),
        ("a: 1\na: 2\n", "E-YAML-DUPLICATE"),
        ("a: {b: 1,5 m}\n", "E-YAML-COMMA"),
        ("a:\n\tb: 1\n", "E-YAML-TAB"),
        ("- 1\n", "E-YAML-TOP"),
        ("", "E-YAML-TOP"),
        ("# only a comment\n", "E-YAML-TOP"),
        ("a: \x01\n", "E-FILE-ENCODING"),
    ],
)
def test_ambiguous_yaml_is_an_error(text, code):
    assert code_of(text) == [code]


def test_all_errors_of_a_file_are_reported_together():
    # line 1: an octal; line 2: a decimal comma; line 3: a key given twice
    assert code_of("a: 017\nb: {c: 1,5 m}\na: 2\n") == [
        "E-YAML-NUMBER",
        "E-YAML-COMMA",
        "E-YAML-DUPLICATE",
    ]


def test_an_alias_repeats_a_value():
    assert parsed("a: &a {x: 1}\nb: *a\n") == {"a": {"x": 1}, "b": {"x": 1}}


DRIVE = """\
drive:
  track: 125 mm
  left: {pins: [5, 6]}
  right:
"""


@pytest.mark.parametrize(
    "steps, line, column, length",
    [
        (("drive",), 1, 1, 5),  # the place of a block is that of its key
        (("drive", "track"), 2, 10, 6),
        (("drive", "left", "pins", 1), 3, 20, 1),
        (("drive", "left", "pins"), 3, 10, 4),  # a list in brackets too
        (("drive", "right"), 4, 3, 5),  # without a value: the place of the key
    ],
)
def test_every_value_knows_its_place(steps, line, column, length):
    spot = yaml_reader.parse(Source("a.yaml", DRIVE)).at(*steps).place
    assert (spot.line, spot.column, spot.length) == (line, column, length)


def test_columns_count_characters_not_bytes():
    value = yaml_reader.parse(Source("a.yaml", "greeting: {text: grüß, name: x}\n"))
    assert value.at("greeting", "name").place.column == 30


def bomb(width, depth):
    """A file of `depth` short lines that expands to width ** depth values."""
    lines = [f"a0: &a0 [{', '.join(['x'] * width)}]"]
    for i in range(depth):
        lines.append(f"a{i + 1}: &a{i + 1} [{', '.join([f'*a{i}'] * width)}]")
    return "\n".join(lines).encode()


# Without a zero byte it fails as text; with one it is no text.
JUNK = bytes(range(1, 256)) * 300
BINARY = bytes(range(256)) * 300


@pytest.mark.parametrize(
    "content, code",
    [
        (bomb(10, 9), "E-YAML-SIZE"),
        (bomb(2, 200), "E-YAML-SIZE"),
        (b"a: " + b"[" * 200_000, "E-YAML-SIZE"),
        (b"a: " + b"{a: " * 60_000, "E-YAML-SIZE"),
        (b"\n".join(b" " * i + b"a:" for i in range(600)), "E-YAML-SIZE"),
        (b"a: 1\n" * 10_000_000, "E-FILE-SIZE"),  # 50 MB
        (JUNK, "E-FILE-ENCODING"),
        (BINARY, "E-FILE-ENCODING"),
        ("format: 1\n".encode("utf-16"), "E-FILE-ENCODING"),
        (b"name: gr\xfc\xdf\n", "E-FILE-ENCODING"),  # Latin-1
    ],
    ids=[
        "bomb",
        "slim bomb",
        "brackets",
        "braces",
        "stairs",
        "50 MB",
        "junk",
        "binary",
        "UTF-16",
        "Latin-1",
    ],
)
def test_a_file_that_is_no_configuration_is_refused_quickly(tmp_path, content, code):
    file = tmp_path / "hard.yaml"
    file.write_bytes(content)
    begin = time.process_time()
    with pytest.raises(ConfigurationError) as caught:
        yaml_reader.read(str(file))
    # The limit is 1 s of processor time, which does not depend on other processes.
    assert time.process_time() - begin < 1.0
    assert caught.value.problems[0].code == code


def test_the_first_byte_that_is_not_utf8_has_a_place(tmp_path):
    file = tmp_path / "latin.yaml"
    file.write_bytes("a: 1\nname: grüß\n".encode("latin-1"))
    with pytest.raises(ConfigurationError) as caught:
        yaml_reader.read(str(file))
    problem = caught.value.problems[0]
    assert (problem.line, problem.column) == (2, 9)  # `name: gr` has eight characters


def test_a_byte_order_mark_is_ignored(tmp_path):
    file = tmp_path / "bom.yaml"
    file.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert yaml_reader.read(str(file)).plain() == {"a": 1}


@pytest.mark.parametrize("make", ["directory", "pipe", "nothing", "device", "forbidden"])
def test_a_path_that_is_no_regular_file_is_refused(tmp_path, make):
    path = tmp_path / "thing.yaml"
    if make == "directory":
        path.mkdir()
    elif make == "pipe":
        os.mkfifo(path)  # reading it would block
    elif make == "device":
        path = "/dev/zero"  # reading it would never end
    elif make == "forbidden":
        path = tmp_path / ("x" * 300)  # no file system has such a name
    with pytest.raises(ConfigurationError) as caught:
        yaml_reader.read(str(path))
    problem = caught.value.problems[0]
    assert problem.code == "E-FILE-READ"
    assert problem.fix
