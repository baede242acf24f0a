"""The commands that show a robot's model, as a person runs them."""

from xml.etree import ElementTree

from tests.support.confined import run_command


def run(*arguments, cwd=None, code=0):
    """What the program prints for `arguments`."""
    done = run_command(*arguments, folder=cwd)
    assert done.code == code, done.complaints
    return done.printed if code == 0 else done.complaints


def test_frames_prints_the_tree():
    lines = run("frames", "book_2wd").splitlines()
    assert lines[0] == "odom"
    assert "base_footprint" in lines[1] and "moves with odometry" in lines[1]
    assert lines[2].split()[1:] == [
        "base_link",
        "x",
        "+0.0000",
        "y",
        "+0.0000",
        "z",
        "+0.0325",
        "m",
        "fixed",
    ]
    (left,) = [line for line in lines if "left_wheel_link" in line]
    assert "y +0.0625" in left and left.endswith("turns")
    assert "-0.0000" not in "\n".join(lines)


def test_show_draws_both_views_within_80_columns():
    text = run("show", "book_2wd")
    assert "from above: long 230 mm, wide 151 mm, track 125 mm" in text
    assert "from the left: wheel 65 mm" in text
    assert max(len(line.rstrip()) for line in text.splitlines()) <= 80
    assert sum("\u2800" < sign < "\u28ff" for sign in text) > 200


def test_show_writes_a_picture(tmp_path):
    output = run("show", "book_2wd", "--output", str(tmp_path / "robot.svg"))
    assert "robot.svg" in output
    root = ElementTree.parse(tmp_path / "robot.svg").getroot()
    assert root.tag.endswith("svg")


def test_export_urdf_writes_the_same_to_a_file(tmp_path):
    text = run("export", "urdf", "book_2wd", "--name", "mine")
    run("export", "urdf", "book_2wd", "--name", "mine", "--output", str(tmp_path / "a.urdf"))
    assert (tmp_path / "a.urdf").read_text() == text
    assert ElementTree.fromstring(text).get("name") == "mine"


def test_a_file_that_cannot_be_written_is_an_error_with_a_text(tmp_path):
    output = run("export", "urdf", "--output", str(tmp_path / "no" / "a.urdf"), code=1)
    assert "E-OUTPUT" in output and "Traceback" not in output


def test_an_unknown_robot_is_an_error_with_a_text():
    assert "Did you mean" in run("frames", "bok_2wd", code=2).replace("did", "Did")
