"""What becomes of words that their terminal, pipe or disk does not take."""

import json
import os
import re
import resource
import subprocess
from math import degrees

import pytest

from tests.sampling import each_once
from tests.support.command_process import command_line

# Each prints letters beyond ASCII to a UTF-8 terminal: boxes, braille, branches.
PICTURES = (
    ("show", "book_2wd"),
    ("wiring", "book_2wd"),
    ("frames", "book_2wd"),
    ("graph", "goal", "--robot", "book_2wd"),
)


def output_of(*words, stdout=subprocess.PIPE, cwd=None, preexec_fn=None, **variables):
    """What a process of its own prints: these are about how it starts and ends."""
    return subprocess.run(
        command_line(*words),
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | variables,
        cwd=cwd,
        preexec_fn=preexec_fn,
    )


@pytest.mark.parametrize("words", PICTURES)
def test_a_terminal_without_the_letters_is_no_defect(words):
    done = output_of(*words, PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) > 5


C_LOCALE = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize("words", PICTURES)
def test_the_c_locale_is_no_defect(words):
    done = output_of(*words, **C_LOCALE)
    assert (done.returncode, done.stderr) == (0, "")


def test_files_are_utf_8_in_every_locale(tmp_path):
    robot = tmp_path / "mine.yaml"
    robot.write_text("# R\u00e4der\nformat: 1\nkind: robot\ninclude: book_2wd\n", encoding="utf-8")
    record = ("--record", str(tmp_path / "a.mcap"), "--for", "0.5s", "--fast", "--quiet")
    done = output_of("run", "goal", "--robot", str(robot), *record, **C_LOCALE)
    assert "final stop confirmed" in done.stdout and "E-DEFECT" not in done.stderr
    assert output_of("replay", str(tmp_path / "a.mcap"), "--check", **C_LOCALE).returncode == 0


@pytest.mark.parametrize(
    "words",
    [
        ("run", "goal", "--set", "follower.tolerance=\udcff"),
        ("run", "goal", "--robot", "r\udcff.yaml", "--fast", "--for", "1s", "--record", "a.mcap"),
        ("run", "r\udcff.yaml"),
        ("export", "urdf", "r\udcff.yaml", "--output", "o.urdf"),
        ("check", "r\udcff.yaml"),
    ],
)
def test_words_that_are_no_utf_8_are_refused(words, tmp_path):
    with open(os.fsencode(tmp_path) + b"/r\xff.yaml", "w") as file:
        file.write("format: 1\nkind: robot\ninclude: book_2wd\n")
    done = output_of(*words, cwd=tmp_path)
    assert done.returncode == 2
    assert "UTF-8" in done.stdout + done.stderr and "E-DEFECT" not in done.stderr


@pytest.mark.parametrize(
    "words", [("wiring", "book_2wd"), ("graph", "goal"), ("show", "book_2wd")], ids=lambda w: w[0]
)
def test_a_file_is_written_whole_or_stays_as_it_was(words, tmp_path):
    picture = tmp_path / "picture.svg"
    assert output_of(*words, "--output", str(picture)).returncode == 0
    whole = picture.read_bytes()
    done = output_of(*words, "--output", str(picture), preexec_fn=_limit_files)
    assert done.returncode == 1 and "E-OUTPUT" in done.stderr
    assert picture.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [picture]


