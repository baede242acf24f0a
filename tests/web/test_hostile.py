"""Who must not get in, and who must not slow the page down: row by row, against a real server."""

import asyncio
import hashlib
import os
import signal
import socket
import ssl
import time
from contextlib import suppress

import pytest

from diffbotctl.client.connections import CONNECTIONS_MAX, client_name
from diffbotctl.web.page_connection import MESSAGE_MAX_BYTES
from tests.support.browser import Browser
from tests.support.page_server import serving
from tests.support.plain_page import TIMEOUT_S, PlainPage
from tests.support.running import PlainClient, running


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    with running(folder, "standby", "--stay"):
        yield folder


@pytest.fixture(scope="module")
def server(folder):
    """With `link`, the code of which no test has used so far."""
    with serving(folder) as server:
        server.link = server.next_link()
        yield server


def entered(server):
    """The headers of a page of a new session."""
    headers = server.enter(server.link)
    server.link = server.next_link()
    return headers


def code_of(link):
    return link.partition("#")[2]


def opened(server, work):
    """Run `work(page)` on a page with a session."""

    async def run():
        async with PlainPage(server, entered(server)) as page:
            return await work(page)

    return asyncio.run(run())


def test_without_a_session_there_is_no_socket(server):
    for cookie in ("", f"diffbotctl_{server.port}=", f"diffbotctl_{server.port}=guessed"):
        status, text, _ = server.request(
            "GET", "/socket", Upgrade="websocket", Connection="Upgrade", Cookie=cookie
        )
        assert status == 401 and "open the link or scan the code" in text


def test_a_cookie_that_another_port_of_the_machine_got_opens_no_socket(server):
    session = entered(server)
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Cookie": session["Cookie"]}
    assert server.request("GET", "/session", Cookie=session["Cookie"])[0] == 200
    for proof in ({}, {"Sec-WebSocket-Protocol": "guessed"}):
        assert server.request("GET", "/socket", **upgrade, **proof)[0] == 401


@pytest.mark.parametrize(
    "data", [b"\x00" * 1000, b"GET / HTTP/9.9\r\n\r\n", b"POST / HTTP/1.1\r\n" + b"A: b\r\n" * 5000]
)
def test_what_is_no_request_ends_in_no_traceback(server, data):
    with socket.create_connection(("127.0.0.1", server.port), TIMEOUT_S) as stranger:
        stranger.sendall(data)
        with suppress(ConnectionResetError):
            stranger.recv(1 << 16)
    assert server.request("GET", "/", Origin="")[0] == 200


def test_a_code_works_once_and_a_photograph_of_it_does_not(server):
    code = code_of(server.link)
    status, _, headers = server.request("POST", "/session", code)
    cookie = headers["Set-Cookie"]
    assert status == 200 and "HttpOnly" in cookie and "SameSite=Strict" in cookie
    status, text, headers = server.request("POST", "/session", code)
    assert status == 403 and "another device has used it" in text
    assert "Set-Cookie" not in headers
    server.link = server.next_link()
    assert code_of(server.link) != code  # the next device has its own


def test_wrong_codes_of_a_client_are_limited_and_the_owner_gets_in(server):
    for stranger in ("127.0.0.2", "127.0.0.3", "127.0.0.4"):
        statuses = [
            server.request("POST", "/session", f"guess{i}", source=stranger)[0] for i in range(30)
        ]
        assert set(statuses) == {403, 429}
    assert server.request("POST", "/session", "x" * 100_000)[0] == 413
    assert server.request("POST", "/session", "mistyped")[0] == 403
    # Also a stranger's computer behind the same router as the owner's does not keep them out.
    assert server.request("POST", "/session", code_of(server.link), source="127.0.0.2")[0] == 200
    server.link = server.next_link()
    entered(server)


