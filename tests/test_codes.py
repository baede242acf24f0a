"""The codes in the sources and the texts that `diffbotctl explain` has for them."""

import ast
import re
from pathlib import Path
from typing import get_args

import diffbotctl
from diffbotctl.codes import code_texts
from diffbotctl.messages import StopCode

SOURCES = sorted(Path(diffbotctl.__file__).parent.rglob("*.py"))
PROBLEM_CODE = re.compile(r"[EW](-[A-Z0-9]+)+")


def strings():
    """Every string constant of the package, with its place."""
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value, f"{path.name}:{node.lineno}"


def test_every_code_in_the_sources_has_a_text():
    unknown = {
        text: place
        for text, place in strings()
        if PROBLEM_CODE.fullmatch(text) and text not in code_texts()
    }
    assert not unknown, (
        f"{unknown}: `diffbotctl explain` does not know them; correct the spelling, or add title "
        "and text to diffbotctl/codes.yaml"
    )


def test_every_text_belongs_to_a_code_in_the_sources():
    used = {text for text, _ in strings()}
    unused = [code for code in code_texts() if code not in used]
    assert not unused, f"{unused}: nothing raises them; remove them from diffbotctl/codes.yaml"


def test_stops_have_a_code_of_the_type():
    codes = set(get_args(StopCode))
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "Stop" and node.args[1:]:
                code = node.args[1]
                assert not isinstance(code, ast.Constant) or code.value in codes, (
                    f"{path.name}:{node.lineno} stops with {code.value!r}, which StopCode does not "
                    "list; correct the spelling, or add it there and to diffbotctl/codes.yaml"
                )
    assert codes - {""} == {code for code in code_texts() if code.islower()}
