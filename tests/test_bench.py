"""`make bench` runs, and the engine and the direct calls that it compares do the same."""

import os
import subprocess
import sys


def test_the_engine_and_direct_calls_give_the_same_commands(tmp_path):
    words = ["-m", "prove.bench", "--brief", "--section", "overhead"]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, env=environment)
    first, *others, last = done.stdout.splitlines()
    same = "RAN    overhead: engine and direct calls give the same commands: True (True)"
    assert first == same, done.stderr
    assert len(others) == 2 and last == "bench: 0 rows missed, 0 sections broken off"