@pytest.mark.parametrize(
    "one, other, is_same",
    [
        ("192.168.0.2", "192.168.0.3", False),
        ("192.168.0.2", "::ffff:192.168.0.2", True),
        ("2001:db8::1", "2001:db8::ffff:2", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2%eth0", True),
    ],
)
def test_a_client_is_an_address_or_a_network_of_ipv6(one, other, is_same):
    assert (client_name(one) == client_name(other)) == is_same


@pytest.mark.parametrize(
    "headers, status",
    [
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": ""}, 403),
        ({"Host": "evil.example"}, 421),
        ({"Host": "evil.example:8642"}, 421),
    ],
)
def test_requests_of_another_site_are_refused_in_words(server, headers, status):
    refused = server.request("POST", "/session", code_of(server.link), **headers)
    assert refused[0] == status and ("page" in refused[1] or "link" in refused[1])
    session = entered(server)  # the code was not used up
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", **session}
    assert server.request("GET", "/socket", **(upgrade | headers))[0] == status


def test_the_page_cannot_be_framed_and_loads_nothing_from_elsewhere(server):
    status, text, headers = server.request("GET", "/", Origin="")
    policy = headers["Content-Security-Policy"]
    assert status == 200 and "frame-ancestors 'none'" in policy and "default-src 'none'" in policy
    assert "http:" not in text and "https:" not in text
    assert server.request("GET", "/../setup.cfg", Origin="")[0] == 404
    assert server.request("GET", "/%2e%2e/%2e%2e/etc/passwd", Origin="")[0] == 404


def test_a_stranger_s_page_in_the_operator_s_browser_gets_nothing(server, tmp_path):
    own = f"http://127.0.0.1:{server.port}"
    with Browser(tmp_path / "profile") as browser:
        page = browser.open_page(server.link)
        page.until("document.getElementById('role').textContent.includes('in control')")
        server.link = server.next_link()
        stranger = browser.open_page()  # of the origin "null", with the operator's cookies
        outcome = stranger.evaluate(
            f"fetch('{own}/session', {{method: 'POST', body: 'x', credentials: 'include'}})"
            ".then(() => 'read', () => 'refused')"
        )
        assert outcome == "refused"
        outcome = stranger.evaluate(
            f"new Promise(done => {{ const s = new WebSocket('{own.replace('http', 'ws')}/socket');"
            "s.onopen = () => done('open'); s.onerror = () => done('refused'); })"
        )
        assert outcome == "refused"


def test_plain_http_in_the_network_is_dropped_and_the_fingerprint_is_shown(folder):
    with serving(folder, "--lan") as server:
        link = server.next_link()
        assert link.startswith("https://")
        shown = ":".join(line.strip() for line in server.lines)
        with socket.create_connection(("127.0.0.1", server.port), TIMEOUT_S) as plain:
            plain.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
            with suppress(ConnectionResetError):
                assert b"<html" not in plain.recv(1 << 16)
        certificate = _certificate(server.port)
        assert certificate in shown
        server.link = link
        status, _, headers = server.request("POST", "/session", code_of(link))
        assert status == 200 and "Secure" in headers["Set-Cookie"]


def _certificate(port):
    """The SHA-256 of the server's certificate, as browsers show it."""
    context = ssl._create_unverified_context()
    plain = socket.create_connection(("127.0.0.1", port))
    with context.wrap_socket(plain) as secure:
        digest = hashlib.sha256(secure.getpeercert(binary_form=True)).hexdigest().upper()
    return ":".join(digest[i : i + 2] for i in range(0, 64, 2))


@pytest.mark.parametrize("text", ["x" * (1 << 20), "[" * 3000, '{"do": "drive", "n": 1e999}', "{}"])
def test_big_and_broken_frames_are_dropped_or_refused(server, text):
    async def work(page):
        await page.until(lambda fields: "role" in fields)
        await page.socket.send_str(text)
        return await page.until(lambda fields: "refused" in fields)

    refusal = opened(server, work)
    assert (refusal is None) == (len(text) > MESSAGE_MAX_BYTES)


COMMANDS = [  # what a page with a session may still not do
    ({"do": "read", "method": "publish"}, "may not"),
    ({"do": "goto", "x": 1, "y": 0}, "not allowed"),
    ({"do": "goto", "x": "1", "y": 0}, "no number"),
    ({"do": "drive", "press": 1, "n": 10**9, "linear": 0.1, "angular": 0}, "too slow"),
    ({"do": "drive", "press": 1, "n": 1, "linear": None, "angular": 0}, "no number"),
    ({"do": "drive", "press": -1, "n": 1, "linear": 0, "angular": 0}, "no whole number"),
    ({"do": "set", "parameter": "guard.margin", "value": -1}, "guard.margin"),
    ({"do": "set", "parameter": {"a": 1}, "value": 1}, "parameter"),
]


@pytest.mark.parametrize("command, words", COMMANDS)
def test_commands_are_checked(server, folder, command, words):
    async def work(page):
        await page.until(lambda fields: "role" in fields)
        await page.send(**command)
        return await page.until(lambda fields: "refused" in fields)

    assert words in opened(server, work)["refused"]
    status = PlainClient(folder).request("status")
    assert status["gate.wheels"]["left"] == 0 == status["gate.wheels"]["right"]


def test_a_page_is_limited_by_the_robot(server):
    async def work(page):
        number = (await page.until(lambda fields: fields.get("n", 0) > 0))["n"]
        await page.send(do="drive", press=1, n=number, linear=50.0, angular=0.0)
        return await page.until(lambda fields: "lost" in fields)

    assert "beyond this robot's limit" in opened(server, work)["lost"]


def test_a_flood_of_commands_is_cut_off(server):
    async def work(page):
        await page.until(lambda fields: "role" in fields)
        try:
            for _ in range(5000):
                await page.send(do="take")
        except ConnectionError:
            pass
        return await page.until(lambda fields: False)

    assert opened(server, work) is None


def open_files(server):
    return len(os.listdir(f"/proc/{server.process.pid}/fd"))


@pytest.mark.nightly
def test_a_thousand_sockets_leave_the_page_as_it_was(server):
    async def work(page):
        await page.until(lambda fields: "facts" in fields)
        silent = []
        for _ in range(1000):
            silent.append(await asyncio.open_connection("127.0.0.1", server.port))
        times = [(await page.until(lambda fields: "facts" in fields))["time"] for _ in range(5)]
        # On a busy computer those that are refused are closed a moment after they are accepted.
        until = time.monotonic() + 60
        while open_files(server) >= 2 * CONNECTIONS_MAX and time.monotonic() < until:
            await page.until(lambda fields: "facts" in fields)
        files = open_files(server)
        for _, writer in silent:
            writer.close()
        return times, files

    times, files = opened(server, work)
    assert times == sorted(times) and times[0] < times[-1]
    assert files < 2 * CONNECTIONS_MAX


@pytest.mark.nightly
def test_a_page_that_reads_nothing_is_disconnected_and_others_go_on(server, folder):
    async def work(page):
        await page.until(lambda fields: "facts" in fields)
        reader = socket.create_connection(("127.0.0.1", server.port))
        reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        headers = {
            "Host": f"127.0.0.1:{server.port}",
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
            **page.headers,
        }
        lines = ["GET /socket HTTP/1.1", *(f"{name}: {text}" for name, text in headers.items())]
        reader.sendall("\r\n".join([*lines, "", ""]).encode())
        await page.until(lambda fields: "role" in fields)  # it has been opened

        def files():
            return len(os.listdir(f"/proc/{server.process.pid}/fd"))

        before = files()
        while files() >= before:  # until it has been disconnected; the pictures still come
            assert await page.until(lambda fields: "facts" in fields) is not None
        reader.close()

    opened(server, work)


def test_a_server_that_is_killed_stops_a_robot_that_is_driven(folder):
    client = PlainClient(folder)

    async def work(page):
        press = 0
        while not client.request("status")["gate.wheels"]["left"]:
            number = (await page.until(lambda fields: "n" in fields))["n"]
            press = press or 1
            await page.send(do="drive", press=press, n=number, linear=0.1, angular=0.0)
            if client.request("status")["held"]:  # a busy computer
                client.request("resume")
                press += 1
        server.process.send_signal(signal.SIGKILL)

    with serving(folder) as server:
        server.link = server.next_link()
        opened(server, work)
    held = client.until(lambda status: status["held"])["held"]
    assert held["code"] == "operator_lost" and "computer 1" in held["cause"]
    client.request("resume")
