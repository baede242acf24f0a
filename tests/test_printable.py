"""No control character of a file, a board or a client reaches a terminal."""

import io
import os
import subprocess
import sys

import pytest
from rich.text import Text

from diffbotctl.printable import (
    CONTROL,
    PrintableStream,
    printable,
    printable_stream,
    printable_values,
    write_raw,
)
from diffbotctl.ui.console import PrintableConsole

ESCAPE = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e"


def test_control_characters_become_dots_and_text_stays():
    assert printable(f"a{ESCAPE}b") == "a\u00b7]0;owned\u00b7\u00b7[2J\u00b731m\u00b7b"
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
