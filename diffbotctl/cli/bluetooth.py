"""`diffbotctl bluetooth`: a robot's radio module, from finding it to knowing its link."""

from __future__ import annotations

import sys
from contextlib import closing
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.choose_port import choose_port
from diffbotctl.cli.command import argument, group, option
from diffbotctl.cli.options import JSON, ROBOT, YES, port_option, quantity_option
from diffbotctl.cli.output import print_row
from diffbotctl.errors import UserError

if TYPE_CHECKING:
    from diffbotctl.bluetooth.bluez import NearbyModule
    from diffbotctl.bluetooth.link_stats import LinkFigures
    from diffbotctl.bluetooth.rate_advice import RateAdvice
    from diffbotctl.config.configuration import RobotFile
    from diffbotctl.config.robot import Robot

# A module answers within one or two inquiries of 5.12 s each.
SEARCH_TIME = quantity_option(
    "s", "--for", "How long to search.", positive=True, default="10s", show_default=True
)
LINKED = """\
To drive over it:
    diffbotctl run goal --port {port}"""


@group("Set up", 7, "Find, pair and test a Bluetooth module")
def bluetooth() -> None:
    """Find and pair a Bluetooth module, test its link, change its rate."""


@bluetooth.command()
def scan(
    seconds: float = SEARCH_TIME,
    everything: bool = option("--all", "List other devices too, such as phones."),
    as_json: bool = JSON,
) -> int:
    """List the serial modules in range. Exit code: 1 when there is none."""
    from diffbotctl.bluetooth.bluez import BluezService

    count = others = 0
    with BluezService() as service:
        if not as_json:
            click.echo(f"Searching for {seconds:g} s. A module that is not connected blinks fast.")
        for found in service.scan(seconds):
            if everything or found.is_serial or not found.name:
                count += 1
                print_row(as_json, found._asdict(), _line(found))
            else:
                others += 1
    if not count:
        more = f"; {others} other devices, which --all lists" if others else ""
        click.echo(f"No serial module answered{more}. Is it powered, and not connected elsewhere?")
    return 0 if count else 1


def _line(found: NearbyModule) -> str:
    strength = "" if found.strength is None else f"{found.strength} dBm"
    kind = "serial port" if found.is_serial else ""
    paired = "paired" if found.is_paired else "not paired"
    return f"{found.address}  {found.name:<16}  {strength:<8}  {kind:<11}  {paired}".rstrip()


@bluetooth.command()
def pair(
    address: str,
    pin: str = option("The module's PIN.", default="1234", show_default=True),
    again: bool = option("Remove an existing pairing first."),
    seconds: float = SEARCH_TIME,
) -> None:
    """Pair with the module of ADDRESS; needed once."""
    from diffbotctl.bluetooth.bluez import BluezService, parse_port

    port = parse_port(address)
    with BluezService() as service:
        found = service.find(port.address, seconds)
        if again and found.is_paired:
            service.forget(found)
            click.echo("the old pairing is forgotten")
            found = service.find(port.address, seconds)
        if found.is_paired:
            click.echo(f"{found.name or port.address} is paired already")
        else:
            service.pair(found, pin)
            click.echo(f"paired with {found.name or port.address}")
    click.echo(LINKED.format(port=port))


@bluetooth.command()
def test(
    port: str,
    robot: str | None = ROBOT,
    seconds: float = quantity_option(
        "s", "--for", "How long to measure.", positive=True, default="20s", show_default=True
    ),
) -> None:
    """Measure latency, jitter and loss of the link on PORT: an address, or any serial port.

    Meets the board, asks it questions, looks at its telemetry, and proposes rates for the robot
    file. No motor moves.
    """
    from diffbotctl.bluetooth.link_stats import LinkFigures
    from diffbotctl.bluetooth.rate_advice import advise_rate
    from diffbotctl.config.robot import line_baud
    from diffbotctl.drivers.board_ports import is_usb
    from diffbotctl.drivers.robot_link import diffbot_host
    from diffbotctl.drivers.robot_ports import load_robot_at
    from diffbotctl.flash.board_jobs import measure_link
    from diffbotctl.links import link_protocol

    device = _device(port)
    file = load_robot_at(device, robot)
    click.echo(f"robot {file.file}, port {device}, {seconds:g} s")
    for report in measure_link(device, diffbot_host(file.robot, device), seconds):
        if not isinstance(report, LinkFigures):
            click.echo(report.text)
            continue
        for line in _figures(report):
            click.echo(line)
        link, board = file.robot.link, file.robot.board
        frame = link_protocol.frame_bytes(link.protocol, board.edge_times)
        baud = link_protocol.USB_BAUD if is_usb(device) else line_baud(file.robot)
        for line in _proposal(advise_rate(report, baud, frame), file.robot, baud):
            click.echo(line)


