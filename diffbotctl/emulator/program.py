"""The programs that emulate boards: compiled, or found, on this machine."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from diffbotctl import user_folders
from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.lookup import folder
from diffbotctl.errors import Problem, RunError
from diffbotctl.links.diffbot_frames import BoardCode

FIRMWARE = folder("firmware")
IMAGE = FIRMWARE / "diffbot_mega2560.hex"
BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders")
SOURCES = FIRMWARE / "emulator"
RP2040 = SOURCES / "rp2040"
SIMAVR = "libsimavr-dev"


class EmulatorError(RunError):
    """The emulator cannot be built, or has crashed."""

    def __init__(self, cause: str, fix: str = "run again with --debug and report the output"):
        super().__init__(Problem("E-EMULATOR", "emulated board", cause, fix))


class EmulatedChip(NamedTuple):
    """A microcontroller as simavr knows it, and the stock bootloader of its board."""

    name: str
    bootloader: str  # in the folder of the Arduino core


CHIPS = {
    BoardCode.MEGA2560: EmulatedChip("atmega2560", "stk500v2/stk500boot_v2_mega2560.hex"),
    BoardCode.ATMEGA328P: EmulatedChip("atmega328p", "atmega/ATmegaBOOT_168_atmega328.hex"),
}


def image_of(board: BoardCode) -> Path:
    return FIRMWARE / next(pins.image for pins in BOARDS.values() if pins.chip == board.name)


def build(into: Path | None = None) -> Path:
    """The emulator's program, compiled into a cache folder when it is not there yet.

    Raises EmulatorError naming the Debian packages when a compiler or simavr is missing.
    """
    sources = sorted(SOURCES.glob("*.c"))
    mark = hashlib.sha256()
    for source in sorted(SOURCES.glob("*.[ch]")):
        mark.update(source.read_bytes())
    program = (into or cache()) / f"emulator-{mark.hexdigest()[:16]}"
    if not program.exists():
        _compile(sources, program)
    return program


def rp2040_program() -> list[str]:
    """The command that starts the emulator of a Pico.

    Raises EmulatorError naming what is missing: node, or the package rp2040js.
    """
    node = shutil.which("node")
    if node is None:
        cause = "that of a Pico needs Node.js, version 18 or newer, which is not installed"
        raise EmulatorError(cause, "sudo apt-get install nodejs npm")
    folder = RP2040 if (RP2040 / "node_modules").exists() else _cached_sources(RP2040)
    if not (folder / "node_modules" / "rp2040js").exists():
        cause = "that of a Pico needs the npm package rp2040js, which is not installed"
        raise EmulatorError(cause, f"npm ci --prefix {folder}")
    return [node, str(folder / "emulator.mjs")]


def _cached_sources(source: Path) -> Path:
    """A copy of an emulator's sources in the cache.

    Node.js looks for packages in the folder of the program and above it, and the folder of an
    installation is not ours to write.
    """
    files = sorted([*source.glob("*.mjs"), *source.glob("*.json")])
    mark = hashlib.sha256()
    for file in files:
        if file.name == "package-lock.json":  # another version of a package is another folder
            mark.update(file.read_bytes())
    copy = cache() / f"rp2040-{mark.hexdigest()[:16]}"
    copy.mkdir(parents=True, exist_ok=True)
    for file in files:
        target, content = copy / file.name, file.read_bytes()
        if not target.exists() or target.read_bytes() != content:
            partial = target.with_name(f"{target.name}.{os.getpid()}")
            partial.write_bytes(content)
            partial.replace(target)
    return copy


def _require(boots: bool = False) -> None:
    """Raises EmulatorError with all Debian packages that are missing to build it, and to boot."""
    missing = [
        what
        for what, here in (
            ("gcc", shutil.which("gcc") is not None),
            ("libc6-dev", Path("/usr/include/stdlib.h").exists()),
            (SIMAVR, Path("/usr/include/simavr/sim_avr.h").exists()),
            ("arduino-core-avr", not boots or BOOTLOADERS.exists()),
        )
        if not here
    ]
    if missing:
        why = "it is built on this machine, and packages are missing"
        raise EmulatorError(why, f"sudo apt-get install {' '.join(missing)}")


def _compile(sources: list[Path], program: Path) -> None:
    _require()
    compiler = shutil.which("gcc") or "gcc"
    program.parent.mkdir(parents=True, exist_ok=True)
    partial = program.with_name(f"{program.name}.{os.getpid()}")
    options = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"]
    command = [compiler, *options, str(partial), *map(str, sources), "-lsimavr"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise EmulatorError(f"it does not compile; output of gcc:\n{done.stderr.strip()}")
    partial.replace(program)


def bootloader(board: BoardCode = BoardCode.MEGA2560) -> Path:
    """The image of a board's stock bootloader, without the records that simavr complains of.

    Raises EmulatorError naming the Debian package when it is not installed.
    """
    stock = BOOTLOADERS / CHIPS[board].bootloader
    if not stock.exists():
        _require(boots=True)
    kept = [line for line in stock.read_text("ascii").splitlines(True) if line[7:9] != "03"]
    copy = cache() / stock.name
    copy.parent.mkdir(parents=True, exist_ok=True)
    partial = copy.with_name(f"{copy.name}.{os.getpid()}")
    partial.write_text("".join(kept), "ascii")
    partial.replace(copy)
    return copy


def cache() -> Path:
    return user_folders.cache_folder()
