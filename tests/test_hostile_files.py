"""Hostile files end in an error for a person: no defect, no escape sequence, little memory.

`python -m prove` runs larger samples of the same generators.
"""

from pathlib import Path
from random import Random

import pytest

from tests.sampling import by_day
from tests.support.confined import ConfinedCommands
from tests.support.trials import hostile_recordings, hostile_tables, hostile_yaml

MEMORY_MAX_BYTES = 100 << 20
GOOD = Path(__file__).parent / "data" / "recordings"


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    with ConfinedCommands(tmp_path_factory.mktemp("hostile")) as commands:
        yield commands


def checked(outcome):
    assert outcome.faults == [], outcome.output[-2000:]
    assert outcome.peak_bytes <= MEMORY_MAX_BYTES
    return outcome


def test_a_file_that_grows_or_is_no_text_is_refused(commands, tmp_path):
    path = tmp_path / "bomb.yaml"
    for name, content in hostile_yaml.bombs().items():
        path.write_bytes(content)
        assert checked(commands.run("check", path)).code == 2, name
        assert checked(commands.run("run", path, "--fast", "--for", "1s")).code == 2, name


def test_includes_that_do_not_end_or_are_no_files_are_refused(commands, tmp_path):
    for name, path in hostile_yaml.included_files(tmp_path).items():
        outcome = checked(commands.run("check", path))
        assert outcome.code == 2, name
        assert "E-INCLUDE" in outcome.output or "E-FILE-READ" in outcome.output, name


def test_includes_within_the_limits_are_read(commands, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(f"format: 1\nkind: robot\ninclude: [{', '.join(['book_2wd'] * 30)}]\n")
    assert checked(commands.run("check", path)).code == 0


@pytest.mark.parametrize("seed", by_day(1, range(4)))
def test_changed_files_are_accepted_or_refused_and_run(seed, commands, tmp_path):
    rng = Random(seed)
    path = tmp_path / "changed.yaml"
    robots = {shipped.stem for shipped in hostile_yaml.SHIPPED if shipped.parent.name == "robots"}
    for stem, content in hostile_yaml.hostile_files(rng, 8):
        path.write_bytes(content)
        words = ("goal", "--robot", path) if stem in robots else (path,)
        checked(commands.run("check", path))
        checked(commands.run("run", *words, "--fast", "--for", "1s", "--quiet"))


def test_a_recording_that_unpacks_to_gigabytes_is_refused_with_its_place(commands, tmp_path):
    whole = (GOOD / "edges.mcap").stat().st_size
    for name, content in hostile_recordings.bombs(GOOD / "edges.mcap").items():
        path = tmp_path / f"{name}.mcap".replace("/", "")
        path.write_bytes(content)
        outcome = checked(commands.run("bag", "info", path))
        if len(content) > whole:  # the whole recording precedes the bad chunk
            assert outcome.code == 1, name
            assert "E-RECORDING" in outcome.output and f"byte {whole - 37}" in outcome.output, name
        repaired = path.with_suffix(".repaired.mcap")
        assert checked(commands.run("bag", "recover", path, "--output", repaired)).code == 0, name


@pytest.mark.parametrize("name", by_day(1, ["edges.mcap", "ease.mcap"]))
def test_damaged_recordings_are_read_or_refused(name, commands, tmp_path):
    rng = Random(name)
    path = tmp_path / "damaged.mcap"
    for _, content in hostile_recordings.hostile_recordings(rng, GOOD / name, 6):
        path.write_bytes(content)
        for words in (["bag", "info", path], ["bag", "diff", path, GOOD / "edges.mcap"]):
            checked(commands.run(*words))
        checked(commands.run("bag", "recover", path, "--output", tmp_path / "r.mcap", "--force"))
        checked(commands.run("replay", path, "--check"))


@pytest.mark.parametrize("name", ["a pipe", "a device", "a directory", "a link to itself"])
def test_a_recording_must_be_a_file(name, commands, tmp_path):
    hostile_yaml.included_files(tmp_path)
    path = {
        "a pipe": tmp_path / "fifo.yaml",
        "a device": "/dev/zero",
        "a directory": tmp_path,
        "a link to itself": tmp_path / "loop.yaml",
    }[name]
    outcome = checked(commands.run("bag", "info", path))
    assert outcome.code == 1 and "E-RECORDING" in outcome.output


@pytest.mark.parametrize("seed", by_day(1, range(2)))
def test_tables_of_drives_are_read_or_refused(seed, commands, tmp_path):
    path = tmp_path / "drive.csv"
    for content in hostile_tables.hostile_tables(Random(seed), 8):
        path.write_bytes(content)
        checked(commands.run("calibrate", "from-log", path, "--robot", "book_2wd"))


def test_answers_and_state_files_are_read_or_refused(commands, tmp_path):
    answers = tmp_path / "answers.yaml"
    state = Path(commands.folder) / "diffbotctl" / "start.json"
    state.parent.mkdir(exist_ok=True)
    for content in hostile_tables.hostile_answers(Random(1), 8):
        answers.write_bytes(content)
        state.write_bytes(content)
        words = ("calibrate", "battery", "--port", "sim", "--yes", "--answers", answers)
        checked(commands.run(*words))
        checked(commands.run("start", "--status"))


@pytest.mark.parametrize("name", ["fifo.yaml", "/dev/zero", "loop.yaml", "."])
def test_logs_and_answers_must_be_files(name, commands, tmp_path):
    hostile_yaml.included_files(tmp_path)
    path = tmp_path / name
    assert checked(commands.run("calibrate", "from-log", path, "--robot", "book_2wd")).code == 2
    words = ("calibrate", "battery", "--port", "sim", "--yes", "--answers", path)
    assert checked(commands.run(*words)).code == 2
