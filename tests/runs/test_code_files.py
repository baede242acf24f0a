"""Runs with a block in a file: the question, the recording, its replay, errors, and clients."""

import hashlib
import os
import re
import subprocess

import pytest

from diffbotctl.config import consents
from diffbotctl.config.code_files import CodeConsentError
from diffbotctl.config.load import load
from diffbotctl.engine.clock import VirtualClock
from diffbotctl.engine.loop import Engine
from diffbotctl.recording.black_box import EngineState
from diffbotctl.recording.black_box_store import InputRing, RunMetadata, start_of
from diffbotctl.recording.snapshot import StateError, take_snapshot
from diffbotctl.runs.build_graph import assemble
from diffbotctl.time import SECOND
from tests.config.test_code_files import NOSE, PIPELINE
from tests.support.command_process import command_line
from tests.support.running import PlainClient, cli, running
from tests.support.terminal import Terminal


@pytest.fixture
def pipeline(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "nose.py").write_text(NOSE)
    path = tmp_path / "nose.yaml"
    path.write_text(PIPELINE)
    return path


def test_a_person_is_asked_once_and_the_recording_is_replayed_with_that_file_alone(
    pipeline, tmp_path
):
    recording, imported = tmp_path / "a.mcap", tmp_path / "imported"
    words = ("run", pipeline, "--fast", "--for", "1s", "--quiet", "--record", recording, "--force")
    code, _, complaints = cli(tmp_path, *words)
    assert code == 2 and "E-CODE-CONSENT" in complaints
    for answer, expected in (("n", 2), ("y", 1)):  # 1: the goal is not reached within 1 s
        assert not imported.exists()
        with Terminal(command_line(*words), dict(os.environ)) as terminal:
            terminal.until(
                lambda text: "nose.py" in re.sub(r"\s*\n", "", text) and "Allow" in text,
                "the question",
            )
            terminal.type(f"{answer}\r")
            assert terminal.ended() == expected
    assert imported.exists()
    assert b"def react" not in recording.read_bytes()  # it holds no code
    code, printed, _ = cli(tmp_path, "replay", recording, "--check")
    assert code == 0 and "bit for bit" in printed
    (tmp_path / "nose.py").rename(tmp_path / "kept.py")
    imported.unlink()
    assert cli(tmp_path, "replay", recording, "--check")[0] == 0  # found by its hash
    assert imported.exists()
    imported.unlink()
    (tmp_path / "state" / "diffbotctl" / "allowed_programs.json").unlink()
    code, _, complaints = cli(tmp_path, "replay", recording)
    assert code == 2 and "E-CODE-CONSENT" in complaints and "kept.py" in complaints
    (tmp_path / "kept.py").write_text(NOSE + "# changed\n")
    code, _, complaints = cli(tmp_path, "replay", recording)
    assert code == 2 and "E-CODE-FILE" in complaints and not imported.exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("self.count += 1", "self.count += 1 // 0", "nose.py:20:23  E-BLOCK-RAISED"),
        ("self.count = 0", "pass", "create `self.count` in `def reset(self):`"),
        ("self.count = 0", "self.count = self.evry", "nose.py:17:22  E-BLOCK-RAISED"),
        ("self.count += 1", "raise SystemExit", "nose.py:20:9  E-BLOCK-RAISED"),
    ],
)
def test_an_error_in_a_block_shows_its_file_and_line(pipeline, tmp_path, old, new, said):
    (tmp_path / "nose.py").write_text(NOSE.replace(old, new))
    words = ("run", pipeline, "--fast", "--quiet", "--allow-programs")
    code, _, complaints = cli(tmp_path, *words, cwd=tmp_path)
    assert code == 1 and said in complaints


LOOP = "print('looping', flush=True)"


