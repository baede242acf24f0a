"""What the terminal shows of the page, and what it needs."""

import os
import signal
import sys
from pathlib import Path

import pytest

from tests.support.command_process import children_of
from tests.support.page_server import PageServer, free_port, serving
from tests.support.running import cli, running
from tests.support.terminal import Terminal


@pytest.fixture
def environment(tmp_path):
    return os.environ | {"XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path / "s")}


def run_web(*words):
    port = str(free_port())
    return [
        sys.executable,
        "-m",
        "diffbotctl",
        "run",
        "standby",
        "--web",
        "--tcp-port",
        port,
        *words,
    ]


@pytest.mark.parametrize("words, scheme", [((), "http://"), (("--lan",), "https://")])
def test_link_and_qr_code_fit_a_small_terminal(environment, words, scheme):
    """Without --lan no phone can open the link: there is no QR code."""
    seen = "▀" * 20 if words else "Only this machine"
    with Terminal(run_web(*words), environment, lines=32) as terminal:
        text = terminal.until(lambda text: seen in text, "the link")
        code = [line.rstrip() for line in text.splitlines() if "█" in line or "▀" in line]
        assert len({len(line) for line in code}) == bool(words)
        assert len(code) >= 15 or not words
        assert f"{scheme}127.0.0.1:" in text and "works once" in text
        assert ("fingerprint" in text) == bool(words)
        terminal.type("\x03")
        assert terminal.ended() == 130


def test_the_run_goes_on_when_its_page_is_killed(environment):
    with Terminal(run_web(), environment) as terminal:
        terminal.until(lambda text: "works once" in text, "the link")
        parent = terminal.process.pid
        page = next(pid for pid in children_of(parent) if listens(pid))
        os.kill(page, signal.SIGKILL)
        terminal.until(lambda text: "the run goes on" in text, "the news that it has ended")
        terminal.type("\x03")
        assert terminal.ended() == 130


def listens(pid):
    """Whether a process has a listening TCP socket."""
    files = {os.readlink(f"/proc/{pid}/fd/{name}") for name in os.listdir(f"/proc/{pid}/fd")}
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return any(row[3] == "0A" and f"socket:[{row[9]}]" in files for row in rows)


def test_a_port_that_is_taken_is_an_error_with_a_fix(tmp_path):
    with running(tmp_path, "standby", "--stay"), serving(tmp_path) as first:
        first.next_link()
        code, _, complaint = cli(tmp_path, "web", "--tcp-port", str(first.port))
        assert code == 1 and "E-WEB-LISTEN" in complaint and "--tcp-port" in complaint


def test_without_an_engine_there_is_no_page(tmp_path):
    code, _, complaint = cli(tmp_path, "web")
    assert code == 2 and "E-NO-ENGINE" in complaint


@pytest.mark.parametrize(
    "words, cause",
    [
        (("--web", "--dash"), "give one"),
        (("--lan",), "--web"),
        (("--web", "--fast"), "control socket"),
        (("--web", "--no-socket"), "control socket"),
    ],
)
def test_options_that_exclude_each_other(tmp_path, words, cause):
    code, _, complaint = cli(tmp_path, "run", "standby", *words)
    assert code == 2 and cause in complaint


def test_a_page_server_prints_a_new_code_for_the_next_device(tmp_path):
    with running(tmp_path, "standby", "--stay"), serving(tmp_path) as server:
        assert isinstance(server, PageServer)
        first = server.next_link()
        server.enter(first)
        second = server.next_link()
        assert second != first and any("computer 1 has joined" in line for line in server.lines)
