from math import nan, pi
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from diffbotctl.calibrate.log_reader import (
    read_counts,
    refuse_unusable,
    with_end,
    with_own_poses,
    with_truth,
)
from diffbotctl.calibrate.measured_ends import read_ends, refuse_too_far
from diffbotctl.cli.main import program
from diffbotctl.errors import UsageError
from tests.calibrate.driven import STATED, squares
from tests.support.optiodom_session import is_session, read_session

COUNTED = "time,right,left\n5.0,100,0\n5.5,110,5\n6.0,120,-10\n"


def written(folder, name, text, encoding="utf-8"):
    path = folder / name
    path.write_text(text, encoding)
    return path


def test_counts_begin_at_nought(tmp_path):
    # 20 counts a turn right, 10 left.
    log = read_counts(written(tmp_path, "a.csv", COUNTED, "utf-8-sig"), (20, 10))
    assert log.name == "a"
    assert log.times.tolist() == [0, 0.5, 1]
    assert log.turns.tolist() == [[0, 0], [0.5, 0.5], [1, -1]]
    assert log.tick == (0.05, 0.1)
    assert log.poses is None


@pytest.mark.parametrize(
    "text",
    [
        '"time","right","left"\n5.0,100,0\n5.5,110,5\n6.0,120,-10\n',
        '"time","right","left"\n"5.0","100","0"\n"5.5","110","5"\n"6.0","120","-10"\n',
        "time;right;left\n5.0;100;0\n5.5;110;5\n6.0;120;-10\n",
        "time;right;left\n5,0;100;0\n5,5;110;5\n6,0;120;-10\n",
        "time\tright\tleft\n5.0\t100\t0\n5,5\t110\t5\n6.0\t120\t-10\n",
        "Left, TIME ,Right\n0,5.0,100\n5,5.5,110\n-10,6.0,120\n",
        "\ufefftime,right,left\r\n5.0,100,0\r\n5.5,110,5\r\n6.0,120,-10\r\n\r\n  \r\n",
        "# robot 7, hall\n\ntime,right,left\n5.0,100,0\n# a bump\n5.5,110,5\n6.0,120,-10\n,,\n",
        "time,right,left\n5.0,100,0,\n5.5,110,5,\n6.0,120,-10,\n",
    ],
)
def test_layouts_of_tables(tmp_path, text):
    log = read_counts(written(tmp_path, "a.csv", text), (20, 10))
    assert log.times.tolist() == [0, 0.5, 1]
    assert log.turns.tolist() == [[0, 0], [0.5, 0.5], [1, -1]]


def test_headings_in_degrees_beside_the_counts(tmp_path):
    text = "time,right,left,x,y,heading_deg\n0,0,0,0,0,0\n1,1,1,0.1,0,90\n2,2,2,0.1,0.1,180\n"
    log = with_own_poses(read_counts(written(tmp_path, "a.csv", text), (20, 20)))
    assert log.poses[:, 2] == pytest.approx([0, pi / 2, pi])


def test_poses_that_are_repeated_until_the_next_one(tmp_path):
    poses = ["0,0,0", "0,0,0", "0.1,0,0", "0.1,0,0", "0.2,0,0.1"]
    rows = "".join(f"{number},{number},{number},{pose}\n" for number, pose in enumerate(poses))
    text = f"time,right,left,x,y,heading\n{rows}"
    log = with_own_poses(read_counts(written(tmp_path, "a.csv", text), (20, 20)))
    assert log.rows.tolist() == [0, 2, 4]


def test_truth_in_another_unit_of_time(tmp_path):
    counts = read_counts(written(tmp_path, "a.csv", COUNTED), (20, 10))
    truth = "time,x,y,heading\n0,0,0,0\n250,1,0,0\n1000,2,0,0\n"
    with pytest.raises(UsageError, match="its poses last 1000 s"):
        with_truth(counts, written(tmp_path, "t.csv", truth))


