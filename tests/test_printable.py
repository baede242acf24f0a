"""No control character of a file, a board or a client reaches a terminal."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.text import Text

from diffbotctl.learn.course import find_lesson
from diffbotctl.printable import (
    CONTROL,
    PrintableStream,
    printable,
    printable_stream,
    printable_values,
    write_raw,
)
from diffbotctl.ui.console import PrintableConsole
from tests.support.running import command
from tests.support.terminal import Terminal

ESCAPE = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e"


def test_control_characters_become_dots_and_text_stays():
    assert printable(f"a{ESCAPE}b") == "a\u00b7]0;owned\u00b7\u00b7[2J\u00b731m\u00b7b"
    assert printable("\ud800 \udcff \ufffe \uffff") == "\u00b7 \u00b7 \u00b7 \u00b7"
    plain = "tab\t line\n \u00e9 \u4e2d \U0001f916 \u2800 \u00b5 non\u00a0breaking"
    assert printable(plain) == plain


def test_values_are_printable_at_every_depth():
    values = {ESCAPE: [ESCAPE, {"x": ESCAPE}, 1, None]}
    assert not CONTROL.search(repr(printable_values(values)))
    assert printable_values({"a": [1, "b"]}) == {"a": [1, "b"]}


def stream():
    return printable_stream(io.TextIOWrapper(io.BytesIO(), encoding="utf-8"))


def written(output):
    output.flush()
    return output.buffer.getvalue().decode()


def test_print_is_filtered_and_our_own_sequences_are_not():
    output = stream()
    print(f"robot {ESCAPE}", file=output)
    write_raw(output, "\x1b[1mours\x1b[0m")
    text = written(output)
    assert text.startswith("robot \u00b7]0;owned") and text.endswith("\x1b[1mours\x1b[0m")


def test_the_filter_is_put_on_once():
    output = stream()
    assert isinstance(output, PrintableStream) and printable_stream(output) is output


def test_a_console_writes_its_own_colours_and_no_sequence_of_a_text():
    output = stream()
    console = PrintableConsole(file=output, force_terminal=True, color_system="standard")
    console.print(Text(f"name {ESCAPE}", style="red"))
    text = written(output)
    assert "\x1b[31m" in text, "the console's own colour"
    assert "\x1b]0" not in text and "\x1b[2J" not in text and "\x9b" not in text


TRIALS = """\
format: 1
kind: trials
pipeline: goal
robots: [book_2wd]
seeds: 3
expect: {reach: 60 s}
cases: {healthy: {}}
"""


@pytest.mark.parametrize(
    ("words", "seen"),
    [
        (("learn", "next"), "A talker and a listener"),
        (("learn", "next", "14"), "diffbotctl why"),
        (("trials", "few.yaml", "--workers", "1"), "3 of 3 runs as expected"),
        (("start", "--help"), "Usage"),
        (("graph", "goal"), "follower"),
        (("wiring", "book_2wd"), "L298N"),
    ],
    ids=lambda words: " ".join(words),
)
def test_our_own_sequences_reach_the_terminal_as_sequences(words, seen, tmp_path, monkeypatch):
    """A screen that draws them shows the text alone, and each row as wide as it was made."""
    (tmp_path / "few.yaml").write_text(TRIALS)
    monkeypatch.chdir(tmp_path)
    line, environment = command(tmp_path, *words)
    with Terminal(line, environment, 80, 120) as terminal:
        terminal.ended()
    assert seen in " ".join(terminal.text.split()), terminal.text
    assert "\u00b7[" not in terminal.text and terminal.text.count("so far, about") <= 1


def test_text_reaches_a_terminal_by_the_printable_ways_alone():
    """Rich's own console, and escape sequences in `write`, would be shown as text."""
    package = Path(__file__).parent.parent / "diffbotctl"
    others = re.compile(r"\bConsole\(|\bsys\.std(?:out|err)\.write\(|\brich\.print\b")
    found = [
        f"{path.relative_to(package)}: {use}"
        for path in package.rglob("*.py")
        for use in others.findall(path.read_text())
    ]
    assert not found, "use PrintableConsole, click.echo or write_raw"


def test_code_is_shown_as_it_is_written(tmp_path, monkeypatch):
    """A row that is longer than the terminal goes on in its next row, with nothing in between."""
    monkeypatch.chdir(tmp_path)
    columns, path = 60, find_lesson("one_metre").source("solution")
    files = sorted(path.glob("*.py"))
    code = [row for file in files for row in file.read_text().splitlines()]
    assert max(map(len, code)) > columns
    line, environment = command(tmp_path, "learn", "solution", "one_metre")
    with Terminal(line, environment, columns, 150) as terminal:
        terminal.ended()
    cells = [row[at : at + columns].rstrip() for row in code for at in range(0, len(row) or 1, 60)]
    shown = [row.rstrip() for row in terminal.screen.display]
    assert "\n".join(cells) in "\n".join(shown), terminal.text


@pytest.mark.parametrize("words", [["check"], ["graph"], ["run", "--fast", "--for", "1s"]])
def test_a_hostile_file_writes_no_sequence_to_a_terminal(words, tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(
        'format: 1\nkind: pipeline\nblocks: {talker: {block: talker, with: {text: "\\e]0;x\\a"}},'
        ' "\\e[2J": {block: talker}}\n'
    )
    master, slave = os.openpty()
    subprocess.run(
        [sys.executable, "-m", "diffbotctl", words[0], str(path), *words[1:]],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        timeout=60,
        check=False,
        env={**os.environ, "TERM": "xterm"},
    )
    os.close(slave)
    text = os.read(master, 1 << 16).decode()
    os.close(master)
    assert "\x1b]0" not in text and "\x1b[2J" not in text
    assert "]0;x" in text or "[2J" in text, "what was filtered is shown as text"
