"""Programs of a pipeline: started, read, written, supervised; every failure stops the robot."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from diffbotctl.config import consents
from diffbotctl.config.load import check, load
from diffbotctl.programs import consent
from tests.sampling import by_day
from tests.support.command_process import command_line
from tests.support.running import PlainClient, moves, running, stands
from tests.support.terminal import Terminal
from tests.support.trials import programs
from tests.support.trials.programs import CAUSES

# It writes one line for the log: the tests search the newest 50, some time after its start.
LEAD = """
import json, sys
for number, line in enumerate(sys.stdin):
    if number == 0:
        sys.stderr.write("seen " + line[:9] + "\\n")
    print(json.dumps({"lead": {"linear": 0.1, "angular": 0.0}}), flush=True)
"""
PIPELINE = f"""
format: 1
kind: pipeline
include: goal
goals: []
programs:
  nose: {{run: {sys.executable} lead.py, in: {{range: range.range}}, out: {{lead: Twist}}}}
blocks:
  mux: {{in: {{autonomous: nose.lead}}}}
"""


@pytest.fixture
def pipeline(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "lead.py").write_text(LEAD)
    path = tmp_path / "led.yaml"
    path.write_text(PIPELINE)
    return path


# One of each way to fail by day: it ends, it writes nonsense, it falls silent, it writes too much.
DAY = ("crash", "garbage", "hang", "flood")


@pytest.mark.parametrize("kind", by_day(len(DAY), dict.fromkeys([*DAY, *CAUSES])))
def test_every_failure_stops_the_robot_and_no_restart_ends_that(tmp_path, kind):
    # A busy machine delays a good program; what only falls silent has the same cause then.
    timeout = programs.TIMEOUT_S if CAUSES[kind].startswith("nothing") else 1.0
    outcome = programs.fail(tmp_path, kind, timeout=timeout)
    assert outcome.is_right and outcome.is_equal, outcome


def program_pid(folder):
    client = PlainClient(folder)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        lines = client.request("read_log")["lines"]
        pids = [line["text"] for line in lines if "started as process" in line["text"]]
        if pids:
            return int(pids[-1].split()[-1])
    raise AssertionError("the program was never started")


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def until(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.01)


def test_why_names_a_killed_program_and_resume_lets_the_robot_move(tmp_path, pipeline):
    with running(tmp_path, str(pipeline), "--stay", "--allow-programs"):
        client = PlainClient(tmp_path)
        client.until(moves)
        lines = client.request("read_log")["lines"]  # its standard error is logged
        assert any(line["source"] == "nose" and "seen" in line["text"] for line in lines)
        pid = program_pid(tmp_path)
        os.kill(pid, signal.SIGKILL)
        client.until(lambda status: status["held"] and stands(status))
        text = client.request("explain_stop")["text"]
        assert f"program nose (process {pid}) was ended by SIGKILL" in text
        until(lambda: program_pid(tmp_path) != pid)
        assert client.request("status")["held"]["code"] == "input_stale"
        client.until(lambda status: client.request("topic_rate", topic="nose.lead")["age"] < 0.1)
        assert client.request("resume")["ok"]
        client.until(moves)


def test_how_a_program_ended_is_known_while_the_supervisor_has_no_processor(tmp_path, pipeline):
    with running(tmp_path, str(pipeline), "--stay", "--allow-programs"):
        pid = program_pid(tmp_path)
        client = PlainClient(tmp_path)
        client.until(moves)
        supervisor = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(supervisor, signal.SIGSTOP)
        try:
            os.kill(pid, signal.SIGSEGV)
            held = client.until(lambda status: status["held"])["held"]
        finally:
            os.kill(supervisor, signal.SIGCONT)
        assert "SIGSEGV" in held["cause"] and f"process {pid}" in held["cause"], held


STARTS_OTHERS = """
import signal, subprocess, sys, time
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
command = [sys.executable, "-c", "import time; time.sleep(1000)"]
others = [subprocess.Popen(command, start_new_session=own) for own in (False, True)]
with open("others", "w") as file:
    file.write(" ".join(str(other.pid) for other in others))
time.sleep(1000)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_programs_and_what_they_start_end_with_the_engine(tmp_path, pipeline, number):
    (tmp_path / "lead.py").write_text(STARTS_OTHERS)
    others = tmp_path / "others"
    with running(tmp_path, str(pipeline), "--stay", "--allow-programs") as process:
        until(lambda: others.exists() and len(others.read_text().split()) == 2)
        pids = [program_pid(tmp_path), *others.read_text().split()]
        process.send_signal(number)
        process.wait(timeout=60)
        for pid in pids:
            until(lambda pid=pid: not is_alive(pid))