def test_poses_beside_the_counts_where_known(tmp_path):
    text = "time,right,left,x,y,heading\n0,0,0,0,0,0\n1,1,1,,,\n2,2,2,0.1,0,3.1\n3,3,3,0.1,0,-3.1\n"
    log = with_own_poses(read_counts(written(tmp_path, "a.csv", text), (20, 20)))
    assert log.rows.tolist() == [0, 2, 3]
    assert log.poses[:, 2] == pytest.approx([0, 3.1, 2 * pi - 3.1])  # unwrapped


def test_truth_of_its_own_rate(tmp_path):
    truth = "time,x,y,heading\n-0.1,9,9,9\n0,0,0,0\n0.25,1,0,0\n1.0,2,0,0\n1.1,9,9,9\n"
    counts = read_counts(written(tmp_path, "a.csv", COUNTED), (20, 10))
    log = with_truth(counts, written(tmp_path, "t.csv", truth))
    assert log.times.tolist() == [0, 0.25, 0.5, 1]
    assert log.rows.tolist() == [0, 1, 3]
    assert log.turns[1].tolist() == [0.25, 0.25]  # half way to the next row


def test_ends_by_hand(tmp_path):
    text = "recording, x, y, heading_deg\na.mcap, 0.01, -0.02, 90\nb, 0, 0,\n"
    log = read_ends(written(tmp_path, "ends.csv", text))
    assert log["a"] == pytest.approx((0.01, -0.02, pi / 2))
    assert log["b"] == pytest.approx((0, 0, nan), nan_ok=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,right\n0,0\n1,1\n", "does not name left"),
        ("time,right,left\n0,0,0\n", "at least two rows"),
        ("time,right,left\n0,0,0\n0,1,1\n", "increasing times"),
        ("time,right,left\n0,0,0\n1,,1\n", "row 2 has no time or no count"),
        ("time,right,left\n0,0,0\n1,1,1\n1,1,1\n", "increasing times, but row 3 has 1 after 1"),
        ("time,right,left\n2,0,0\n1,1,1\n", "increasing times, but row 2 has 1 after 2"),
        ("time,right,left\n0,0,0\n1,1,000,1,000\n", "line 3 has more cells"),
        ("time,right,left\n0,0,0\n1,x,1\n", "'x' is not a number"),
        ("", "does not name time, right and left"),
        ("0,0,0\n1,1,1\n", "does not name time, right and left"),
        ("time_ms,right,left\n0,0,0\n1,1,1\n", "does not name time"),
        ("time right left\n0 0 0\n1 1 1\n", "separated by commas, semicolons or tabs"),
        ("time,right,left,right\n0,0,0,0\n1,1,1,1\n", "names right twice"),
        ("time,right,left\n0;0;0\n1;1;1\n", "'0;0;0' is not a number"),
        (
            "time,right,left\n0,0,0\ntime,right,left\n1,1,1\n",
            "line 3, column time: 'time'",
        ),
        ("time,right,left\n12:00:01,0,0\n12:00:02,1,1\n", "times in seconds"),
        ('time,right,left\n0,0,0\n1,"1,024",1\n', "'1,024' is not a number"),
        ("time;right;left\n0;0;0\n1;1.024,5;1\n", "nothing between thousands"),
        ("time,right,left\n0,0,0\n1,1_0,1\n", "'1_0' is not a number"),
        (
            "time,right,left\n0,0,0\n1,1,1\n2,1e308,1\n",
            "one that no counter reaches",
        ),
        ("time,right,left\n0,0,0\n1,1,1\n\0\0\0\0\n", "line 4, column time"),
        ("time,right,left\n0,0,0\n1,1,1\n2,2\n", "row 3 has no time or no count"),
    ],
)
def test_unusable_files_are_refused(tmp_path, text, message):
    with pytest.raises(UsageError, match="E-CALIBRATE-LOG") as raised:
        read_counts(written(tmp_path, "a.csv", text), (20, 20))
    assert message in " ".join(str(raised.value).split())


