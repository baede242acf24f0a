"""Mutations of the program: how many of those that all tests notice `make test` notices, too.

Each is made in a copy of the last commit, and the tests run there. Those with the mark `nightly`
run only on what `make test` misses.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.support.trials.row import NoData, Row

ROOT = Path(__file__).parents[1]
# What is mutated, and the tests that are most likely to notice it: they run first.
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
COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATIONS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
TOKENS = {" < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ", " == ": " != "}
TOKENS |= {" != ": " == ", " && ": " || ", " || ": " && ", " + ": " - ", " - ": " + "}
C_TOKEN = re.compile(
    "|".join(map(re.escape, sorted(TOKENS, key=len, reverse=True))) + r"|(?<![\w.])\d+(?=[;,)\]u ])"
)
C_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*|\"[^\"\n]*\"|^\s*#[^\n]*|'[^'\n]*'", re.S | re.M)


class Mutation(NamedTuple):
    """A piece of a file, and what stands there instead."""

    area: str
    path: Path  # from the root of the checkout
    begin: int
    end: int
    new: str

    def applied(self, text: str) -> str:
        """The text of the file with the mutation."""
        return text[: self.begin] + self.new + text[self.end :]

    def described(self, text: str) -> str:
        """Where and what it is, in one line."""
        line = text.count("\n", 0, self.begin) + 1
        old = " ".join(text[self.begin : self.end].split())
        return f"{self.path}:{line}: {old} -> {' '.join(self.new.split())}"


class Found(NamedTuple):
    """The test that noticed a mutation, and whether `make test` runs it."""

    test: str | None
    is_short: bool


def python_mutations(text: str) -> Iterator[tuple[int, int, str]]:
    """Begin, end and replacement of each mutation of a Python file."""
    tree = ast.parse(text)
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    left_out = {id(node) for each in ast.walk(tree) for node in unmutated(each)}
    for node in ast.walk(tree):
        changed = None if id(node) in left_out else mutated(node)
        if changed is not None:
            begin = starts[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
            end = starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
            yield begin, end, f"({ast.unparse(changed)})"


def unmutated(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes inside of types, which change nothing, and of f-strings, which have no own places."""
    for name in ("annotation", "returns"):
        stated = getattr(node, name, None)
        if stated is not None:
            yield from ast.walk(stated)
    if isinstance(node, ast.JoinedStr):
        yield from ast.walk(node)


def mutated(node: ast.AST) -> ast.expr | None:
    """The node with another operator or number; None when it has neither."""
    match node:
        case ast.Compare(left, [operator], rest) if type(operator) in COMPARISONS:
            return ast.Compare(left, [COMPARISONS[type(operator)]()], rest)
        case ast.BinOp(left, operator, right) if type(operator) in OPERATIONS:
            return ast.BinOp(left, OPERATIONS[type(operator)](), right)
        case ast.BoolOp(operator, values):
            return ast.BoolOp(ast.Or() if isinstance(operator, ast.And) else ast.And(), values)
        case ast.UnaryOp(ast.Not(), operand):
            return operand
        case ast.IfExp(test, body, orelse):
            return ast.IfExp(ast.UnaryOp(ast.Not(), test), body, orelse)
        case ast.Constant(bool() as value):
            return ast.Constant(not value)
        case ast.Constant(int() | float() as value):
            return ast.Constant(value + 1 if isinstance(value, int) else 2.0 * value + 0.5)
    return None


def c_mutations(text: str) -> Iterator[tuple[int, int, str]]:
    """Begin, end and replacement of each mutation of a C file."""
    code = C_COMMENT.sub(lambda found: " " * len(found[0]), text)
    for found in C_TOKEN.finditer(code):
        new = TOKENS.get(found[0]) or str(int(found[0]) + 1)
        yield found.start(), found.end(), new


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

    def failing(self, *words: str) -> str | None:
        """The first test that fails; None when all pass."""
        options = ["-n", "3", "--dist", "loadscope", "-x", "-q", "-p", "no:cacheprovider"]
        options += [f"--deselect={test}" for test in self.left_out]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *options, *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
        )
        if done.returncode in (0, 5):  # 5: no test was chosen
            return None
        failed = re.search(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, re.M)
        return failed[1] if failed else "collection"

    def fails(self, test: str) -> bool:
        """Whether a test fails: with the mutation taken back, it is no judge of it."""
        words = ["-q", "-p", "no:cacheprovider", "-m", "nightly or not nightly", test]
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
        )
        return done.returncode == 1


def examined(checkout: Checkout, mutation: Mutation) -> Found | None:
    """Which test notices a mutation; None when it is none: it does not compile."""
    original = (ROOT / mutation.path).read_text()
    try:
        if not checkout.write(mutation, mutation.applied(original)):
            return None
        near = AREAS[mutation.area][1].split()
        for is_short, words in ((True, near), (True, []), (False, ["-m", "nightly"])):
            while (test := checkout.failing(*words)) is not None:
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
        for number in range(mutations):
            found = None
            while found is None:
                mutation = drawn(rng, areas[number % len(areas)])
                found = examined(checkout, mutation)
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
