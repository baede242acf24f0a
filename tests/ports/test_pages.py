"""The commands on the pages on ports and Bluetooth exist, and accept the arguments shown."""

import re
import shlex
from pathlib import Path

import click
import pytest

from diffbotctl.cli.main import program

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "ports.md", DOCS / "bluetooth.md"]
SHOWN = sorted(
    {
        words.strip()
        for page in PAGES
        for words in (
            *re.findall(r"^    diffbotctl (.*)$", page.read_text(), re.M),
            *re.findall(r"`diffbotctl ([^`]*)`", page.read_text()),
        )
    }
)


@pytest.mark.parametrize("words", SHOWN)
def test_a_shown_command_is_understood(words):
    """Parsed completely, but not executed."""
    command, arguments = program, shlex.split(words)
    while isinstance(command, click.Group):
        context = click.Context(command)
        _, command, arguments = command.resolve_command(context, arguments)
    command.make_context("shown", arguments)


def test_commands_are_shown():
    assert len(SHOWN) >= 8


def test_the_output_that_is_shown_is_what_is_printed(tmp_path):
    """The example in ports.md, for the user ana, who is in no group."""
    import os

    from diffbotctl.cli.ports import _print_report
    from diffbotctl.ports.access import SystemUser
    from diffbotctl.ports.diagnosis import survey_ports
    from tests.support.fake_machine import MEGA, FakeMachine

    machine = FakeMachine(tmp_path / "machine")
    machine.port("ttyACM0", MEGA, product="Mega 2560", by_id="usb-Arduino_Mega_2560_75330303-if00")
    seen = survey_ports(machine.root, SystemUser("ana", os.getuid() + 4000, frozenset()))

    @click.command()
    def show():
        _print_report(seen.reports[0], False)

    from click.testing import CliRunner

    printed = CliRunner().invoke(show).output
    assert printed.strip() in (DOCS / "ports.md").read_text()