def test_programs_end_with_the_supervisor_and_the_robot_stops(tmp_path, pipeline):
    with running(tmp_path, str(pipeline), "--stay", "--allow-programs"):
        client = PlainClient(tmp_path)
        client.until(moves)
        pid = program_pid(tmp_path)
        parent = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(parent, signal.SIGKILL)
        held = client.until(lambda status: status["held"] and stands(status))["held"]
        assert held["code"] == "input_stale" and held["latched"]
        until(lambda: not is_alive(pid))
        assert client.request("status")["time"] > 0


def test_a_program_that_cannot_be_started_is_named(tmp_path, pipeline):
    pipeline.write_text(PIPELINE.replace(sys.executable, "./nowhere"))
    with running(tmp_path, str(pipeline), "--stay", "--allow-programs"):
        held = PlainClient(tmp_path).until(lambda status: status["held"])["held"]
        assert "nose" in held["cause"] and "No such file" in held["cause"]


def test_a_person_is_asked_once_and_again_after_a_change(tmp_path, pipeline):
    words = command_line("run", pipeline, "--quiet", "--for", "1s")

    def asked(answer):
        with Terminal(words, dict(os.environ)) as terminal:
            terminal.until(lambda text: "lead.py" in text and "Allow" in text, "the question")
            terminal.type(f"{answer}\r")
            return terminal.ended()

    assert asked("n") == 1
    assert asked("y") == 0
    key = consent.consent_key(load(str(pipeline)))
    assert consents.is_allowed(key)
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
    assert done.returncode == 0  # the consent holds without a terminal too
    (tmp_path / "lead.py").write_text(LEAD + "\n# changed\n")
    assert consent.consent_key(load(str(pipeline))) != key
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
    assert done.returncode == 1 and b"E-PROGRAM-CONSENT" in done.stderr


def test_the_consent_covers_pipeline_command_line_and_executable(tmp_path, pipeline):
    (tmp_path / "tool").write_text("#!/bin/sh\n")
    (tmp_path / "tool").chmod(0o755)
    keys = set()
    for text in (PIPELINE, PIPELINE + "\n", PIPELINE.replace(sys.executable, "./tool")):
        pipeline.write_text(text)
        keys.add(consent.consent_key(load(str(pipeline))))
    (tmp_path / "tool").write_text("#!/bin/sh\necho\n")
    keys.add(consent.consent_key(load(str(pipeline))))
    assert len(keys) == 4
    consents.consent_file().parent.mkdir(parents=True)
    consents.consent_file().write_text('{"not": "a list"}')
    assert not consents.is_allowed(next(iter(keys)))


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("nose: {run: ./nose, out: {lead: Twist}, timeout: 3 s}", "E-INPUT"),
        ("nose: {run: '', out: {lead: Twist}}", "E-PROGRAM"),
        ("nose: {run: 'a \"b', out: {lead: Twist}}", "E-PROGRAM"),
        ("nose: {run: ./nose, out: {lead: Twyst}}", "E-MESSAGE-TYPE"),
        ("nose: {run: ./nose, out: {lead: Resume}}", "E-INPUT"),
        ("nose: {run: ./nose, out: {lead: Twist}, neutral: {led: {}}}", "E-PROGRAM"),
        ("nose: {run: ./nose, out: {lead: Twist}, in: {x: range.rang}}", "E-WIRE-OUTPUT"),
        ("nose: {run: ./nose, out: {lead: Twist}, in: {x: rang.range}}", "E-WIRE-NODE"),
        ("mux: {run: ./nose, out: {lead: Twist}}", "E-NAME"),
        ("gate: {run: ./nose, out: {lead: Twist}}", "E-NAME"),
        ("Nose: {run: ./nose, out: {lead: Twist}}", "E-NAME"),
        ("nose: {out: {lead: Twist}}", "E-KEY-MISSING"),
    ],
)
def test_wrong_declarations_are_errors(pipeline, line, code):
    lines = [line if "nose: {" in old else old for old in PIPELINE.splitlines()]
    pipeline.write_text("\n".join(f"  {each}" if each == line else each for each in lines))
    assert code in [problem.code for problem in check(str(pipeline))]


def test_a_program_feeds_motion_also_through_another_one(pipeline):
    pipeline.write_text(
        PIPELINE.replace(
            "programs:",
            "programs:\n  eye: {run: ./eye, out: {seen: Range}}\n"
            "  ear: {run: ./ear, out: {b: Text}}",
        ).replace("range: range.range", "range: eye.seen")
    )
    feeds = {use.wire: use.feeds_motion for use in load(str(pipeline)).inputs}
    assert feeds == {"eye.seen": True, "ear.b": False, "nose.lead": True}
