"""The black box in the server process: a failure of one does not affect the other."""

import os
import pickle
import select
import socket
from functools import partial

import pytest

from diffbotctl.config.load import load
from diffbotctl.messages import Encoders
from diffbotctl.processes.child_process import LENGTH
from diffbotctl.recording import black_box as black_box_module
from diffbotctl.recording.black_box import StopEvent
from diffbotctl.recording.black_box_store import AFTER_STOP, BlackBoxStore, RunMetadata
from diffbotctl.recording.reader import recording_info
from diffbotctl.runs.build_graph import assemble
from diffbotctl.runs.control_socket import RunControlSocket
from diffbotctl.runs.options import RunOptions, SocketOptions
from diffbotctl.runs.outputs import RunReports, run_facts, start_black_box
from diffbotctl.time import SECOND
from tests.support.running import REPLY_TIMEOUT_S, PlainClient

ABOUT = {"epoch": "0"}
WIRES = {"robot.encoders": Encoders}
DONE = {"code": "0", "cause": "all goals reached", "last": "0", "truth": ""}


def instant(second):
    return (second * SECOND, Encoders(second * SECOND, second, second, None, None, 0.0, 0.0))


def packed(item):
    data = pickle.dumps(item)
    return LENGTH.pack(len(data)) + data


@pytest.fixture
def keeper(tmp_path):
    """A store, and the engine's end of its channel."""
    ours, theirs = socket.socketpair()
    ours.settimeout(REPLY_TIMEOUT_S)
    yield BlackBoxStore(theirs, RunMetadata(tmp_path, "test", WIRES, ABOUT)), ours
    ours.close()
    theirs.close()


def test_a_disk_that_hangs_delays_nothing(tmp_path, keeper):
    """The writer opens a FIFO without a reader; the store continues to receive."""
    keeper, engine = keeper
    draft = tmp_path / "test-1.part"
    os.mkfifo(draft)
    engine.sendall(packed([instant(1)]) + packed(StopEvent(SECOND, "obstacle", "a wall")))
    assert keeper.read() and keeper.files == 0  # it also records how the robot comes to rest
    engine.sendall(packed([instant(2)]))
    assert keeper.read() and keeper.files == 1  # a writing process has started, and hangs
    engine.sendall(packed([instant(3)]))
    assert keeper.read() and keeper.ring.last == 3 * SECOND
    assert not select.select([engine], [], [], 0)[0]  # no file was announced
    draft.read_bytes()  # now the disk has come back; a FIFO is no place for a whole file, though
    assert "could not be kept" in engine.recv(1 << 10).decode()


@pytest.mark.parametrize(
    "items, cause",
    [
        ([[instant(1)], DONE], None),  # it ended well
        ([[instant(1)], {**DONE, "code": "1", "cause": "gave up"}], "gave up"),
        # It ended well, but something had stopped it less than AFTER_STOP before its end.
        ([[instant(1)], StopEvent(SECOND, "obstacle", "a wall"), DONE], "obstacle: a wall"),
        ([[instant(1)]], "the engine was killed"),
        ([], None),  # killed before anything came: there is nothing to write
    ],
)
def test_what_is_written_when_the_engine_has_ended(tmp_path, keeper, capfd, items, cause):
    keeper, engine = keeper
    engine.sendall(b"".join(map(packed, items)))
    engine.shutdown(socket.SHUT_WR)
    keeper.read_to_end()
    keeper.channel.close()
    report = engine.recv(1 << 10)  # the writer holds the other end until it has ended
    causes = [recording_info(path).end["cause"] for path in tmp_path.glob("*.mcap")]
    assert causes == ([] if cause is None else [cause])
    is_killed = cause == "the engine was killed"
    assert bool(report) == (cause is not None and not is_killed)  # a killed engine receives nothing
    assert ("diffbotctl replay" in capfd.readouterr().err) == is_killed


def test_several_stops_in_a_row_make_one_file(keeper):
    keeper, engine = keeper
    for second in range(1, 9):  # FILE_PERIOD_MIN is 10 s
        engine.sendall(packed(StopEvent(second * SECOND, "obstacle", "a wall")))
        engine.sendall(packed([instant(second)]))
        keeper.read()
    assert AFTER_STOP == SECOND and keeper.files == 1
    engine.recv(1 << 10)


@pytest.fixture
def hub(tmp_path, monkeypatch):
    """A server process with a black box; this test is the engine. Both channels, the texts."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    configuration = load("goal")
    assembly = assemble(configuration, real=False)
    facts = partial(run_facts, configuration, RunOptions(), [])
    reports, folder = [], tmp_path / "flights"
    flight, keeper = start_black_box(
        folder,
        configuration,
        assembly,
        RunReports(facts, lambda: (0, 0), lambda: None, reports.append, reports.append),
    )
    station = RunControlSocket(SocketOptions("test"), configuration, assembly, "sim", store=keeper)
    place = assembly.graph.sources.index("robot.encoders")
    values = [None] * len(assembly.graph.sources)
    values[place] = instant(1)[1]
    flight.record((SECOND, *values))
    yield flight, station, reports
    station.channel.close()
    station.end()


def test_the_server_continues_when_the_black_box_fails(hub, tmp_path):
    flight, _, reports = hub
    client = PlainClient(tmp_path)
    flight.sender.channel.settimeout(REPLY_TIMEOUT_S)
    flight.sender.channel.sendall(LENGTH.pack(7) + b"garbage")
    flight.sender.channel.recv(1)  # its end: the server has given the black box up
    assert client.request("status")["ok"]
    assert "UnpicklingError" in (tmp_path / "diffbotctl" / "test.log").read_text()
    flight.finish(DONE)
    assert reports == [
        "BLACK BOX STOPPED: the recorder has ended; the last minutes of this run are not kept"
    ]


def test_the_black_box_continues_when_the_server_fails(hub, tmp_path):
    flight, station, reports = hub
    client = PlainClient(tmp_path)
    station.channel.channel.send(b"garbage")
    assert client.read() is None  # it has let its clients go
    flight.finish({**DONE, "code": "1", "cause": "gave up"})
    flight.close()
    (path,) = (tmp_path / "flights").glob("*.mcap")
    assert recording_info(path).end["cause"] == "gave up"
    assert reports == [
        "The whole run so far is kept: `diffbotctl why` explains it, or",
        f"    diffbotctl replay {path}",
    ]


def test_a_server_that_reads_nothing_is_given_up_at_the_end(monkeypatch):
    monkeypatch.setattr(black_box_module, "FINISH_TIMEOUT_S", 0.05)
    ours, theirs = socket.socketpair()
    reports = []
    flight = black_box_module.BlackBox(ours, 1, lambda: None, reports.append, reports.append)
    while not flight.sender.backlog:
        flight.sender.send(bytes(1 << 16))
    flight.finish(DONE)
    assert reports == ["the recorder does not answer"]
    theirs.close()
    flight.close()
