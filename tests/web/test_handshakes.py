"""Strangers who begin TLS and do not go on cost little memory, and keep no one else out."""

import socket
import ssl
from contextlib import ExitStack

import pytest

from diffbotctl.client.connections import CONNECTIONS_MAX
from tests.support.page_server import serving
from tests.support.running import running

GROWTH_MAX_BYTES = 30 << 20
COUNT = 500  # which took 90 MB


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("handshakes")
    with running(folder, "standby", "--stay"), serving(folder, "--lan") as server:
        server.link = server.next_link()
        yield server


def memory(server):
    with open(f"/proc/{server.process.pid}/statm") as file:
        return int(file.read().split()[1]) * 4096


def client_hello():
    """The first message of a client's handshake."""
    sent = ssl.MemoryBIO()
    client = ssl._create_unverified_context().wrap_bio(ssl.MemoryBIO(), sent)
    with pytest.raises(ssl.SSLWantReadError):
        client.do_handshake()
    return sent.read()


@pytest.mark.parametrize("data, is_kept_open", [(b"abc", False), (client_hello(), True)])
def test_handshakes_that_do_not_end_take_no_memory(data, is_kept_open, server):
    server.request("GET", "/", Origin="")
    before = memory(server)
    with ExitStack() as stack:
        waiting = []
        for _ in range(COUNT):
            stranger = socket.create_connection(("127.0.0.1", server.port))
            stranger.sendall(data)
            waiting.append(stack.enter_context(stranger))
            if not is_kept_open or len(waiting) > 200:
                waiting.pop(0).close()
        assert server.request("GET", "/", Origin="", source="127.0.0.2")[0] == 200
    assert memory(server) - before <= GROWTH_MAX_BYTES


def test_connections_that_have_ended_their_handshake_are_bounded_too(server):
    server.request("GET", "/", Origin="")
    before = memory(server)
    context = ssl._create_unverified_context()
    with ExitStack() as stack:
        for _ in range(3 * CONNECTIONS_MAX):
            plain = socket.create_connection(("127.0.0.1", server.port))
            stack.enter_context(context.wrap_socket(plain))
        assert server.request("GET", "/", Origin="", source="127.0.0.2")[0] == 200
        assert memory(server) - before <= GROWTH_MAX_BYTES
