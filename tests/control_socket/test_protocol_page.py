"""The protocol's page is true: its client drives, by nc and by socat, and no verb is left out."""

import json
import re
import shutil
import subprocess
from math import inf
from pathlib import Path

import pytest

import diffbotctl
from diffbotctl.control_socket.dispatch import METHODS
from diffbotctl.control_socket.requests import declared_fields
from tests.support.running import PlainClient, running, stands

PAGE = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text()
CARRIERS = {"nc": 'nc -N -U "$1"', "socat": 'socat - "UNIX-CONNECT:$1"'}


TYPES = {float: "number", bool: "boolean", dict: "object", str: "text", object: "any"}


def methods_table():
    """The tables of methods and fields, from the declarations."""
    methods = ["| method | fields | what it does |", "|---|---|---|"]
    fields = ["| field | of | type | what it is |", "|---|---|---|---|"]
    for method, (request, _) in ((name, vars(method).values()) for name, method in METHODS.items()):
        declarations = declared_fields(request)
        names = ", ".join(
            f"`{name}`" if declaration.is_required else f"[`{name}`]"
            for name, declaration in declarations.items()
        )
        methods.append(f"| `{method}` | {names} | {' '.join(request.__doc__.split())} |")
        for name, (kind, choices, _, _, field) in declarations.items():
            limits = field.limits_text() if field.minimum > -inf else field.unit
            text = ", ".join(filter(None, [*choices] or [TYPES[kind], limits]))
            fields.append(f"| `{name}` | `{method}` | {text} | {field.help} |")
    return "\n".join([*methods, "", *fields]) + "\n"


def test_the_tables_are_the_generated_ones():
    table = methods_table()
    assert table in PAGE, f"copy these tables into the page:\n{table}"


def test_every_method_is_in_the_table():
    table = PAGE[PAGE.index("| method |") : PAGE.index("| field |")]
    names = re.findall(r"^\| `(\w+)` \|", table, re.M)
    assert names == list(METHODS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    runtime_folder = tmp_path_factory.mktemp("page")
    with running(runtime_folder, "goal", "--stay", "--goal", "0 0"):
        yield runtime_folder


@pytest.mark.parametrize("carrier", CARRIERS)
def test_the_example_client_drives_and_releases(folder, tmp_path, carrier):
    assert shutil.which(carrier), f"the tests need {carrier}: `make packages` installs it"
    script = re.search(r"```sh\n(.*?)```", PAGE, re.S)[1]
    assert CARRIERS["nc"] in script
    file = tmp_path / "drive.sh"
    file.write_text(script.replace(CARRIERS["nc"], CARRIERS[carrier]))
    words = ["sh", str(file), str(folder / "diffbotctl" / "test.socket")]
    out = subprocess.run(words, capture_output=True, text=True, timeout=60).stdout
    replies = [json.loads(line) for line in out.splitlines()]
    assert replies[0]["hello"] == 2
    assert all(each["ok"] for each in replies if "ok" in each)
    places = [each["message"]["x"] for each in replies if "message" in each]
    assert len(places) > 20
    assert abs(places[-1] - places[0]) > 0.02  # a second at 0.1 m/s, less the ramp
    client = PlainClient(folder)
    assert client.until(stands)["held"] is None


def test_the_version_of_its_example_is_this_one():
    assert re.findall(r'"version": "([\d.]+)"', PAGE) == [diffbotctl.__version__]
