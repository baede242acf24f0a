"""Every file in bad/ has the mistake in its name; its first lines are the expected messages.

`python tests/config/test_bad_files.py` rewrites the expected messages: read the diff.
"""

import shlex
from pathlib import Path

import pytest

from diffbotctl.codes import code_texts
from diffbotctl.config.load import check

BAD = Path(__file__).parent / "bad"
FILES = sorted(BAD.glob("*.yaml"))
# Caused by the installation, a run or the command line, not by a file.
NOT_FROM_FILES = {
    "E-BLOCK-CLASH",
    "E-BLOCK-IMPORT",
    "E-BLOCK-RAISED",
    "E-LESSON",
    "E-PARTS",  # of parts that are named on the command line
    "E-BLOCK-OUTPUT",  # found while it runs
    "E-TRIALS",  # of a file of trials, as the next two
    "E-TRIALS-BASELINE",
    "E-TRIALS-LONG",
    "E-TRIALS-ONLY",
    "E-WATCHDOG",  # found while it runs
    "E-BUSY",
    "E-CALIBRATION-SIMULATED",  # of a real robot
    "E-CODE",
    "E-CODE-CONSENT",
    "E-CODE-FILE",  # of a file with code
    "E-DEFECT",
    "E-DEVICE",
    "E-DISK-FULL",
    "E-DRIVE-BLOCKED",  # found while it runs
    "E-EMULATOR",
    "E-ENDLESS",  # of the options of `run`
    "E-FIELD",
    "E-FILE-ENCODING",
    "E-FILE-SIZE",
    "E-FILE-WRITE",
    "E-FOXGLOVE-LIBRARY",
    "E-FOXGLOVE-LISTEN",
    "E-HELD",
    "E-IMU-FAULT",  # found as a run starts
    "E-KIT",
    "E-LATE",
    "E-LOG",
    "E-MESSAGE-TYPE",  # of an installed package
    "E-NO-ANSWER",
    "E-NO-BOARD",
    "E-NO-ENGINE",
    "E-SEVERAL-BOARDS",
    "E-SEVERAL-ENGINES",
    "E-SEVERAL-ROBOTS",
    "E-OUTPUT",
    "E-PICTURE",
    "E-PROGRAM-CONSENT",
    "E-PROTOCOL",
    "E-RECORD",
    "E-RECORDING",
    "E-RECORDING-CUT",
    "E-REQUEST",
    "E-ROS-WORD",
    "E-ROS2",
    "E-ROSBAG2",
    "E-ROBOT-FIELD",
    "E-ROBOT-WHICH",
    "E-SAVE",
    "E-SERVICE-GOALS",
    "E-SOCKET",
    "E-SSH",
    "E-START-ANSWER",
    "E-WEB-CERTIFICATE",
    "E-WEB-LIBRARY",
    "E-WEB-LISTEN",
    "E-WIRING-NONE",
}


def answer(file: Path) -> str:
    """The messages of the `diffbotctl check` command in the first line of the file."""
    words = shlex.split(file.read_text().split("\n", 1)[0])[4:]
    sets = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    problems = check(f"./{file.name}", None, sets, real="--real" in words)
    return "\n\n".join(problem.render() for problem in problems)


def expected(file: Path) -> str:
    lines = []
    for line in file.read_text().split("\n")[1:]:
        if not line.startswith("#"):
            break
        lines.append(line[2:])
    return "\n".join(lines)


@pytest.fixture(autouse=True)
def working_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(BAD)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_messages_are_the_expected_ones(file):
    assert answer(file) == expected(file)


ELSEWHERE = ("E-BLUETOOTH", "E-BOARD", "E-CALIBRATE", "E-FLASH", "E-MAP", "E-PORT", "W-PORT")


@pytest.mark.parametrize("code", sorted(code for code in code_texts() if code[:2] in ("E-", "W-")))
def test_three_files_show_each_code(code):
    if code in NOT_FROM_FILES or code.startswith(ELSEWHERE):
        assert not any(f" {code}" in expected(file) for file in FILES), (
            "remove it from NOT_FROM_FILES"
        )
        return
    assert sum(f" {code}" in expected(file) for file in FILES) >= 3


def test_no_line_is_wider_than_a_terminal():
    for file in FILES:
        for line in expected(file).split("\n"):
            assert len(line) <= 80, f"{file.name}: {line}"


def _update() -> None:
    import os

    os.chdir(BAD)
    for file in FILES:
        first, _, rest = file.read_text().partition("\n")
        lines = rest.split("\n")
        while lines and lines[0].startswith("#"):
            lines.pop(0)
        before, now = None, ""
        while now != before:  # the messages contain line numbers, which depend on their own length
            before = now
            head = [first, *(f"# {line}".rstrip() for line in now.split("\n"))]
            file.write_text("\n".join([*head, *lines]))
            now = answer(file)


if __name__ == "__main__":
    _update()
