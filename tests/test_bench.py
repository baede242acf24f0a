"""`make bench` runs, and the engine and the direct calls that it compares do the same."""

import subprocess
import sys


def test_the_engine_and_direct_calls_give_the_same_commands():
    words = ["-m", "prove.bench", "--brief", "--section", "overhead", "--section", "simulation"]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    first, *others, last = done.stdout.splitlines()
    assert first.startswith("ok      engine and direct calls give the same commands"), done.stderr
    assert len(others) == 4 and last.endswith(" rows missed")
