"""Optiboot, the bootloader of the Uno and of new Nanos, built from the source of the Arduino core.

The prebuilt image of Debian's package has 534 bytes for a section of 512 and does not start.
Without the light that flashes at the start it fits.
"""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from diffbotctl.emulator.program import BOOTLOADERS

START = 0x7E00
OPTIONS = (
    *("-mmcu=atmega328p", "-DF_CPU=16000000L", "-Os", "-fno-inline-small-functions", "-w"),
    *("-fno-split-wide-types", "-mshort-calls", "-nostartfiles", "-Wl,--relax"),
    *("-DLED_START_FLASHES=0", "-DBAUD_RATE=115200"),
    *(f"-Wl,--section-start=.text=0x{START:x}", "-Wl,--section-start=.version=0x7ffe"),
)


@cache
def optiboot() -> Path:
    """Its image as a hex file. Raises CalledProcessError, FileNotFoundError without avr-gcc."""
    folder = Path(mkdtemp(prefix="diffbot-optiboot-"))
    program, image = folder / "optiboot.elf", folder / "optiboot.hex"
    source = BOOTLOADERS / "optiboot/optiboot.c"
    subprocess.run(["avr-gcc", *OPTIONS, str(source), "-o", str(program)], check=True)
    sections = ["-j", ".text", "-j", ".data", "-j", ".version"]
    flags = ["--set-section-flags", ".version=alloc,load"]
    objcopy = ["avr-objcopy", *sections, *flags, "-O", "ihex", str(program), str(image)]
    subprocess.run(objcopy, check=True)
    # The records with a start address, which simavr does not know.
    kept = [line for line in image.read_text("ascii").splitlines(True) if line[7:9] != "03"]
    image.write_text("".join(kept), "ascii")
    return image
