"""Hostile robot, pipeline and answers files, drawn at random: wrong types, huge and odd values,
nesting, aliases, control characters, bytes that are no text.
"""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import yaml

from diffbotctl.config import lookup

ESCAPE = "\x1b]0;owned\x07\x1b[2J\x1b[31m"
ODD_TEXTS = (
    ESCAPE,
    "\x9b31m",
    "a\rb",
    "\u202egnp.exe",
    "\u2028",
    "e\u0301" * 50,
    "\U0001f916",
    "x" * 100_000,
    "$x",
    "$$",
    "${HOME}",
    "../../../../etc/passwd",
    "/dev/zero",
    "robot.",
    "follower.twist",
    "5 furlongs",
    "1e309 m",
    "-0.0",
    "nan",
    ".inf",
    "-.inf",
    "inf m",
    "1 m/s^2",
    "90\u00b0",
    "\u22125 mm",
    "1/8",
    "1_000",
    "9" * 400,
    "0x7fffffff",
    "12:30:45",
    "2026-01-01",
    "true",
    "none",
    "~",
    "",
    " ",
)
ODD_VALUES: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 7, 255, 65_536, 2**31, 2**63, 2**64, 10**30, -(10**18)),
    *(0.1, 1e-9, 1e-320, 5e-324, 1e9, 1e18, 1e300, -1e308, 1.7976931348623157e308),
    *(None, True, False, [], {}, [[]], [{}], {"": ""}, [None], [1, 2, 3], {"a": {"b": {"c": 1}}}),
    *("1 m", "65 mm", "90 deg", "100 rpm", "300 ms", "40 Hz", "0 m", "1e6 m", "1e-6 m", "1e9 Hz"),
    list(range(1000)),
)
SCRAPS = (
    *("{", "}", "[", "]", ": ", ", ", "\n", "\t", "- ", "#", "&a ", "*a ", "!!python/object ", "|"),
    *(">", "'", '"', "\0", "\ufeff", "<<: ", "---\n", "%YAML 9.9\n", "? ", "\x1b[31m", "\u202e"),
)
SHIPPED = [
    path for kind in ("robots", "pipelines") for path in sorted(lookup.folder(kind).glob("*.yaml"))
]


def bombs() -> dict[str, bytes]:
    """Files whose content grows while it is read, or that are no text."""
    laughs = "".join(
        f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 10)}]\n" if n else "l0: &l0 [lol]\n"
        for n in range(10)
    )
    variables = "".join(f"  v{n}: $v{n - 1}$v{n - 1}\n" for n in range(1, 40))
    head = "format: 1\nkind: robot\n"
    return {
        "aliases": f"{head}{laughs}".encode(),
        "alias of itself": f"{head}board: &a [*a]\n".encode(),
        "deep list": f"{head}board: {'[' * 5000}".encode(),
        "deep mapping": f"{head}board: {'{a: ' * 5000}".encode(),
        "deep indentation": (head + "".join(f"{' ' * n}a:\n" for n in range(400))).encode(),
        "variables": f"format: 1\nkind: pipeline\nvars:\n  v0: {'x' * 100}\n{variables}".encode(),
        "10 MB": b"a: " + b"x" * 10_000_000,
        "10 MB of keys": b"".join(b"k%d: 1\n" % n for n in range(900_000)),
        "200 kB of keys": b"".join(b"k%d: 1\n" % n for n in range(20_000)),
        "100 kB of brackets": b"[" * 100_000,
        "long number": f"{head}drive: {{track: {'9' * 200_000}}}".encode(),
        "long digits": f"{head}drive: {{track: 0.{'0' * 200_000}1 m}}".encode(),
        "binary": bytes(range(256)) * 100,
        "zeros": b"\0" * 5000,
        "UTF-16": "format: 1\nkind: robot\n".encode("utf-16"),
        "Latin-1": b"format: 1\nkind: robot\n# Stra\xdfe\n",
        "surrogates": b'format: 1\nkind: "\\ud800"\n',
        "escapes": f'format: 1\nkind: robot\n"{json.dumps(ESCAPE)[1:-1]}": 1\n'.encode(),
        "raw escapes": f"format: 1\nkind: {ESCAPE}\n".encode(),
        "escapes in a name": b'format: 1\nkind: pipeline\nblocks: {"a\\e[31m": {block: talker}}',
        "comment only": b"# " + b"x" * 200_000,
        "anchors": b"".join(b"k%d: &a%d 1\n" % (n, n) for n in range(15_000)),
        "tabs": b"\t" * 10_000,
        "directive": b"%TAG ! tag:x,2000:\n--- !a\n",
        "empty": b"",
    }


