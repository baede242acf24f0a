"""Output files: what diffbotctl wrote may be overwritten, and only that."""

import pytest

from diffbotctl.cli import bag, robot_model
from diffbotctl.cli.output import check_overwrite, has_mark
from diffbotctl.errors import UsageError
from tests.command_result import invoke

FIELD = "odometry.odometry.x"


def run(command, *words):
    return invoke(command, *words)[0]


def writers(goal):
    """Each command that writes a file, with its suffix."""
    return {
        ".csv": (bag.command, "export", goal),
        ".svg": (bag.command, "plot", FIELD, goal),
        ".png": (bag.command, "plot", FIELD, goal),
        ".mcap": (bag.command, "recover", goal),
        ".urdf": (robot_model.export, "urdf", "book_2wd"),
    }


@pytest.mark.parametrize("suffix", [".csv", ".svg", ".png", ".mcap", ".urdf"])
def test_a_file_of_ours_is_overwritten_and_one_of_others_is_not(suffix, goal, tmp_path):
    words = writers(goal)[suffix]
    output = tmp_path / f"x{suffix}"
    run(*words, "--output", output)
    first = output.read_bytes()
    assert has_mark(first)
    run(*words, "--output", output)
    output.write_bytes(b"time,diffbotctl,x\n1,2,3\n")
    with pytest.raises(UsageError, match="did not write it"):
        run(*words, "--output", output)
    assert output.read_bytes() == b"time,diffbotctl,x\n1,2,3\n"
    run(*words, "--output", output, "--force")
    assert output.read_bytes() == first


def test_a_wide_table_is_recognised(goal, tmp_path):
    run(bag.command, "export", goal, "--output", tmp_path / "all.csv")
    header = (tmp_path / "all.csv").read_bytes().partition(b"\n")[0]
    assert len(header) > 1000
    check_overwrite(tmp_path / "all.csv", force=False)


@pytest.mark.parametrize(
    "content",
    [
        b"time,x\n0,1\n",
        b"# notes on diffbotctl\n",
        b"\x89PNG\r\n\x1a\n a screenshot of diffbotctl",
        b"<svg><text>diffbotctl</text></svg>",
        b"format: 1  # a pipeline for diffbotctl\n",
    ],
)
def test_the_name_alone_is_no_mark(content, tmp_path):
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(UsageError):
        check_overwrite(path, force=False)


def test_an_empty_file_may_be_overwritten(tmp_path):
    path = tmp_path / "x.csv"
    path.touch()
    check_overwrite(path, force=False)


def test_a_goal_is_not_recovered_onto_itself(goal):
    before = goal.read_bytes()
    with pytest.raises(Exception, match="must not overwrite"):
        run(bag.command, "recover", goal, "--output", goal, "--force")
    assert goal.read_bytes() == before
