import pytest

from diffbotctl.calibrate.log_reader import read_counts
from diffbotctl.errors import UsageError
from tests.support.confined import run_command
from tests.support.trials.calibration import rows


def test_counts_of_a_recorded_run(tmp_path):
    file = tmp_path / "run.mcap"
    done = run_command("run", "goal", "--record", file, "--fast")
    assert done.code == 0, done.output
    log = read_counts(file, (20, 20))
    # The goal is 1 m ahead or so: each wheel of 0.065 m turns some five times.
    assert 3 < log.turns[-1].mean() < 10
    assert (log.turns * 20 == (log.turns * 20).round()).all()


def test_a_file_that_is_not_a_recording(tmp_path):
    file = tmp_path / "run.mcap"
    file.write_text("nonsense")
    with pytest.raises(UsageError, match="E-CALIBRATE-LOG"):
        read_counts(file, (20, 20))


def test_the_table_of_figures_states_when_there_is_no_data(tmp_path):
    (only,) = rows([tmp_path])
    assert only.figure == "no data"
    assert only.verdict == "NO DATA"
