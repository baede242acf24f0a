"""`diffbotctl engines`: those of this computer, and through a real ssh those of another one."""

import json
import re

import pytest

from diffbotctl.cli.engines import HEADER, engine_state
from tests.support.far_host import far_host
from tests.support.running import PlainClient, cli, moves, running


@pytest.fixture
def there(tmp_path, monkeypatch):
    """The folder of the other computer's engines."""
    folder = tmp_path / "there"
    folder.mkdir()
    (tmp_path / "here").mkdir()
    with far_host(tmp_path / "ssh", folder) as (_, path):
        monkeypatch.setenv("PATH", path)
        yield folder


def listed(tmp_path, *words):
    code, out, err = cli(tmp_path / "here", "engines", "--json", *words)
    return code, [json.loads(line) for line in out.splitlines()], err


def test_engines_here_and_there_are_listed_with_their_states(tmp_path, there):
    with (
        running(tmp_path / "here", "standby", "--stay", name="desk"),
        running(there, "goal", "--stay", "--goal", "30 0", name="left"),
        running(there, "goal", "--stay", "--goal", "30 0", name="right"),
    ):
        left, right = (PlainClient(there, name) for name in ("left", "right"))
        left.until(moves)
        right.until(moves)
        right.request("stop", reason="a test")
        right.until(lambda status: status["held"])
        code, rows, err = listed(tmp_path, "--at", "robot", "--at", "robot")
        assert code == 0, err
        assert [(row["at"], row["engine"], row["pipeline"]) for row in rows] == [
            ("", "desk", "standby"),
            ("robot", "left", "goal"),
            ("robot", "right", "goal"),
        ]
        assert all((row["robot"], row["port"]) == ("book_2wd", "sim") for row in rows)
        # On a busy machine each of them may have been stopped for another reason.
        desk, left_state, right_state = (row["state"] for row in rows)
        assert desk != "moving" and left_state != "standing"
        assert right_state.startswith("stopped by ")
        code, out, _ = cli(tmp_path / "here", "engines")
        header, *rest = out.splitlines()
        assert code == 0 and header.split() == list(HEADER) and len(rest) == 1
        assert re.fullmatch(r"here +desk +standby +book_2wd +sim +st\w+\b.*", rest[0])
        code, out, _ = cli(there, "stop", "--engine", "left")  # one of two
        assert code == 0 and "`diffbotctl resume --engine left`" in out


def test_a_computer_that_does_not_answer_is_named_and_the_others_are_listed(tmp_path, there):
    with running(there, "standby", "--stay", name="left"):
        words = ("--at", "robot", "--at", "ann@nowhere.invalid", "--at", "-oProxyCommand=x")
        code, rows, err = listed(tmp_path, *words)
        assert code == 1 and [row["engine"] for row in rows] == ["left"]
        assert "ann@nowhere.invalid  E-SSH" in err and "is no host" in err
        assert "Traceback" not in err


def test_no_engine_is_no_error(tmp_path, there):
    code, out, err = cli(tmp_path / "here", "engines", "--at", "robot")
    assert (code, out) == (0, "") and "diffbotctl run goal" in err


@pytest.mark.parametrize(
    ("wheels", "held", "text"),
    [
        (None, None, "standing"),
        ((0.0, 0.0), None, "standing"),
        ((0.0, -1.0), None, "moving"),
        ((1.0, 1.0), ("obstacle", "10 cm ahead"), "stopped by obstacle: 10 cm ahead"),
    ],
)
def test_the_state_in_words(wheels, held, text):
    status = {
        "gate.wheels": wheels and dict(zip(("left", "right"), wheels, strict=True)),
        "held": held and dict(zip(("code", "cause"), held, strict=True)),
    }
    assert engine_state(status) == text
