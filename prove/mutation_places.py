"""Places of a program where one operator or number is exchanged for another."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

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
    is_in_function: bool

    def applied(self, text: str) -> str:
        """The text of the file with the mutation."""
        return text[: self.begin] + self.new + text[self.end :]

    def described(self, text: str) -> str:
        """Where and what it is, in one line."""
        line = text.count("\n", 0, self.begin) + 1
        old = " ".join(text[self.begin : self.end].split())
        return f"{self.path}:{line}: {old} -> {' '.join(self.new.split())}"


def python_mutations(text: str) -> Iterator[tuple[int, int, str, bool]]:
    """Begin, end and replacement of each mutation of a Python file; whether a function has it."""
    tree = ast.parse(text)
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    left_out = {id(node) for each in ast.walk(tree) for node in unmutated(each)}
    inside = {id(node) for each in ast.walk(tree) for node in statements(each)}
    for node in ast.walk(tree):
        changed = None if id(node) in left_out else mutated(node)
        if changed is not None:
            begin = starts[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
            end = starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
            yield begin, end, f"({ast.unparse(changed)})", id(node) in inside


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """What runs when a function is called, and not when its module is imported."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        for statement in node.body:
            yield from ast.walk(statement)


def unmutated(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes inside of types, which change nothing, of f-strings, which have no own places, and of
    patterns, which are no expressions."""
    for name in ("annotation", "returns"):
        stated = getattr(node, name, None)
        if stated is not None:
            yield from ast.walk(stated)
    if isinstance(node, ast.JoinedStr | ast.pattern):
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


def c_mutations(text: str) -> Iterator[tuple[int, int, str, bool]]:
    """The same of a C file, of whose functions no mark is left."""
    code = C_COMMENT.sub(lambda found: " " * len(found[0]), text)
    for found in C_TOKEN.finditer(code):
        new = TOKENS.get(found[0]) or str(int(found[0]) + 1)
        yield found.start(), found.end(), new, False
