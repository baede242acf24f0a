"""What is done is kept for each folder, and a damaged file is no reason to fail."""

import pytest

from diffbotctl.cli.start_steps import GuideProgress, state_path
from diffbotctl.errors import RunError


def test_what_was_done_is_there_at_the_next_visit(tmp_path):
    path = tmp_path / "new" / "start.json"
    record = GuideProgress(path, "/home/me/robot")
    record.notes["port"] = "/dev/ttyACM0"
    record.finish("simulated")
    record.finish("simulated")
    again = GuideProgress(path, "/home/me/robot")
    assert again.done == ["simulated"]
    assert again.notes == {"port": "/dev/ttyACM0"}
    assert GuideProgress(path, "/home/me/other").done == []


def test_one_robot_does_not_forget_for_another(tmp_path):
    path = tmp_path / "start.json"
    GuideProgress(path, "one").finish("board")
    GuideProgress(path, "two").finish("wheels")
    GuideProgress(path, "one").reset()
    assert (GuideProgress(path, "one").done, GuideProgress(path, "two").done) == ([], ["wheels"])


@pytest.mark.parametrize(
    "text",
    ["", "{", "[1]", '{"one": 3}', '{"one": {"done": "no", "notes": [1]}}', "\xff"],
)
def test_a_damaged_record_is_an_empty_one(tmp_path, text):
    path = tmp_path / "start.json"
    path.write_text(text, encoding="latin-1")
    record = GuideProgress(path, "one")
    assert (record.done, record.notes) == ([], {})
    record.finish("simulated")
    assert GuideProgress(path, "one").done == ["simulated"]


def test_where_it_cannot_be_kept_the_place_is_named(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(RunError, match="XDG_STATE_HOME"):
        GuideProgress(tmp_path / "file" / "start.json", "one").finish("simulated")


def test_it_lies_where_state_belongs(monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert str(state_path()) == "/state/diffbotctl/start.json"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/me")
    assert str(state_path()) == "/home/me/.local/state/diffbotctl/start.json"
