"""Each shipped image is the build of the source, byte for byte."""

import shutil
import subprocess
from pathlib import Path

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.flash.flasher import load
from tests.support.trials import board

FIRMWARE = Path(__file__).parents[2] / "firmware"
PACKAGES = "sudo apt-get install gcc-avr avr-libc gcc-arm-none-eabi make"
IMAGES = sorted({board.image for board in BOARDS.values()})
# Debian's gcc-avr and gcc-arm-none-eabi: another version produces other bytes.
COMPILERS = {"avr-gcc": "5.4.0", "arm-none-eabi-gcc": "12.2.1"}


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory):
    """Folder with the images built by `make` from a copy of the source."""
    for program in ("make", "avr-objcopy", *COMPILERS):
        assert shutil.which(program), f"{program} is missing: {PACKAGES}"
    for program, expected in COMPILERS.items():
        asked = [program, "-dumpversion"]
        version = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
        assert version == expected, (
            f"{program} {version} gives other bytes than {expected}, with which it is built: "
            f"take Debian's ({PACKAGES})"
        )
    copy = tmp_path_factory.mktemp("rebuilt") / "firmware"
    left_out = shutil.ignore_patterns("build", "*.hex", "*.uf2", "emulator")
    shutil.copytree(FIRMWARE, copy, ignore=left_out)
    command = ["make", "-C", copy, f"ROOT={FIRMWARE.parent}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"the firmware does not build; output of make:\n{done.stderr}"
    return copy


@pytest.mark.parametrize("name", IMAGES)
def test_the_shipped_image_is_the_build_of_the_source(rebuilt, name):
    paths = FIRMWARE / name, rebuilt / name
    shipped, fresh = (load(path) for path in paths)
    differing = [
        at for at, (one, two) in enumerate(zip(shipped, fresh, strict=False)) if one != two
    ]
    first = f"first at 0x{differing[0]:05X}" if differing else "the lengths differ"
    assert paths[1].read_bytes() == paths[0].read_bytes(), (
        f"{name} is not the build of firmware/ ({len(differing)} bytes differ, {first}): "
        "run `make -C firmware` and commit the image with the source"
    )


def test_it_fits(rebuilt):
    for row in board.image(rebuilt):
        assert row.met, row
