"""Invalid input, floods and foreign users: they are refused, and other clients are unaffected."""

import json
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from threading import Thread

import pytest

from diffbotctl.control_socket.address import group_folder
from diffbotctl.control_socket.protocol import LINE_MAX_BYTES
from diffbotctl.control_socket.server import CLIENTS_MAX, STOP_CLIENTS_MAX
from tests.support.command_process import children_of
from tests.support.running import REPLY_TIMEOUT_S, PlainClient, cli, running
from tests.support.trials import hostile_sockets

NOBODY = 65534  # a user that every Debian has, with no rights at all
ROOT_ONLY = pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    runtime_folder = tmp_path_factory.mktemp("hostile")
    with running(runtime_folder, "goal", "--stay", "--goal", "0 0"):
        yield runtime_folder


@pytest.fixture(autouse=True)
def others_are_unaffected(folder):
    """Beside each test a quiet client is served, and nothing reaches the motors.

    It reads in a thread: a client that reads nothing for some 20 s loses lines, and on a busy
    computer a test takes longer.
    """
    client = PlainClient(folder)
    client.request("subscribe", topic="gate.wheels")
    lines = []
    reader = Thread(target=read_to_the_last, args=(client, lines))
    reader.start()
    yield
    client.send('{"id": "last", "method": "status"}')
    reader.join()
    reply = lines.pop()
    assert reply.get("id") == "last", f"no reply; it read {reply}"
    assert reply["held"] is None
    for line in lines:
        assert (line["message"]["left"], line["message"]["right"]) == (0.0, 0.0)
    client.close()


def read_to_the_last(client, lines):
    """Append what `client` reads to `lines`, up to the reply to "last" or the end."""
    for line in iter(client.read, None):
        lines.append(line)
        if line.get("id") == "last":
            break


def refusal_to(folder, data):
    client = PlainClient(folder)
    client.send(data)
    reply = client.read()
    client.close()
    return reply


@pytest.mark.parametrize(
    "data, words",
    [
        (b"\x00\x01\xff\xfe\n", "not JSON"),
        (b'{"method": "stop"\n', "not JSON"),
        (b"[]\n", "not a JSON object"),
        (b"{}\n", "'method' must be the name"),
        (b'{"method": 5}\n', "'method' must be the name"),
        (b'{"method": "stpo"}\n', "no method 'stpo'"),
        (b'{"method": "stop", "reason": "\\u001b[2J"}\n', "'reason' must be a printable text"),
        (b'{"method": "drive", "linear": NaN}\n', "NaN is not a finite number"),
        (b'{"method": "drive", "linear": 1e308}\n', "beyond this robot's limit"),
        (b'{"method": "drive", "linear": 1e309}\n', "must be a finite number"),
        (b'{"method": "drive", "angular": -1e308}\n', "beyond this robot's limit"),
        (b'{"method": "drive", "linear": "0.1"}\n', 'a finite number (m/s); it is "0.1"'),
        (b'{"method": "drive", "linear": true}\n', "must be a finite number"),
        (b'{"method": "drive", "linear": [0.1]}\n', "must be a finite number"),
        (b'{"method": "drive", "speed": 0.1}\n', "no field 'speed'"),
        (b'{"method": "goto", "x": 1}\n', "'y' must be a finite number (m); it is missing"),
        (b'{"method": "goto", "x": 1e308, "y": 0}\n', "must be -1000 to 1000 m"),
        (b'{"method": "goto", "x": 1' + b"0" * 400 + b', "y": 0}\n', "must be a finite number"),
        (
            b'{"method": "publish", "topic": "operator.twist", "message": [1]}\n',
            "must be an object",
        ),
        (
            b'{"method": "publish", "topic": "operator.twist", "message": {"linear": 1e308}}\n',
            "limit",
        ),
        (
            b'{"method": "set_parameter", "parameter": "guard.margin", "value": 1e999}\n',
            "must be a number below",
        ),
        (
            b'{"method": "call_action", "action": "odometry.set_pose", "arguments": {"x": NaN}}\n',
            "NaN",
        ),
        (b'{"method": "subscribe", "topic": "nothing.here"}\n', "no topic"),
    ],
)
def test_invalid_requests_are_refused_with_a_cause(folder, data, words):
    reply = refusal_to(folder, data)
    assert reply["ok"] is False and words in reply["cause"], reply
    assert reply["error"] in ("E-PROTOCOL", "E-REQUEST")


@pytest.mark.parametrize(
    "hello, words",
    [
        ('{"hello": 3}', "protocol 3 is not supported"),
        ('{"hello": 1.0}', "must be a hello"),
        ('{"method": "stop"}', "must be a hello"),
        ("GET / HTTP/1.1", "not JSON"),
        (b"\x16\x03\x01\x02\x00\n", "not JSON"),
    ],
)
def test_a_client_with_a_wrong_hello_is_disconnected(folder, hello, words):
    client = PlainClient(folder, hello=None)
    client.send(hello)
    assert words in client.read()["cause"]
    assert client.read() is None
    client.close()