def test_text_that_is_not_utf_8(tmp_path):
    path = written(tmp_path, "a.csv", COUNTED, "utf-16")
    with pytest.raises(UsageError, match="this is not UTF-8 text"):
        read_counts(path, (20, 20))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "recording,x,y,heading,heading_deg\na,1,2,1,30\n",
            "another one in degrees",
        ),
        ("recording,x,y,heading_deg\na,1,2,40000\n", "a heading of more than 100 turns"),
        ("recording,x,y\na,0.5 m,2\n", "no unit"),
        ("recording,x,y,heading_deg\na,1,2,90\N{DEGREE SIGN}\n", "no unit"),
        ("recording,x,y\na,0,0\nb,0,0\n", "x and y are 0 in every line"),
    ],
)
def test_unusable_ends_are_refused(tmp_path, text, message):
    with pytest.raises(UsageError, match="E-CALIBRATE-LOG") as raised:
        read_ends(written(tmp_path, "ends.csv", text))
    assert message in " ".join(str(raised.value).split())


@pytest.mark.parametrize(
    "text",
    [
        '"Recording";"X";"Y";"Heading_deg";"note"\n"a.csv";0,5;-0,25;"90";"a bump; then on"\n',
        "recording\tx\ty\theading_deg\na\t0.5\t-0.25\t90\n",
    ],
)
def test_layouts_of_ends(tmp_path, text):
    ends = read_ends(written(tmp_path, "ends.csv", text))
    assert ends["a"] == pytest.approx((0.5, -0.25, pi / 2))


def test_no_poses_and_half_an_end(tmp_path):
    counts = read_counts(written(tmp_path, "a.csv", COUNTED), (20, 20))
    with pytest.raises(UsageError, match="--ends or --truth"):
        with_own_poses(counts)
    with pytest.raises(UsageError, match="has no x or y"):
        with_end(counts, (nan, 0, 0))
    with pytest.raises(UsageError, match="cannot be read"):
        read_counts(tmp_path / "none.csv", (20, 20))
    with pytest.raises(UsageError, match="cannot be read"):
        read_counts(tmp_path / "none.mcap", (20, 20))


@pytest.mark.parametrize(
    ("x", "refused"),
    # Two turns of a wheel of 65 mm are 0.408 m.
    [(0.4, False), (0.6, False), (0.62, True), (400.0, True)],
)
def test_an_end_in_millimetres_is_noticed(tmp_path, x, refused):
    text = "time,right,left\n0,0,0\n1,40,40\n"
    counts = read_counts(written(tmp_path, "a.csv", text), (20, 20))
    if not refused:
        refuse_too_far(counts, (x, 0.0, nan), 0.065, Path("ends.csv"))
        return
    with pytest.raises(UsageError, match="metres"):
        refuse_too_far(counts, (x, 0.0, nan), 0.065, Path("ends.csv"))


def session(folder):
    folder.mkdir()
    about = "type,diff\nngear,43.7,,\nencRes,64\nLi,0.2\nDi,0.084,0.085,\nThi,,\nN,1\nL,1.7\n"
    written(folder, "7_metadata.csv", about)
    rows = "0,0,0,0,0,0\n0.05,0.1,0,0.2,27968,-13984\n0.1,0.2,0,0.3,27968,0\n"
    written(folder, "7_run-01.csv", rows, "utf-8-sig")
    return folder


def test_session_of_optiodom(tmp_path):
    # 43.7 x 64 = 2796.8 ticks a turn; 27968 ticks are ten turns. Ticks are of each cycle.
    folder = session(tmp_path / "7")
    assert is_session(folder) and not is_session(tmp_path)
    log = read_session(folder)
    assert (log.name, log.side) == ("7", 1.7)
    assert log.nominal == (0.084, 0.085, 0.2)
    assert log.drives[0].turns == pytest.approx(np.array([[0, 0], [10, -5], [20, -5]]))
    assert log.drives[0].poses[:, 2].tolist() == [0, 0.2, 0.3]