def _device(port: str) -> str:
    """A bare address is a module's."""
    from diffbotctl.bluetooth.bluez import parse_port
    from diffbotctl.drivers.socket_port import is_socket

    return (
        port if "/" in port or is_socket(port) or port.startswith("tty") else str(parse_port(port))
    )


def _figures(found: LinkFigures) -> list[str]:
    return [
        f"telemetry  {found.rate:.1f} frames a second, {found.lost:.1%} lost, "
        f"{found.damaged} damaged",
        f"answer     after {found.latency * 1000:.0f} ms, at worst "
        f"{found.latency_worst * 1000:.0f} ms",
        f"jitter     95 of 100 frames within {found.jitter * 1000:.0f} ms, at worst "
        f"{found.jitter_worst * 1000:.0f} ms",
        f"silence    {found.silence * 1000:.0f} ms at most",
    ]


def _proposal(proposal: RateAdvice, robot: Robot, measured_at: int) -> list[str]:
    """What to write into the robot file, where it differs from what is there."""
    lines = [f"note       {reason}" for reason in proposal.reasons]
    changes = []
    if proposal.telemetry != robot.board.telemetry:
        changes.append(f"board: {{telemetry: {proposal.telemetry} Hz}}")
    if proposal.deadman != robot.board.deadman:
        changes.append(f"board: {{deadman: {proposal.deadman * 1000:.0f} ms}}")
    if proposal.baud != measured_at:
        changes.append(f"link: {{baud: {proposal.baud}}}")
    if not changes:
        return [*lines, "The robot file's rates suit this link."]
    return [*lines, "Write into the robot file:", *(f"    {change}" for change in changes)]


FLOATS = (
    "The board is flashed twice. After each reset its pins float for 0.83 s, and a motor driver "
    "whose inputs float may turn the wheels: lift them, or switch the motors' supply off."
)
DONE = "The module went from {before} to {now} baud, and the board expects it so."
BY_HAND = """\
{file} still states {old} baud, and the next run would set the board to it. It must state:
    link: {{baud: {now}}}"""


@bluetooth.command()
def baud(
    rate: str = argument(type=click.Choice(["9600", "19200", "38400", "57600", "115200"])),
    port: str = port_option("auto", only_board=True),
    robot: str | None = ROBOT,
    yes: bool = YES,
) -> int:
    """Set an HC-05, wired to the board as the book has it, to RATE, the board and its file too.

    Leads through the module's AT mode: its button must be held while its power comes on. Exit code:
    1 when the robot file does not state the module's rate in the end.
    """
    from diffbotctl.bluetooth.hc05_at import BaudChange
    from diffbotctl.drivers.board_ports import refuse_radio
    from diffbotctl.drivers.robot_link import board_settings
    from diffbotctl.drivers.robot_ports import load_robot_at
    from diffbotctl.flash.hc05_baud import change_rate

    device = choose_port() if port == "auto" else port
    refuse_radio(device)
    file = load_robot_at(device, robot)
    click.echo(f"robot {file.file}, port {device}")
    click.echo(FLOATS)
    _wait(yes)
    # Closed at once when the person gives up: the firmware goes back onto the board then.
    written = True
    with closing(change_rate(device, board_settings(file.robot), int(rate))) as events:
        for event in events:
            if isinstance(event, BaudChange):
                click.echo(DONE.format(before=event.before, now=event.now))
                written = _noted(file, event.now, yes)
            else:
                _show(event, yes)
    return 0 if written else 1


def _noted(file: RobotFile, now: int, yes: bool) -> bool:
    """Whether the robot file states the module's rate; another one is replaced."""
    from diffbotctl.calibrate.robot_file import plan_value_change
    from diffbotctl.cli.calibrate_results import own, put

    old = file.robot.link.baud
    if old == now:
        click.echo(f"{file.file} already states this baud rate.")
        return True
    try:
        if put(plan_value_change(own(file.file), ("link", "baud"), str(now)), yes):
            return True
    except UserError as error:
        click.echo(str(error), err=True)
    click.echo(BY_HAND.format(file=file.file, old=old, now=now), err=True)
    return False


def _show(event: object, yes: bool) -> None:
    from diffbotctl.flash.board_session import JobMessage
    from diffbotctl.flash.hc05_baud import ManualStep

    if isinstance(event, JobMessage):
        click.echo(event.text)
    elif isinstance(event, ManualStep):
        click.echo(event.text)
        _wait(yes)


def _wait(yes: bool) -> None:
    """Wait until the user confirms it."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise click.UsageError("There is no terminal to ask on: lift the wheels, and add --yes.")
    click.prompt(
        "Press Enter when this is done", default="", show_default=False, prompt_suffix=". "
    )
