"""`diffbotctl bag info | export | diff` on recorded runs."""

import csv
import io
import json
import re

import pytest
from click.testing import CliRunner

from diffbotctl.cli.main import program
from diffbotctl.cli.output import CSV_MARK
from diffbotctl.errors import RunError, UsageError
from diffbotctl.recording.comparison import recording_differences
from diffbotctl.recording.fields import all_columns, choose_columns, column_wires, table_rows
from diffbotctl.recording.reader import RecordingReader, recording_info
from tests.command_result import invoke


def bag_output(*words):
    return invoke(program, "bag", *words)


def test_info_counts_the_messages(goal):
    info = recording_info(goal)
    messages = list(RecordingReader(goal).messages())
    assert info.complete and info.cut is None
    topics = {topic.name: topic for topic in info.topics}
    for name in ("robot.encoders", "odometry.odometry", "gate.wheels"):
        times = [item.time for item in messages if item.wire == name]
        assert topics[name].messages == len(times) > 100
        assert topics[name].rate == pytest.approx((len(times) - 1) / (times[-1] - times[0]) * 1e9)
    assert info.end["cause"] == "all goals reached"


def test_info_in_words(goal):
    code, text = bag_output("info", goal)
    assert not code
    for words in ("goal.yaml", "book_2wd", "sim (seed 3)", "all goals reached", "complete"):
        assert words in text
    assert any(line.split()[:2] == ["robot.encoders", "Encoders"] for line in text.splitlines())
    assert "38.00 Hz" in text


def test_export_reads_back_as_the_messages(goal):
    code, text = bag_output("export", goal, "odometry.odometry.x", "range.range.state")
    table = list(csv.DictReader(io.StringIO(text)))
    odometry = [i for i in RecordingReader(goal).messages() if i.wire == "odometry.odometry"]
    rows_with_x = [row for row in table if row["odometry.odometry.x"]]
    assert code == 0 and len(rows_with_x) == len(odometry)
    for row, item in zip(rows_with_x, odometry, strict=True):
        assert float(row["odometry.odometry.x"]) == item.message.x
        whole, part = row["time"].split(".")
        assert int(whole) * 1_000_000_000 + int(part) == item.time
    assert {row["range.range.state"] for row in table} <= {"", "clear", "measured"}


def test_export_of_everything_has_a_column_a_field(goal, tmp_path):
    bag_output("export", goal, "--output", tmp_path / "all.csv")
    with (tmp_path / "all.csv").open() as file:
        head = next(csv.reader(file))
    assert {"time", "odometry.odometry.covariance.5", "gate.wheels.left"} <= set(head)
    assert head[-1] == CSV_MARK
    assert len(head) == len(set(head)) == 2 + len(all_columns(column_wires(goal)))


def test_a_topic_means_all_its_fields(goal):
    names = [column.name for column in choose_columns(["follower.twist"], column_wires(goal))]
    assert names == ["follower.twist.linear", "follower.twist.angular"]


def test_lines_of_the_log_have_fields_too(goal):
    lines = [
        row
        for _, row in table_rows(
            goal, choose_columns(["log.level", "log.text"], column_wires(goal))
        )
    ]
    assert lines and {level for level, _ in lines} <= {"info", "warning"}
    assert any("goal 1" in text for _, text in lines)


def test_rows_join_what_belongs_to_one_instant(goal):
    expected = choose_columns(["robot.encoders.left", "gate.wheels.left"], column_wires(goal))
    both = [row for _, row in table_rows(goal, expected)]
    assert both and all(None not in row for row in both)  # a frame in, a command out


@pytest.mark.parametrize(
    "name, words",
    [
        ("odometry.odometry.xx", "did you mean odometry.odometry.x"),
        ("odometri.odometry.x", "did you mean odometry.odometry.x"),
        ("odometry.odometry.x.0", "does not exist in"),
        (
            "odometry.odometry.covariance.6",
            "does not exist in",
        ),  # the triangle has 6 entries, 0 to 5
        ("zzz", "has no field 'zzz'"),
        ("", "has no field ''"),
    ],
)
def test_a_wrong_field_is_answered_with_the_nearest(goal, name, words):
    with pytest.raises(UsageError, match=words):
        choose_columns([name], column_wires(goal))


def test_a_topic_without_messages_has_columns_without_values(goal):
    code, text = bag_output("export", goal, "robot.battery", "odometry.odometry.x")
    rows = list(csv.reader(text.splitlines()))
    assert code == 0 and rows.pop(0) == ["robot.battery has no messages in this recording"]
    assert rows.pop(0)[1:] == ["robot.battery.volts", "robot.battery.low", "odometry.odometry.x"]
    assert rows and all(row[1:3] == ["", ""] and row[3] for row in rows)


def test_a_recording_equals_itself(goal):
    assert all(topic.place is None for topic in recording_differences(goal, goal))
    code, text = bag_output("diff", goal, goal)
    assert code == 0 and text.startswith("same")


def test_two_robots_differ_first_where_their_encoders_do(goal, other):
    topics = recording_differences(goal, other)
    assert topics[0].place is not None
    times = [topic.time for topic in topics if topic.place is not None]
    assert times == sorted(times)
    both = [
        [(i.time, i.data) for i in RecordingReader(path).messages() if i.wire == "robot.encoders"]
        for path in (goal, other)
    ]
    place = next(n for n, (a, b) in enumerate(zip(*both, strict=False)) if a != b)
    (encoders,) = [topic for topic in topics if topic.name == "robot.encoders"]
    assert encoders.place == place and encoders.one == (both[0][place][0], encoders.one[1])
    code, text = bag_output("diff", goal, other)
    assert code == 1 and "cross track rms" in text
    (shown,) = re.findall(r"^robot.encoders: .*\n  A  \S+ s ({.*})\n  B  \S+ s ({.*})$", text, re.M)
    first, second = map(json.loads, shown)
    assert first and first.keys() == second.keys()
    assert all(first[name] != second[name] for name in first)


@pytest.mark.parametrize("verb", ["info", "export", "diff"])
@pytest.mark.parametrize("content", [None, b"", b"words"])
def test_a_file_that_is_not_a_recording(tmp_path, verb, content):
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    words = [verb, str(path)] + ([str(path)] if verb == "diff" else [])
    result = CliRunner().invoke(program, ["bag", *words], standalone_mode=False)
    assert isinstance(result.exception, RunError)
    assert "E-RECORDING" in str(result.exception)
