"""The firmware's pure parts, compiled for this machine."""

from __future__ import annotations

import subprocess
import tempfile
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("codec", "speed", "storm", "battery", "settings", "deadman", "avr_pins")
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
FAST = ("-O2",)


@cache
def program(sanitized: bool = True, board: str = "mega2560") -> Path:
    """The compiled driver of the pure parts, with the pins of `board`.

    Raises CalledProcessError with gcc's words.
    """
    folder = Path(tempfile.mkdtemp(prefix="diffbot-pure-"))
    firmware = ROOT / "firmware"
    sources = [firmware / f"{part}.c" for part in (*PARTS, f"board_{board}")]
    out = folder / "pure"
    subprocess.run(
        [
            "gcc",
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Werror",
            *(SANITIZED if sanitized else FAST),
            f"-I{firmware}",
            "-o",
            str(out),
            str(ROOT / "tests/firmware/pure.c"),
            *map(str, sources),
            "-lm",
        ],
        check=True,
    )
    return out


def run(
    *words: object,
    lines: list[str] | None = None,
    sanitized: bool = True,
    board: str = "mega2560",
) -> list[str]:
    """Run a job of the driver; its lines. Raises CalledProcessError when a sanitizer objects."""
    done = subprocess.run(
        [program(sanitized, board), *map(str, words)],
        input="\n".join([*(lines or []), ""]),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{words}: code {done.returncode}\n{done.stderr}")
    return done.stdout.splitlines()
