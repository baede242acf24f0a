"""The build of the compiled modules, and those that were compiled."""

from __future__ import annotations

import ast
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SPEC = importlib.util.spec_from_file_location("build_compiled", ROOT / "build_compiled.py")
build_compiled = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(build_compiled)

# Runs of the matrix: random robots, both plants, with and without missed edges.
CASES = ("31:0:none:1:0", "31:1:missed_5:2:0", "31:2:halved:1:0", "31:1000:none:2:0")

SOURCE = """\
\"\"\"A module.\"\"\"

from math import log
from typing import NamedTuple

SIZE, SHARE = 4, 1.0 / 3.0  # of something
PRIORS = (0.5, log(0.5))


class Pair(NamedTuple):
    left: float


@decorated
class Filter:
    pass
"""
ATTRIBUTED = """\
\"\"\"A module.\"\"\"

from math import log
from typing import NamedTuple; from typing import TYPE_CHECKING, Final
if TYPE_CHECKING: from mypy_extensions import mypyc_attr
SIZE: Final = 4; SHARE: Final = 1.0 / 3.0
PRIORS = (0.5, log(0.5))


class Pair(NamedTuple):
    left: float

@mypyc_attr(serializable=True, allow_interpreted_subclasses=True)
@decorated
class Filter:
    pass
"""


def test_the_compiler_gets_classes_and_constants_and_lines_keep_their_numbers():
    assert build_compiled.attributed(SOURCE) == ATTRIBUTED


@pytest.mark.parametrize("name", build_compiled.modules())
def test_each_module_that_is_compiled_can_be_prepared(name):
    source = (ROOT / "diffbotctl" / name).read_text()
    compile(build_compiled.attributed(source), name, "exec")


def test_what_is_left_out_exists():
    assert all((ROOT / "diffbotctl" / name).exists() for name in build_compiled.LEFT_OUT)


def test_no_compiled_module_is_older_than_its_source():
    for compiled in (ROOT / "diffbotctl").rglob("*.so"):
        source = compiled.with_name(compiled.name.partition(".")[0] + ".py")
        assert compiled.stat().st_mtime > source.stat().st_mtime, (
            f"{source.relative_to(ROOT)} has changed since it was compiled; "
            "run `make compiled`, or `make interpreted`"
        )


@pytest.mark.parametrize("name", build_compiled.modules())
def test_each_sum_states_whether_it_is_an_integer(name):
    for node in ast.walk(ast.parse((ROOT / "diffbotctl" / name).read_text())):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "sum":
            assert len(node.args) == 2, (
                f"diffbotctl/{name}:{node.lineno}: the compiler takes a sum without a start for an "
                "integer, and the compiled module then fails with floats; write "
                "`sum(..., 0.0)`, or `sum(..., 0)`"
            )


@pytest.mark.nightly
def test_compiled_modules_give_the_results_of_the_sources(tmp_path):
    for folder in ("diffbotctl", "firmware", "pipelines", "prove", "robots"):
        unwanted = shutil.ignore_patterns("*.so", "__pycache__", "node_modules")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=unwanted)
    shutil.copytree(ROOT / "tests" / "support", tmp_path / "tests" / "support", ignore=unwanted)
    for name in ("build_compiled.py", "setup.cfg"):
        shutil.copy(ROOT / name, tmp_path / name)

    def run(*words):
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        command = [sys.executable, *words]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert "Traceback" not in done.stderr, done.stderr  # rows that are missed end with 1
        return done.stdout

    def results():
        matrix = [run("-m", "prove.matrix", "--case", case) for case in CASES]
        with_gyro = run("-m", "prove", "--brief", "--seed", "3", "--section", "imu")
        assert "RAN" in with_gyro
        words = ("run", "wander", "--seed", "3", "--for", "20s", "--fast", "--quiet", "--digest")
        with_scanner = run("-m", "diffbotctl", *words)
        assert "digest" in with_scanner
        return with_gyro, with_scanner, matrix

    interpreted = results()
    run("build_compiled.py")
    origin = run("-c", "import diffbotctl.estimation.pose_filter as module; print(module.__file__)")
    assert origin.strip().endswith(".so") and str(tmp_path) in origin
    assert results() == interpreted
