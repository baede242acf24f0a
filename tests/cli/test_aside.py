"""Words to a terminal that takes none do not keep a run waiting, and are not lost."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from diffbotctl.cli.standard_streams import NonBlockingStderr

LONGEST = 10  # s


@pytest.fixture(params=["terminal", "pipe"])
def ends(request):
    """The reader's end and the writer's."""
    ours, theirs = os.openpty() if request.param == "terminal" else os.pipe()
    yield ours, theirs
    os.close(ours)
    os.close(theirs)


def fill(file):
    """Write until nothing more is taken."""
    os.set_blocking(file, False)
    with suppress(BlockingIOError):
        while True:
            os.write(file, b".")
    os.set_blocking(file, True)


def read_until(file, end):
    data = b""
    while not data.endswith(end):
        data += os.read(file, 4096)
    return data


def test_it_does_not_wait_for_a_reader_and_writes_the_rest_at_the_end(ends, monkeypatch):
    ours, theirs = ends
    ending = b"\r\n" if os.isatty(theirs) else b"\n"
    with open(theirs, "w", closefd=False) as error:
        monkeypatch.setattr(sys, "stderr", error)
        aside = NonBlockingStderr()
        aside.say("first")
        assert b"first" in read_until(ours, b"\n")  # at once
        fill(theirs)
        aside.say("second")  # returns without a reader
        aside.say("third")
        with ThreadPoolExecutor() as reader:
            received = reader.submit(read_until, ours, b"third" + ending)
            aside.end()
            assert b"second" in received.result(LONGEST)


def test_a_file_is_written_in_order(tmp_path, monkeypatch):
    path = tmp_path / "lines"
    with path.open("w") as error:
        monkeypatch.setattr(sys, "stderr", error)
        aside = NonBlockingStderr()
        aside.say("one")
        print("two", file=sys.stderr)
        aside.say("three")
        aside.end()
    assert path.read_text() == "one\ntwo\nthree\n"