def hostile_files(rng: Random, count: int) -> Iterator[tuple[str, bytes]]:
    """`count` files with the name of the shipped file that each was made from."""
    for _ in range(count):
        path = rng.choice(SHIPPED)
        if rng.random() < 0.75:
            tree = yaml.safe_load(path.read_text())
            for _ in range(rng.choice((1, 1, 1, 2, 3))):
                _change(rng, tree)
            yield (
                path.stem,
                yaml.safe_dump(tree, allow_unicode=rng.random() < 0.5).encode(
                    "utf-8", "surrogatepass"
                ),
            )
        else:
            yield path.stem, _scrambled(rng, path.read_text()).encode("utf-8", "surrogatepass")


def odd_value(rng: Random) -> Any:
    """A value of any type and size."""
    kind = rng.randrange(6)
    if kind < 2:
        return rng.choice(ODD_TEXTS)
    if kind < 5:
        return copy.deepcopy(rng.choice(ODD_VALUES))  # a later change must not reach the table
    return float(f"{rng.choice('-+')}{rng.random()}e{rng.randint(-320, 308)}")


def _change(rng: Random, tree: Any) -> None:
    """Replace, add, remove or move one value somewhere in the tree.

    A moved value can contain itself afterwards, so each node is looked at once.
    """
    places: list[tuple[Any, Any]] = []
    waiting, seen = [tree], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for key, value in items:
            places.append((node, key))
            if isinstance(value, dict | list):
                waiting.append(value)
    if not places:
        return
    node, key = rng.choice(places)
    match rng.randrange(8):
        case 0:
            del node[key]
        case 1 if isinstance(node, dict):
            node[rng.choice(ODD_TEXTS)] = node[key]
        case 2:
            other, name = rng.choice(places)
            node[key] = other[name] if name in _keys(other) else None
        case _:
            node[key] = odd_value(rng)


def _keys(node: Any) -> Any:
    return node if isinstance(node, dict) else range(len(node))


def _scrambled(rng: Random, text: str) -> str:
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text) + 1)
        end = min(len(text), at + rng.choice((0, 1, 1, 3, 20)))
        text = text[:at] + rng.choice((*SCRAPS, str(odd_value(rng))[:2000])) + text[end:]
    return text


def included_files(folder: Path) -> dict[str, Path]:
    """Robot files in `folder` whose includes do not end, or lead to what is no file."""
    head = "format: 1\nkind: robot\n"

    def write(name: str, text: str) -> Path:
        path = folder / f"{name}.yaml"
        path.write_text(head + text)
        return path

    cases = {
        "itself": write("itself", "include: ./itself.yaml\n"),
        "device": write("device", "include: /dev/zero\n"),
        "terminal": write("terminal", "include: /dev/tty\n"),
        "directory": write("directory", "include: ./\n"),
        "process": write("process", "include: /proc/self/mem\n"),
        "1,000 times": write("many", f"include: [{', '.join(['book_2wd'] * 1000)}]\n"),
    }
    for level in range(12):  # each includes the next one ten times: 10^11 readings
        names = ", ".join([f"./tree{level + 1}.yaml"] * 10)
        write(f"tree{level}", f"include: [{names}]\n" if level < 11 else "")
    cases["tree"] = folder / "tree0.yaml"
    for level in range(9):  # within the permitted depth, 10^9 readings
        names = ", ".join([f"./bush{level + 1}.yaml"] * 10)
        write(f"bush{level}", f"include: [{names}]\n" if level < 8 else "board: {}\n")
    cases["bush"] = folder / "bush0.yaml"
    big = ", ".join("x" * 20 for _ in range(9000))
    for number in range(60):
        write(f"big{number}", f"notes{number}: [{big}]\n")
    names = ", ".join(f"./big{number}.yaml" for number in range(60))
    cases["60 large files"] = write("large", f"include: [{names}]\n")
    (folder / "loop.yaml").symlink_to("loop.yaml")
    cases["a link to itself"] = folder / "loop.yaml"
    cases["an included link to itself"] = write("looped", "include: ./loop.yaml\n")
    os.mkfifo(folder / "fifo.yaml")
    cases["a pipe"] = folder / "fifo.yaml"
    cases["an included pipe"] = write("piped", "include: ./fifo.yaml\n")
    return cases
