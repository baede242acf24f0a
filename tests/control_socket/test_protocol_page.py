"""The protocol's page is true: its client drives, by nc and by socat, and no verb is left out."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from diffbotctl.control_socket.dispatch import METHODS, methods_table
from diffbotctl.testing.running import PlainClient, running, stands

PAGE = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text()
CARRIERS = {"nc": 'nc -N -U "$1"', "socat": 'socat - "UNIX-CONNECT:$1"'}


def test_the_tables_are_the_generated_ones():
    assert methods_table() in PAGE, "copy the output of dispatch.methods_table() into the page"


def test_every_method_is_in_the_table():
    table = PAGE[PAGE.index("| method |") : PAGE.index("| field |")]
    names = re.findall(r"^\| `(\w+)` \|", table, re.M)
    assert names == list(METHODS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("page")
    with running(made, "goal", "--stay", "--goal", "0 0"):
        yield made


@pytest.mark.parametrize("carrier", CARRIERS)
def test_the_client_of_the_page_drives_and_lets_go(folder, tmp_path, carrier):
    assert shutil.which(carrier), f"the tests need {carrier}: `make packages` installs it"
    script = re.search(r"```sh\n(.*?)```", PAGE, re.S)[1]
    assert CARRIERS["nc"] in script
    file = tmp_path / "drive.sh"
    file.write_text(script.replace(CARRIERS["nc"], CARRIERS[carrier]))
    words = ["sh", str(file), str(folder / "diffbotctl" / "test.socket")]
    out = subprocess.run(words, capture_output=True, text=True, timeout=30).stdout
    said = [json.loads(line) for line in out.splitlines()]
    assert said[0]["hello"] == 2
    assert all(each["ok"] for each in said if "ok" in each)
    places = [each["message"]["x"] for each in said if "message" in each]
    assert len(places) > 20
    assert abs(places[-1] - places[0]) > 0.02  # a second at 0.1 m/s, less the ramp
    client = PlainClient(folder)
    assert client.until(stands)["held"] is None