def test_half_a_line_waits_and_is_forgotten_with_its_client(folder):
    client = PlainClient(folder)
    client.send(b'{"method": "goto", "x": 1, ')
    client.close()
    client = PlainClient(folder)
    client.send(b'{"id": 1, "method": ')
    client.send(b'"topics"}\n')
    assert client.read()["id"] == 1
    client.close()


def test_a_line_of_100_megabytes_is_cut_off(folder):
    client = PlainClient(folder)
    sent, piece = 0, b"x" * (1 << 20)
    try:
        while sent < 100 << 20:
            sent += client.socket.send(piece)
    except (BrokenPipeError, ConnectionResetError):
        pass
    assert sent < 4 << 20  # the kernel's buffers and a line; the rest never left us
    assert f"more than {LINE_MAX_BYTES} bytes" in client.read()["cause"]
    client.close()


def test_a_thousand_requests_at_once_are_all_answered_in_turn(folder):
    client = PlainClient(folder)
    client.send(
        b"".join(
            b'{"id": %d, "method": "topic_rate", "topic": "gate.wheels"}\n' % i for i in range(1000)
        )
    )
    assert [client.read()["id"] for _ in range(1000)] == list(range(1000))
    client.close()


def test_a_client_that_never_reads_loses_the_oldest_lines_and_gets_their_number(folder):
    reader = PlainClient(folder)
    reader.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    for _ in range(3):
        reader.send('{"method": "subscribe", "topic": "*"}')
    quick = PlainClient(folder)
    began = quick.request("status")["time"]
    quick.until(lambda status: status["time"] > began + 4_000_000_000)
    lost = 0
    while not lost:
        lost = reader.read().get("lost", 0)
    assert lost > 100
    reader.close()
    quick.close()


def test_more_connections_than_there_is_room_for(folder):
    strangers = []
    for _ in range(300):
        strangers.append(socket.socket(socket.AF_UNIX))
        strangers[-1].connect(str(folder / "diffbotctl" / "test.socket"))
    client = PlainClient(folder)
    assert client.request("status")["ok"]  # who has greeted goes before who has not
    for stranger in strangers:
        stranger.close()
    client.close()


def test_connecting_again_and_again_leaves_nothing_behind(folder):
    client = PlainClient(folder)
    pid = client.request("status")["pid"]
    hub = hub_of(pid)
    before = len(os.listdir(f"/proc/{hub}/fd"))
    for _ in range(2000):
        stranger = socket.socket(socket.AF_UNIX)
        stranger.connect(str(folder / "diffbotctl" / "test.socket"))
        stranger.close()
    while len(os.listdir(f"/proc/{hub}/fd")) > before + 2:
        assert client.request("status")["ok"]
    client.close()


def hub_of(pid):
    listeners = [
        child
        for child in children_of(pid)
        if any("socket:" in os.readlink(f) for f in Path(f"/proc/{child}/fd").iterdir())
    ]
    return max(listeners)


def test_a_client_that_half_closes_still_gets_its_answers_and_its_stream(folder):
    client = PlainClient(folder)
    client.send('{"id": 1, "method": "subscribe", "topic": "robot.encoders"}')
    client.socket.shutdown(socket.SHUT_WR)
    assert client.read()["id"] == 1
    assert client.read()["topic"] == client.read()["topic"] == "robot.encoders"
    client.close()


AS_NOBODY = """
import os, socket, sys
os.setgroups([int(each) for each in sys.argv[2:]])
os.setgid(65534); os.setuid(65534)
made = socket.socket(socket.AF_UNIX)
made.settimeout(60)
try:
    made.connect(sys.argv[1])
    print(made.makefile().readline())
except PermissionError as error:
    print("refused:", error.strerror)
"""


def as_nobody(path, *groups):
    """What user `nobody`, in these groups besides its own, gets from the socket."""
    words = [sys.executable, "-c", AS_NOBODY, str(path), *map(str, groups)]
    return subprocess.run(words, capture_output=True, text=True, timeout=REPLY_TIMEOUT_S).stdout


@ROOT_ONLY
def test_another_user_is_refused_by_the_folder_by_the_file_and_by_the_server(folder):
    inside = folder / "diffbotctl"
    path = inside / "test.socket"
    ways_in = [inside, *list(inside.parents)[:-2]]  # below /tmp
    modes = {each: stat.S_IMODE(each.stat().st_mode) for each in ways_in}
    assert as_nobody(path) == "refused: Permission denied\n"
    for each in ways_in:
        each.chmod(0o755)
    try:
        assert as_nobody(path) == "refused: Permission denied\n"  # by the file's own mode
        path.chmod(0o666)
        reply = json.loads(as_nobody(path))  # and by the server, which knows the uid
        assert reply["error"] == "E-SOCKET" and "only the user" in reply["cause"]
    finally:
        path.chmod(0o600)
        for each, mode in modes.items():
            each.chmod(mode)
    assert '"event": "refused"' in (inside / "test.log").read_text()


