"""The page of the first block: its files are written, its commands typed, as its reader would."""

import csv
import io
import re
import shlex
from pathlib import Path

import pytest

from diffbotctl.config import consents
from diffbotctl.config.code_files import CodeConsentError
from diffbotctl.config.load import load
from tests.support.running import cli

PAGE = Path(__file__).parents[1] / "docs" / "first_block.md"
FILE = re.compile(r"^```(?:python|yaml)\n(# (\S+)\n.*?)^```", re.M | re.S)
COMMANDS = re.compile(r"^diffbotctl (.*)$", re.M)
ROOM = 2.0, 1.0  # m, from its middle to the walls of wall.yaml


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """What each command of the page printed, after the consent to the files was given."""
    folder = tmp_path_factory.mktemp("first")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        patch.chdir(folder)
        for match in FILE.finditer(PAGE.read_text()):
            Path(match[2]).write_text(match[1])
        for path in sorted(folder.glob("*.yaml")):
            try:
                load(str(path))
            except CodeConsentError as asked:
                for code in asked.files:
                    consents.remember(code.consent_key)
        typed = {}
        for line in COMMANDS.findall(PAGE.read_text()):
            code, printed, complaints = cli(folder, *shlex.split(line), cwd=folder)
            assert code == 0, f"{line}\n{printed}\n{complaints}"
            typed[line] = printed
        yield folder, typed


def poses(folder, recording):
    fields = [f"odometry.odometry.{name}" for name in ("x", "y")]
    _, table, _ = cli(folder, "bag", "export", recording, *fields, cwd=folder)
    rows = csv.reader(io.StringIO(table.partition("\n")[2]))
    return [(float(time), float(x), float(y)) for time, x, y in rows if x]


def test_the_block_counts_both_stops_of_the_robot(outputs):
    _, typed = outputs
    counts = re.findall(r"at rest, (\d)", typed["bag export rests.mcap rests.text.text"])
    assert counts == list("123456789"[: len(counts)]) and len(counts) >= 2  # at both goals
    assert "bit for bit" in typed["replay rests.mcap --check"]


def test_the_figure_eight_is_driven_to_its_end(outputs):
    folder, typed = outputs
    (run,) = (printed for line, printed in typed.items() if line.startswith("run eight"))
    assert "the end of the path is reached" in run
    way = [(x, y) for _, x, y in poses(folder, "eight.mcap")]
    assert max(x for x, _ in way) == pytest.approx(0.8, abs=0.08)
    assert min(x for x, _ in way) == pytest.approx(-0.8, abs=0.08)
    assert max(abs(y) for _, y in way) == pytest.approx(0.4, abs=0.05)
    assert way[-1] == pytest.approx((0.0, 0.0), abs=0.04)


def test_the_robot_drives_along_the_wall(outputs):
    folder, _ = outputs
    after = [(x, y) for time, x, y in poses(folder, "wall.mcap") if time > 25.0]
    gaps = [min(ROOM[0] - abs(x), ROOM[1] - abs(y)) for x, y in after]
    assert min(gaps) > 0.35 and max(gaps) < 0.55
    assert max(x for x, _ in after) > 1.2 and min(x for x, _ in after) < -1.2  # and around the room
