"""What is done is kept for each folder, and a damaged file is no reason to fail."""

import pytest

from diffbotctl.errors import RunError
from diffbotctl.start.record import Record, place


def test_what_was_done_is_there_at_the_next_visit(tmp_path):
    path = tmp_path / "new" / "start.json"
    record = Record(path, "/home/me/robot")
    record.notes["port"] = "/dev/ttyACM0"
    record.finish("simulated")
    record.finish("simulated")
    again = Record(path, "/home/me/robot")
    assert again.done == ["simulated"]
    assert again.notes == {"port": "/dev/ttyACM0"}
    assert Record(path, "/home/me/other").done == []


def test_one_robot_does_not_forget_for_another(tmp_path):
    path = tmp_path / "start.json"
    Record(path, "one").finish("board")
    Record(path, "two").finish("wheels")
    Record(path, "one").forget()
    assert (Record(path, "one").done, Record(path, "two").done) == ([], ["wheels"])


@pytest.mark.parametrize(
    "text",
    ["", "{", "[1]", '{"one": 3}', '{"one": {"done": "no", "notes": [1]}}', "\xff"],
)
def test_a_damaged_record_is_an_empty_one(tmp_path, text):
    path = tmp_path / "start.json"
    path.write_text(text, encoding="latin-1")
    record = Record(path, "one")
    assert (record.done, record.notes) == ([], {})
    record.finish("simulated")
    assert Record(path, "one").done == ["simulated"]


def test_where_it_cannot_be_kept_the_place_is_named(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(RunError, match="XDG_STATE_HOME"):
        Record(tmp_path / "file" / "start.json", "one").finish("simulated")


def test_it_lies_where_state_belongs(monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert str(place()) == "/state/diffbotctl/start.json"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/me")
    assert str(place()) == "/home/me/.local/state/diffbotctl/start.json"
