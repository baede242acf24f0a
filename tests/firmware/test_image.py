"""Each shipped image is the build of the source, byte for byte."""

import shutil
import subprocess
from pathlib import Path

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.flash.intel_hex import read_hex
from diffbotctl.testing.trials import board

FIRMWARE = Path(__file__).parents[2] / "firmware"
PACKAGES = "sudo apt-get install gcc-avr avr-libc make"
IMAGES = sorted({board.image for board in BOARDS.values()})
COMPILER = "5.4.0"  # Debian's gcc-avr: another version produces other bytes


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory):
    """Folder with the images built by `make` from a copy of the source."""
    for program in ("make", "avr-gcc", "avr-objcopy"):
        assert shutil.which(program), f"{program} is missing: {PACKAGES}"
    asked = ["avr-gcc", "-dumpversion"]
    version = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    assert version == COMPILER, (
        f"avr-gcc {version} gives other bytes than {COMPILER}, with which the image is built: "
        f"take Debian's ({PACKAGES})"
    )
    copy = tmp_path_factory.mktemp("rebuilt") / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build", "*.hex", "emulator"))
    done = subprocess.run(["make", "-C", copy], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"the firmware does not build; make says:\n{done.stderr}"
    return copy


@pytest.mark.parametrize("name", IMAGES)
def test_the_shipped_image_is_the_build_of_the_source(rebuilt, name):
    paths = FIRMWARE / name, rebuilt / name
    shipped, fresh = (read_hex(path.read_text(), path.name) for path in paths)
    differing = [
        at for at, (one, two) in enumerate(zip(shipped, fresh, strict=False)) if one != two
    ]
    first = f"first at 0x{differing[0]:05X}" if differing else "the lengths differ"
    assert paths[1].read_bytes() == paths[0].read_bytes(), (
        f"{name} is not the build of firmware/ ({len(differing)} bytes differ, {first}): "
        "run `make -C firmware` and commit the image with the source"
    )


def test_it_fits():
    for row in board.image():
        assert row.met, row.line()
