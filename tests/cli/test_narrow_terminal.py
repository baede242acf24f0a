"""On a terminal that is narrower than 80 columns no word is broken, and no drawing is torn."""

import io
import re
from importlib import import_module

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from diffbotctl.cli import log, main
from diffbotctl.config.lookup import folder
from diffbotctl.printable import fold_line, fold_lines, keep_lines, printable_stream, write_raw
from tests.sampling import each_once
from tests.support.running import command
from tests.support.terminal import Terminal

COLUMNS, LINES = 60, 150
COMMANDS = [
    ("frames", "book_2wd"),
    ("wiring", "book_2wd"),
    ("graph", "goal"),
    ("blocks", "show", "odometry"),
    ("run", "goal", "--port", "/dev/ttyNOPE"),
    ("frames", "bok_2wd"),
]

FOLDED = (
    # line, width, column, what comes of it
    ("short", 10, 0, "short"),
    ("one two three", 7, 0, "one two\n  three"),
    ("one two three", 9, 6, "one\n  two\n  three"),  # six columns are taken already
    ("a      column  of a table", 16, 0, "a      column\n  of a table"),
    ("  indented text here", 12, 0, "  indented\n    text\n    here"),
    ("see /a/path/longer/than/that x", 10, 0, "see\n  /a/path/longer/than/that\n  x"),
    ("/a/path/longer/than/that", 10, 0, "/a/path/longer/than/that"),
    ("", 10, 0, ""),
    ("see `diffbotctl run goal` now", 12, 0, "see\n  `diffbotctl run goal`\n  now"),
    ("    diffbotctl run goal", 12, 0, "    diffbotctl run goal"),
    ("  Wires: diffbotctl wiring /a/path", 20, 0, "  Wires:\n    diffbotctl wiring /a/path"),
    ("diffbotctl is no command", 12, 0, "diffbotctl\n  is no\n  command"),
)


@pytest.mark.parametrize(("line", "width", "column", "expected"), FOLDED)
def test_folding(line, width, column, expected):
    assert fold_line(line, width, column) == expected


@given(st.text(alphabet="ab  ", max_size=80), st.integers(4, 30))
def test_no_word_is_lost_or_broken_and_no_row_is_too_long(line, width):
    folded = fold_line(line, width)
    assert folded.split() == line.split()
    for row in folded.split("\n"):
        assert len(row) <= width or len(row.split()) == 1


def test_a_line_of_the_log_is_folded_on_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    line = {"time": 0, "level": "error", "source": "gate", "text": "STOP a cause " * 20}
    log._print_line(line)
    rows = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()
    assert len(rows) > 4 and max(map(len, rows)) <= COLUMNS


def test_a_stream_folds_what_is_printed_and_not_what_others_read():
    output = printable_stream(io.TextIOWrapper(io.BytesIO(), encoding="utf-8"))
    fold_lines(output, 20)
    write_raw(output, "\x1b[31merror:\x1b[0m")  # six columns
    print(" one two three four", file=output)
    print("five six seven eight nine", file=output)
    keep_lines(output)
    print('{"json": "is never folded"}', file=output)
    output.flush()
    text = output.buffer.getvalue().decode()
    assert text == (
        "\x1b[31merror:\x1b[0m one two three\n  four\nfive six seven eight\n  nine\n"
        '{"json": "is never folded"}\n'
    )


def shown(folder, columns, words):
    """The words on a terminal, after the command has ended."""
    line, environment = command(folder, *words)
    with Terminal(line, environment, columns, LINES) as terminal:
        terminal.ended()
        return terminal.text


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_no_word_of_a_command_is_broken(tmp_path, words):
    narrow, wide = (shown(tmp_path, columns, words) for columns in (COLUMNS, 160))
    broken = {word for word in set(narrow.split()) - set(wide.split()) if re.search("[a-z]", word)}
    if words[0] in ("frames", "graph"):  # a list takes the place of the tree
        broken = {word for word in broken if word.split(".")[0] not in wide and word != "in"}
    assert not broken, narrow
    drawing = set("│├└╭╮╰╯━●") & set(narrow)
    assert not drawing, narrow


@each_once(
    columns=[1, 3, 12],
    words=[*COMMANDS, ("bag", "plot", "odometry.odometry.x", "goal.mcap")],
)
def test_a_terminal_of_a_few_columns_is_no_defect(tmp_path, monkeypatch, words, columns):
    monkeypatch.chdir(tmp_path)
    if words[0] == "bag":
        record = ("run", "goal", "--fast", "--for", "1s", "--record", "goal.mcap")
        assert "final stop confirmed" in shown(tmp_path, COLUMNS, record)
    assert "E-DEFECT" not in shown(tmp_path, columns, words)


LONG_NAME = "a_robot_with_a_long_name_that_its_owner_gave_it_to_describe_it"
AT_80 = [  # with the robot of the long name
    ("frames", LONG_NAME),
    ("graph", "goal", "--robot", LONG_NAME),
    ("blocks", "show", "scan_stop"),
    ("completion", "bash", "--help"),
]


@pytest.mark.parametrize("words", AT_80, ids=lambda words: " ".join(words[:2]))
def test_at_80_columns_no_word_is_broken_or_cut(tmp_path, monkeypatch, words):
    (tmp_path / "robots").mkdir()
    shipped = folder("robots") / "book_2wd.yaml"
    (tmp_path / "robots" / f"{LONG_NAME}.yaml").write_text(shipped.read_text())
    monkeypatch.chdir(tmp_path)
    at_80, wide = (shown(tmp_path, columns, words) for columns in (80, 300))
    assert at_80.split() == wide.split(), at_80


GROUPS = ("bag", "bluetooth", "calibrate", "export", "log", "new", "param", "topic")


@pytest.mark.parametrize("group", GROUPS)
def test_the_help_of_a_group_has_whole_sentences(group):
    program = import_module(f"diffbotctl.cli.{main.commands()[group].module}")
    command = getattr(program, group)
    text = CliRunner().invoke(command, ["--help"]).output
    _, _, listed = " ".join(text.split()).partition("Commands: ")
    for name in command.commands:
        sentence = " ".join((command.commands[name].help or "").split("\n\n")[0].split())
        assert f"{name} {sentence.partition('. ')[0].rstrip('.')}" in listed