@pytest.mark.parametrize(
    "text",
    [
        f"{LOOP}\nwhile True: pass\n",
        NOSE.replace("self.count = 0", f"{LOOP}\n        while True: pass"),
    ],
    ids=["import", "reset"],
)
def test_a_file_that_never_ends_its_import_or_reset_is_interrupted(pipeline, tmp_path, text):
    (tmp_path / "nose.py").write_text(text)
    words = command_line("run", pipeline, "--allow-programs")
    with subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stderr.readline() == b"looping\n"
        process.terminate()
        assert process.wait(60) == 130


def test_no_client_of_the_socket_names_a_file(pipeline, tmp_path):
    evil = tmp_path / "evil.py"
    evil.write_text(NOSE.replace('"imported"', '"evil"'))
    name = f"{evil}:Nose"
    with running(tmp_path, pipeline, "--stay", "--allow-programs"):
        client = PlainClient(tmp_path)
        for method, fields in (
            ("set_parameter", {"parameter": "nose.every", "value": name}),
            ("set_parameter", {"parameter": "nose.block", "value": name}),
            ("set_parameter", {"parameter": name, "value": 1}),
            ("call_action", {"action": f"{name}.react"}),
            ("call_action", {"action": "nose.react", "arguments": {"block": name}}),
            ("publish", {"topic": "input.nose", "message": {"block": name}}),
            ("load", {"block": name}),
            ("replay", {"file": str(evil)}),
        ):
            assert "error" in client.request(method, **fields), (method, fields)
        assert client.request("status") is not None
    assert not (tmp_path / "evil").exists()


def test_what_a_block_prints_is_logged_and_replayed(pipeline, tmp_path):
    printing = NOSE.replace("self.count += 1", "print('was', self.count)\n        self.count += 1")
    (tmp_path / "nose.py").write_text(printing)
    recording = tmp_path / "a.mcap"
    words = ("run", pipeline, "--fast", "--for", "1s", "--record", recording, "--allow-programs")
    code, printed, _ = cli(tmp_path, *words)
    assert code == 1 and "nose: was 3\n" in printed
    consents.remember(f"code {hashlib.sha256(printing.encode()).hexdigest()}")
    code, printed, _ = cli(tmp_path, "replay", recording, "--check")
    assert code == 0 and "bit for bit" in printed


@pytest.mark.parametrize(
    ("old", "new", "begins", "problem"),
    [
        ("", "", "state", ""),
        ("self.count = 0", "self.count, self.seen = 0, {'x': [(1, 2)]}", "state", ""),
        ("self.count = 0", "self.count, self.nose = 0, Memory()", "unknown", "`self.nose` of"),
        ("self.count = 0", "self.count, self.key = 0, lambda: 1", "unknown", "`self.key` of"),
        (
            "self.count = 0",
            "self.count, self.file = 0, print",
            "unknown",
            "`self.file`",
        ),
    ],
)
def test_a_flight_states_what_of_a_block_is_no_plain_data(
    pipeline, tmp_path, old, new, begins, problem
):
    text = NOSE.replace(old, new) if old else NOSE
    (tmp_path / "nose.py").write_text(text.replace("class Nose", "class Memory: pass\nclass Nose"))
    with pytest.raises(CodeConsentError) as refused:
        load(str(pipeline))
    consents.allow_here(refused.value.files[0].consent_key)
    graph = assemble(load(str(pipeline)), real=False).graph
    engine = Engine(graph, [], VirtualClock())
    engine.run(SECOND)
    ring = InputRing(span_min=0)
    ring.add_batch(1, b"")
    try:
        ring.add_state(EngineState(0, take_snapshot(engine)))
    except StateError as error:
        ring.add_state(EngineState(0, b"", str(error)))
        ring.known = False  # as when the oldest inputs were dropped
    kinds = tuple(graph.kinds.values())
    start = start_of(RunMetadata(tmp_path, "nose", {}, {}, kinds), ring)
    assert start.begins == begins and bool(start.state) == (begins == "state")
    assert start.problem.startswith(problem) and bool(start.problem) == bool(problem)