def _limit_files():
    """As a full disk: nothing longer can be written."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))


@pytest.mark.parametrize("words", [("learn",), ("learn", "next"), ("start", "--status")])
def test_a_deleted_working_directory_is_named_and_is_no_defect(tmp_path, words):
    done = output_of(*words, cwd=tmp_path, preexec_fn=tmp_path.rmdir)
    assert done.returncode == 1 and "E-FILE-READ" in done.stderr
    assert "working directory was deleted" in done.stderr


@pytest.mark.parametrize("words", (*PICTURES[:1], ("explain",), ("run", "goal", "--fast")))
def test_a_full_disk_is_named_and_is_no_defect(words):
    with open("/dev/full", "w") as full:
        done = output_of(*words, stdout=full)
    assert done.returncode == 1
    assert "E-DISK-FULL" in done.stderr and "E-DEFECT" not in done.stderr
    assert "Traceback" not in done.stderr and "Exception" not in done.stderr


LIMIT = (
    r"error probably below 9 cm and \d+ deg if `slots` is right: "
    "track and wheel diameters are not calibrated; run"
)


def test_the_end_of_a_run_states_its_error_in_one_plain_sentence():
    process = output_of("run", "goal", "--fast", "--quiet")
    assert re.search(LIMIT, " ".join(process.stdout.split()))
    assert "`diffbotctl calibrate geometry`" in process.stdout  # on one line, to be copied
    assert "standard deviation" not in process.stdout and "estimated" not in process.stdout


def test_the_figures_of_the_error_are_behind_an_option_and_in_json():
    shown = output_of("run", "goal", "--fast", "--quiet", "--verbose").stdout
    sd = re.search(r"pose sd ([\d.]+) mm, ([\d.]+) deg \(standard deviation\)", shown)
    estimated = re.search(r"estimated error ([\d.]+) mm, ([\d.]+) deg", shown)
    record = json.loads(output_of("run", "goal", "--fast", "--json").stdout)
    for found, name in ((sd, "pose_sd"), (estimated, "estimated_error")):
        values = record[name]["position"] * 1000, degrees(record[name]["heading"])
        assert [float(text) for text in found.groups()] == pytest.approx(values, abs=0.06)
    assert record["actual_error"]["position"] < 0.01


def test_a_calibrated_robot_is_not_sent_to_calibrate(tmp_path):
    path = tmp_path / "robot.yaml"
    entries = ", ".join(
        f"{field}: {{value: {value}, sd: {sd}}}"
        for field, value, sd in (
            ("drive.track", "125 mm", "0.3 mm"),
            ("drive.left.wheel.diameter", "65 mm", "0.1 mm"),
            ("drive.right.wheel.diameter", "65 mm", "0.1 mm"),
        )
    )
    path.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\ncalibration: {{{entries}}}\n")
    shown = output_of("run", "goal", "--fast", "--quiet", "--robot", str(path)).stdout
    assert re.search(r"(?m)^ +error probably below [1-5] cm and \d deg$", shown), shown


@each_once(
    closed=[(0,), (1,), (2,), (0, 1), (0, 1, 2)],
    typed=[
        (("flash", "firmware", "--port", "PORT"), 2, "no terminal to confirm"),
        (("bluetooth", "baud", "9600", "--port", "PORT"), 2, "no terminal to ask on"),
        (("calibrate", "encoders", "--port", "sim"), 2, "no terminal to ask on"),
        (("run", "goal", "--dash"), 2, "--dash needs a terminal"),
        (("dash",), 2, "E-NO-ENGINE"),
        (("run", "goal", "--fast", "--for", "0.5s", "--record", "a.mcap"), 1, ""),
    ],
)
def test_closed_streams_are_no_defect(typed, closed, tmp_path):
    words, code, cause = typed

    def close():
        for descriptor in closed:
            os.close(descriptor)

    board, port = os.openpty()
    words = [os.ttyname(port) if word == "PORT" else word for word in words]
    folder = {"XDG_RUNTIME_DIR": str(tmp_path)}
    done = output_of(*words, cwd=tmp_path, preexec_fn=close, **folder)
    os.close(board)
    os.close(port)
    assert done.returncode == code, done.stderr
    assert "E-DEFECT" not in done.stderr and "Traceback" not in done.stderr
    assert 2 in closed or cause in done.stderr
    if "--record" in words:  # what was printed is not in the file
        assert output_of("bag", "info", "a.mcap", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("folder", ["relative", ""])
def test_folders_of_the_user_that_are_no_paths_from_the_root_are_ignored(folder, tmp_path):
    """As the XDG specification requires: clients elsewhere would not find the socket."""
    (tmp_path / "relative").mkdir()
    variables = ("XDG_RUNTIME_DIR", "XDG_STATE_HOME", "XDG_CACHE_HOME")
    named = {variable: folder for variable in variables} | {"HOME": str(tmp_path / "home")}
    # The folder that is taken instead is one for all workers, whose `tmp_path` has the same name.
    name = f"of-{os.getpid()}"
    words = ("run", "goal", "--fast", "--for", "0.5s", "--quiet", "--name", name)
    assert "final stop confirmed" in output_of(*words, cwd=tmp_path, **named).stdout
    assert output_of("start", "--status", cwd=tmp_path, **named).returncode == 0
    assert list((tmp_path / "relative").iterdir()) == []
    assert not (tmp_path / "diffbotctl").exists()
