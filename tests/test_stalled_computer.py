"""A failure is repeated only if the computer stood still during it, and the summary states it."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.stalled_computer import StalledComputer

ROOT = Path(__file__).parents[1]
PLUGIN = """
import pytest
from tests.stalled_computer import StalledComputer
computer = StalledComputer()
def pytest_configure(config):
    config.pluginmanager.register(computer)
@pytest.fixture
def watch():
    return computer.process.pid
"""
TEST = """
import os, signal, time
from pathlib import Path
def test_it(watch):
    runs = Path("runs")
    count = int(runs.read_text()) if runs.exists() else 0
    runs.write_text(str(count + 1))
    [log] = Path({logs!r}).glob("diffbotctl-stalls-*")
    until = time.monotonic() + 30
    while not log.stat().st_size:
        assert time.monotonic() < until, "the watch did not begin"
    if {is_stalled}:
        size = log.stat().st_size
        os.kill(watch, signal.SIGSTOP)
        time.sleep(0.3)
        os.kill(watch, signal.SIGCONT)
        while log.stat().st_size == size:
            assert time.monotonic() < until
            time.sleep(0.01)
    assert count >= {passes_from}, {output!r}
"""


@pytest.mark.parametrize(
    ("is_stalled", "output", "passes_from", "runs", "outcome"),
    [
        (False, "", 0, 1, "1 passed"),
        (False, "", 9, None, "1 failed"),  # once, unless the computer does stand still meanwhile
        (True, "", 1, 2, "1 passed"),
        (True, "", 9, 3, "1 failed"),  # it is not repeated for ever
        (False, "stopped by host_frozen", 1, 2, "1 passed"),
        (False, "stopped by host_frozen", 9, 3, "1 failed"),
    ],
)
def test_a_failure_is_repeated_only_if_the_computer_stood_still(
    tmp_path, is_stalled, output, passes_from, runs, outcome
):
    (tmp_path / "conftest.py").write_text(PLUGIN)
    values = {"is_stalled": is_stalled, "passes_from": passes_from, "output": output}
    text = TEST.format(**values, logs=str(tmp_path))
    (tmp_path / "test_it.py").write_text(text)
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "TMPDIR": str(tmp_path)}
    printed = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "."],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    assert outcome in printed, printed
    count = int((tmp_path / "runs").read_text())
    assert ("repeated tests" in printed) == (count > 1), printed
    assert runs in (count, None), printed


@pytest.mark.parametrize("half", ["", "2", "250.", "250.75", "250.75 9.", "250.75 9.9"])
def test_a_line_that_is_half_written_does_not_count_yet(tmp_path, half):
    computer = object.__new__(StalledComputer)
    computer.log = tmp_path / "stalls"
    computer.log.write_text(f"100.5 0.0\n200.5 0.25\n201.5 0.5\n{half}")
    assert computer.longest_since(150.0) == 0.5
    assert computer.longest_since(201.6) == 0.0