@ROOT_ONLY
def test_members_of_the_group_may_and_others_may_not(tmp_path, monkeypatch):
    group = "games"  # one that every Debian has
    words = ["goal", "--stay", "--goal", "0 0", "--group", group]
    with TemporaryDirectory() as run:  # all folders above tmp_path are closed to others
        os.chmod(run, 0o755)
        monkeypatch.setenv("DIFFBOTCTL_RUN", run)
        check_group(tmp_path, group, words)


def check_group(tmp_path, group, words):
    with running(tmp_path, *words):
        folder = group_folder(group)
        path = folder / "test.socket"
        assert stat.S_IMODE(folder.stat().st_mode) == 0o750
        assert stat.S_IMODE(path.stat().st_mode) == 0o660
        assert as_nobody(path) == "refused: Permission denied\n"
        assert json.loads(as_nobody(path, path.stat().st_gid))["hello"] == 2
        assert cli(tmp_path, "stop")[0] == 0


@ROOT_ONLY
def test_a_group_that_does_not_exist_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("DIFFBOTCTL_RUN", "/run")
    code, _, complaint = cli(tmp_path, "run", "goal", "--group", "no-such-group")
    assert code == 1 and "there is no group 'no-such-group'" in " ".join(complaint.split())


def test_a_folder_that_belongs_to_another_user_is_not_used(tmp_path):
    (tmp_path / "diffbotctl").symlink_to("/tmp")
    code, _, complaint = cli(tmp_path, "run", "goal", "--for", "1s")
    assert code == 1 and "E-SOCKET" in complaint


def test_a_name_with_a_slash_is_refused(tmp_path):
    code, _, complaint = cli(tmp_path, "run", "goal", "--name", "../x")
    assert code == 1 and "not a valid name" in complaint


def test_a_connection_is_reserved_for_stop_when_all_others_are_taken(folder):
    crowd = [PlainClient(folder) for _ in range(CLIENTS_MAX)]
    assert crowd[-1].request("status")["ok"]
    for _ in range(2 * STOP_CLIENTS_MAX):  # also when those connections are taken and kept
        late = PlainClient(folder)
        refusal = late.request("goto", x=1.0, y=0.0)
        assert refusal["error"] == "E-BUSY" and "stop" in refusal["cause"]
        assert late.request("stop", reason="a person in the way")["ok"]
        late.until(lambda status: status["gate.stop"] is not None and status["gate.stop"]["code"])
    assert crowd[0].request("resume")["ok"]
    crowd[0].until(lambda status: status["held"] is None)
    for client in crowd:
        client.close()


def test_strangers_take_no_connection_from_clients_that_greet(folder):
    strangers = [socket.socket(socket.AF_UNIX) for _ in range(2 * CLIENTS_MAX)]
    for stranger in strangers:
        stranger.connect(str(folder / "diffbotctl" / "test.socket"))
    client = PlainClient(folder)
    assert client.request("list_topics")["ok"], "an ordinary connection"
    for stranger in strangers:
        stranger.close()
    client.close()


def test_texts_with_control_characters_are_refused(folder):
    client = PlainClient(folder)
    refusal = client.request("stop", reason="\x1b[2J\x07x")
    assert not refusal["ok"] and "printable" in refusal["cause"]
    assert client.request("status")["gate.stop"] is None or not held_code(client)
    client.close()


def held_code(client):
    return client.request("status")["gate.stop"]["code"]


def test_a_runtime_folder_whose_name_is_too_long_is_named(tmp_path):
    long = tmp_path / ("x" * 100)
    long.mkdir()
    code, _, complaint = cli(long, "run", "hello", "--for", "1s")
    assert code == 1
    assert "E-SOCKET" in complaint and "XDG_RUNTIME_DIR" in complaint and "107" in complaint
    assert cli(long, "run", "hello", "--for", "0.1s", "--no-socket")[0] == 0


def test_a_flood_of_clients_does_not_keep_a_stop_waiting(tmp_path):
    attack = hostile_sockets.flood(tmp_path, repeats=2)
    assert attack.survived and attack.failures == [] and len(attack.stops) == 2
    assert attack.peak_bytes <= 100 << 20


def test_any_lines_in_any_order_leave_the_run_alive(tmp_path):
    attack = hostile_sockets.attack(tmp_path, Random(5), connections=15, lines=20)
    assert attack.survived and attack.failures == [] and attack.requests > 100
    assert attack.peak_bytes <= 100 << 20


def test_a_client_that_asks_and_never_reads_is_disconnected(folder):
    client = socket.socket(socket.AF_UNIX)
    client.settimeout(REPLY_TIMEOUT_S)
    client.connect(str(folder / "diffbotctl" / "test.socket"))
    client.sendall(b'{"hello": 2, "name": "reader"}\n')
    with pytest.raises(OSError) as ended:
        client.sendall(b'{"id": 1, "method": "status"}\n' * 100_000)
    assert not isinstance(ended.value, TimeoutError)
    client.close()
    log = (folder / "diffbotctl" / "test.log").read_text()
    assert "reads no replies" in log and "reader" in log
