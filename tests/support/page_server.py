"""`diffbotctl web` beside a run: its process, its links, and plain requests to it."""

from __future__ import annotations

import http.client
import re
import signal
import socket
import ssl
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.command_process import start_in_pipe
from tests.support.running import command

LINK = re.compile(r"(https?)://([\d.]+):(\d+)/#(\S+)")
TIMEOUT_S = 60.0  # of a request; a test fails by itself afterwards


def free_port() -> int:
    """A TCP port on which nothing listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


class PageServer:
    """A process that prints links to its page, one code after the other."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.lines: list[str] = []
        self.scheme = ""
        self.port = 0

    def next_link(self) -> str:
        """The next link to the loopback address that it prints."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line)
            match = LINK.search(line)
            if match is not None and match[2] == "127.0.0.1":
                self.scheme, self.port = match[1], int(match[3])
                return match[0]
        raise AssertionError(f"it printed no link: {self.lines}")

    def request(
        self,
        method: str,
        path: str,
        body: str | None = None,
        source: str = "127.0.0.1",
        **headers: str,
    ) -> tuple[int, str, http.client.HTTPMessage]:
        """Status, text and headers of one request; `_` in a header's name stands for `-`.

        Host and Origin are right unless they are given; `Origin=""` leaves it out. `source` is the
        address of the client.
        """
        if self.scheme == "https":
            context = ssl._create_unverified_context()
            connection: http.client.HTTPConnection = http.client.HTTPSConnection(
                "127.0.0.1",
                self.port,
                timeout=TIMEOUT_S,
                source_address=(source, 0),
                context=context,
            )
        else:
            connection = http.client.HTTPConnection(
                "127.0.0.1", self.port, timeout=TIMEOUT_S, source_address=(source, 0)
            )
        sent = {"Origin": f"{self.scheme}://127.0.0.1:{self.port}"}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        if not sent["Origin"]:
            del sent["Origin"]
        connection.request(method, path, body, sent)
        reply = connection.getresponse()
        text = reply.read().decode("utf-8", "replace")
        connection.close()
        return reply.status, text, reply.headers

    def enter(self, link: str) -> dict[str, str]:
        """Use the code of a link; returns the headers of a page of this session."""
        code = link.partition("#")[2]
        status, text, headers = self.request("POST", "/session", code)
        assert status == 200, text
        return {
            "Cookie": headers["Set-Cookie"].partition(";")[0],
            "Sec-WebSocket-Protocol": text,
            "Origin": f"{self.scheme}://127.0.0.1:{self.port}",
        }


@contextmanager
def serving(folder: Path, *words: str, run: tuple[str, ...] = ()) -> Iterator[PageServer]:
    """`diffbotctl web words` for the run whose sockets are in `folder`; or `run`, with `--web`."""
    first = ("run", *run, "--web") if run else ("web",)
    line, environment = command(folder, *first, "--tcp-port", str(free_port()), *words)
    environment |= {"XDG_STATE_HOME": str(folder / "state")}
    process = start_in_pipe(line, env=environment)
    try:
        yield PageServer(process)
    finally:
        process.send_signal(signal.SIGKILL)
        rest = process.communicate()[0]
        assert "Traceback" not in rest, rest