def test_one_drive_is_not_two(tmp_path):
    first = read_counts(written(tmp_path, "a.csv", COUNTED), (20, 10))
    with pytest.raises(UsageError, match="two of the files have this name"):
        refuse_unusable([first, first])
    with pytest.raises(UsageError, match="the same drive as a"):
        refuse_unusable([first, read_counts(written(tmp_path, "b.csv", COUNTED), (20, 10))])
    later = COUNTED.replace("5.", "105.").replace("6.", "106.")  # by another clock
    with pytest.raises(UsageError, match="the same drive as a"):
        refuse_unusable([first, read_counts(written(tmp_path, "d.csv", later), (20, 10))])
    other = read_counts(written(tmp_path, "c.csv", COUNTED.replace("110", "111")), (20, 10))
    refuse_unusable([first, other])


def test_a_decimal_comma_among_the_ends(tmp_path):
    ends = written(tmp_path, "ends.csv", "recording,x,y,heading_deg\none,0,5,0,1,4\n")
    with pytest.raises(UsageError, match="line 2 has more cells") as raised:
        read_ends(ends)
    assert "a decimal comma" in str(raised.value)


ROBOT = "book_2wd"  # 65 mm wheels, 20 slots


def test_command_names_track_and_stray(tmp_path):
    from diffbotctl.config.load import load_robot

    drive = load_robot(ROBOT).robot.drive
    stated = STATED._replace(
        right=drive.right.wheel.diameter, left=drive.left.wheel.diameter, track=drive.track
    )
    true = stated.reshaped(1.004, stated.track * 1.02)
    files, ends = [], ["recording,x,y,heading"]
    for number, each in enumerate(squares(true, stated, each_way=3, slip=0.0003)):
        counts = each.turns * drive.right.encoder.slots  # finer than whole slots: exact
        times = each.times * (1.0 + 1e-4 * number)  # no two drives take the same time
        counts = np.pad(counts, ((1, 1), (0, 0)), mode="edge")  # it stands before and after
        times = np.array([times[0] - 0.5, *times, times[-1] + 0.5])
        rows = zip(times, *counts.T, strict=True)
        text = "time,right,left\n" + "".join(f"{a:.9f},{b:.9f},{c:.9f}\n" for a, b, c in rows)
        files.append(str(written(tmp_path, f"{each.name}.csv", text)))
        x, y, heading = each.poses[-1]
        if each.name == "ccw-1":
            x += 1.0
        ends.append(f"{each.name}.csv,{x},{y},{heading}")
    ends_file = written(tmp_path, "ends.csv", "\n".join(ends))
    arguments = ["calibrate", "from-log", *files, "--robot", ROBOT, "--ends", str(ends_file)]
    result = CliRunner().invoke(program, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    lines = {line[:24].strip(): line for line in result.output.splitlines()}
    fitted = float(lines["track"].split()[3]) / 1000
    assert fitted == pytest.approx(true.track, rel=0.003)
    assert float(lines["right over left"].split()[4]) == pytest.approx(1.004, abs=0.001)
    assert any(line.startswith("ccw-1 ") and "left out" in line for line in lines.values())
    assert "kept as stated" in result.output


@pytest.mark.parametrize(
    ("option", "message"),
    [("--save", "add --yes, or leave out --save"), ("--truth", "requires an argument")],
)
def test_no_terminal_to_ask_on(tmp_path, option, message):
    counts = str(written(tmp_path, "a.csv", COUNTED))
    arguments = ["calibrate", "from-log", counts, "--robot", ROBOT, option]
    result = CliRunner().invoke(program, arguments)
    assert result.exit_code == 2 and message in " ".join(result.output.split())
    assert "--dry-run" not in result.output


def test_a_heading_of_many_turns_beside_the_counts(tmp_path):
    text = "time,right,left,x,y,heading\n0,0,0,0,0,0\n1,1,1,0.1,0,1e300\n"
    with pytest.raises(UsageError, match="row 2 states a heading of more than 100"):
        read_counts(written(tmp_path, "a.csv", text), (20, 20))
