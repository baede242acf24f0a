"""Mutations of the program: how many of those that all tests notice `make test` notices, too.

Each is made in a copy of the last commit, and the tests run there that reach its place: all tests
have run once before with a mark at every place. A value that one test has computed and another
finds in a cache counts for the first alone. A place outside of functions, and the firmware, are
reached by all. Tests with the mark `nightly` run only on what `make test` misses.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from prove.mutation_places import Mutation, c_mutations, python_mutations
from tests.support.trials.row import NoData, Row

ROOT = Path(__file__).parents[1]
# What is mutated, and the tests that are most likely to notice it, which run first.
AREAS = {
    "engine": ("diffbotctl/engine/*.py", "tests/engine tests/control_socket tests/runs"),
    "gate": ("diffbotctl/engine/[sow]*.py", "tests/engine tests/runs"),
    "drivers": ("diffbotctl/drivers/*.py", "tests/drivers tests/links tests/runs"),
    "links": ("diffbotctl/links/*.py", "tests/links tests/drivers tests/firmware"),
    "control": ("diffbotctl/control/*.py", "tests/control tests/blocks tests/estimation"),
    "checks": ("diffbotctl/config/checks/*.py", "tests/config tests/cli"),
    "firmware": ("firmware/*.c", "tests/firmware tests/runs"),
}
NOT_IN_AN_IMAGE = {"bridge.c"}  # another program, which is written by hand on a Mega
# A loop without an end is noticed, too: all tests take less than that.
TESTS_MAX_S, TIMED_OUT, NO_END = 7200, (124, 137), "the tests do not end"
# Written into the checkout as diffbotctl/reached.py, and a plugin of pytest: what a module of tests
# reaches when it is imported is its own. A confined process may not write.
REACHED = """
import os

_known = set()


def pytest_collectstart(collector):
    os.environ["PYTEST_CURRENT_TEST"] = collector.nodeid


def mark(number):
    test = os.environ.get("PYTEST_CURRENT_TEST", "").partition("::")[0]
    if (number, test) not in _known:
        _known.add((number, test))
        try:
            with open({path!r}, "a") as file:
                file.write(f"{{number}} {{test}}\\n")
        except OSError:
            pass
"""
MARKED = ('(__import__("diffbotctl.reached", fromlist=["mark"]).mark({number}) or (', "))")


class Found(NamedTuple):
    """The test that noticed a mutation, and whether `make test` runs it."""

    test: str | None
    is_short: bool


def drawn(rng: Random, area: str) -> Mutation:
    """A mutation of an area, each place with the same probability."""
    places = [
        Mutation(area, path.relative_to(ROOT), *place)
        for path in sorted(ROOT.glob(AREAS[area][0]))
        if path.name not in NOT_IN_AN_IMAGE and path.read_text().isascii()
        for place in (c_mutations if path.suffix == ".c" else python_mutations)(path.read_text())
    ]
    return rng.choice(places)


class Checkout:
    """A copy of the last commit, in which the tests run. A context manager."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="mutations-"))
        archive = subprocess.run(
            ["git", "archive", "HEAD"], cwd=ROOT, capture_output=True, check=True
        )
        subprocess.run(["tar", "-x", "-C", self.folder], input=archive.stdout, check=True)
        modules = Path("firmware") / "emulator" / "rp2040" / "node_modules"
        (self.folder / modules).symlink_to(ROOT / modules)
        self.environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        self.left_out: list[str] = []  # tests that fail without a mutation, too

    def __enter__(self) -> Checkout:
        return self

    def __exit__(self, *error: object) -> None:
        shutil.rmtree(self.folder)

    def write(self, mutation: Mutation, text: str) -> bool:
        """Write a file, and build the firmware from it; whether that succeeded."""
        path = self.folder / mutation.path
        path.write_text(text)
        if path.suffix != ".c":
            return True
        made = subprocess.run(
            ["make", "-C", path.parent], env=self.environment, capture_output=True
        )
        return made.returncode == 0

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run tests beside each other, as `make test` does."""
        options = ["-n", "5", "--dist", "loadscope", "--no-loadscope-reorder"]
        limit = ["timeout", "--kill-after=5", str(TESTS_MAX_S), sys.executable]  # and its children
        return subprocess.run(
            [*limit, "-m", "pytest", *options, "-q", "-p", "no:cacheprovider", *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
        )

    def failing(self, passed: Iterable[str], words: list[str]) -> str | None:
        """The first test that fails, but for those that `passed` when alone; None when all pass."""
        left_out = [f"--deselect={test}" for test in [*self.left_out, *passed]]
        done = self.run("-x", *left_out, *words)
        if done.returncode in (0, 5):  # 5: no test was chosen
            return None
        if done.returncode in TIMED_OUT:
            return NO_END
        failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, re.M)
        return failed[1] if failed else "collection"

    def fails(self, test: str) -> bool:
        """Whether a test fails alone: it does with the mutation, and not without it."""
        words = ["-q", "-p", "no:cacheprovider", "-m", "nightly or not nightly", test]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
        )
        return done.returncode == 1


def compiled(checkout: Checkout, rng: Random, area: str) -> Mutation:
    """A mutation of an area with which the firmware compiles."""
    while True:
        mutation = drawn(rng, area)
        original = (ROOT / mutation.path).read_text()
        succeeded = checkout.write(mutation, mutation.applied(original))
        checkout.write(mutation, original)
        if succeeded:
            return mutation


def reached(checkout: Checkout, mutations: list[Mutation]) -> list[set[str] | None]:
    """The modules of tests that reach each mutation; None: all of them may."""
    reports = checkout.folder / "reached"
    module = checkout.folder / "diffbotctl" / "reached.py"
    module.write_text(REACHED.format(path=str(reports)))
    for path in {each.path for each in mutations if each.is_in_function}:
        text = (ROOT / path).read_text()
        marks = [
            mark
            for number, each in enumerate(mutations)
            if each.path == path and each.is_in_function
            for mark in zip((each.begin, each.end), MARKED, (number, number), strict=True)
        ]
        for place, mark, index in sorted(marks, reverse=True):
            text = text[:place] + mark.replace("{number}", str(index)) + text[place:]
        compile(text, path, "exec")
        (checkout.folder / path).write_text(text)
    checkout.run("-p", "diffbotctl.reached", "-m", "nightly or not nightly")
    for path in {each.path for each in mutations}:
        (checkout.folder / path).write_text((ROOT / path).read_text())
    module.unlink()
    found: list[set[str] | None] = [set() if each.is_in_function else None for each in mutations]
    for line in reports.read_text().splitlines():
        at, _, test = line.partition(" ")
        tests = found[int(at)]
        if tests is not None and test:
            tests.add(test)
        else:
            found[int(at)] = None
    return found


def stages(mutation: Mutation, modules: set[str] | None) -> Iterator[tuple[bool, list[str]]]:
    """Words that choose the tests of a mutation, one run after the other; are they short?"""
    rest = set(modules or ())
    for name in AREAS[mutation.area][1].split():
        near = [name] if modules is None else [each for each in rest if each.startswith(f"{name}/")]
        rest.difference_update(near)
        if near:
            yield True, sorted(near)
    if rest or modules is None:
        yield True, sorted(rest)
    if modules is None or modules:
        yield False, ["-m", "nightly", *sorted(modules or ())]


def examined(checkout: Checkout, mutation: Mutation, modules: set[str] | None) -> Found:
    """Which test notices a mutation."""
    original = (ROOT / mutation.path).read_text()
    passed: list[str] = []
    try:
        checkout.write(mutation, mutation.applied(original))
        for is_short, words in stages(mutation, modules):
            while (test := checkout.failing(passed, words)) is not None:
                if test == NO_END:
                    return Found(test, is_short)
                if not checkout.fails(test):
                    passed.append(test)
                    continue
                checkout.write(mutation, original)
                if not checkout.fails(test):
                    return Found(test, is_short)
                checkout.left_out.append(test)
                checkout.write(mutation, mutation.applied(original))
        return Found(None, False)
    finally:
        checkout.write(mutation, original)


def rows(seed: int, mutations: int) -> Iterator[Row]:
    """A row for each mutation, and their sum."""
    rng, areas = Random(f"mutations {seed}"), list(AREAS)
    short = noticed = 0
    with Checkout() as checkout:
        chosen = [compiled(checkout, rng, areas[each % len(areas)]) for each in range(mutations)]
        for mutation, modules in zip(chosen, reached(checkout, chosen), strict=True):
            found = examined(checkout, mutation, modules)
            noticed += found.test is not None
            short += found.is_short
            how = "make test" if found.is_short else "nightly" if found.test else "none"
            what = mutation.described((ROOT / mutation.path).read_text())
            yield Row(f"{what} [{found.test or 'no test'}]", how, "(none)", True)
        for test in checkout.left_out:
            yield Row(f"{test} passes without a mutation", "fails", "passes", False)
    what = f"of {mutations} mutations, noticed by make test"
    if not noticed:
        yield NoData(what, "no test noticed one", ">= 90 %", False)
        return
    share = short / noticed
    yield Row(what, f"{short} of {noticed}, {share:.0%}", ">= 90 %", share >= 0.9)
