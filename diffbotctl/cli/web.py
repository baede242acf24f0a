"""`diffbotctl web` and `run --web`: the page of a running robot, for browsers and phones."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import command, option, require_packages
from diffbotctl.cli.engine_client import host
from diffbotctl.cli.options import ENGINE, VIEW, tcp_port_option
from diffbotctl.cli.screens import engine_of
from diffbotctl.errors import UserError
from diffbotctl.printable import write_raw

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress
    from diffbotctl.processes.screen import RunSnapshot
    from diffbotctl.ui.saved_view import ViewSettings
    from diffbotctl.web.certificate import ServerCertificate
    from diffbotctl.web.server import WebServer
    from diffbotctl.web.sessions import Session

TCP_PORT = 8642
CLOSED = (
    "the page's server has ended; the run goes on: Ctrl-C ends it, `diffbotctl web` serves it again"
)
QR_COLOURS = ("\x1b[97;40m", "\x1b[0m")  # light on dark, also on a light terminal

LAN = option("Serve the page in the local network too, with TLS.")
PAGE_PORT = tcp_port_option(TCP_PORT, "TCP port of the page.")


@command("Look", 2, "; on a page")
def web(
    lan: bool = LAN,
    tcp_port: int = PAGE_PORT,
    view_file: Path | None = VIEW,
    engine: str | None = ENGINE,
) -> None:
    """Serve a page of a running engine: map, driving, goals, parameters, log.

    Prints a link, with --lan also as a QR code. It works once, for one device; the next one
    follows. Without --lan only browsers on this machine can open it. Leaving this program stops a
    robot that is driven from the page.
    """
    from diffbotctl.control_socket.client import choose_engine
    from diffbotctl.processes.screen import DRIVING_NICENESS
    from diffbotctl.ui.saved_view import read_view

    os.nice(DRIVING_NICENESS)
    _require_library()
    view = None if view_file is None else read_view(str(view_file))
    _serve(choose_engine(engine, host()), lan, tcp_port, view)
    click.echo("the run has ended")


def check_options(has_socket: bool) -> None:
    """Raises UserError where a run can have no page."""
    if not has_socket:
        raise click.UsageError("--web needs the control socket: leave out --fast and --no-socket")
    _require_library()


def show_page(
    lan: bool, tcp_port: int, view: ViewSettings | None
) -> Callable[[Iterator[RunSnapshot]], None]:
    """What the child of `run --web` runs: the page's server, and the lines of the log."""
    return partial(_show, lan, tcp_port, view)


def _show(
    lan: bool, tcp_port: int, view: ViewSettings | None, snapshots: Iterator[RunSnapshot]
) -> None:
    from diffbotctl.ui.run_text import print_log

    parent = os.getppid()
    log = threading.Thread(target=print_log, args=(snapshots,), daemon=True)
    try:
        engine = engine_of(parent)
        log.start()
        _serve(engine, lan, tcp_port, view)
    except UserError as error:
        print(error, file=sys.stderr)
        os.kill(parent, signal.SIGINT)
    if log.is_alive():
        log.join()


def _require_library() -> None:
    require_packages("E-WEB-LIBRARY", "the page", "web", "aiohttp", "cryptography", "segno")


def _serve(engine: EngineAddress, lan: bool, tcp_port: int, view: ViewSettings | None) -> None:
    """Serve the page until the run has ended."""
    import asyncio

    from diffbotctl.client.connections import listen
    from diffbotctl.web.certificate import load_certificate, state_folder, utc_now
    from diffbotctl.web.link import EVERY_ADDRESS, LOOPBACK, network_addresses
    from diffbotctl.web.server import WebServer

    addresses = [*network_addresses(), LOOPBACK] if lan else [LOOPBACK]
    listener = listen(EVERY_ADDRESS if lan else LOOPBACK, tcp_port, "E-WEB-LISTEN", "the page")
    certificate = load_certificate(state_folder(), addresses, utc_now()) if lan else None

    def joined(session: Session) -> None:
        click.echo(f"{session.name} has joined. For the next device:")
        _print_link(server, addresses, is_first=False)

    server = WebServer(engine, listener, certificate, joined, view)
    asyncio.run(server.run(partial(_print_start, server, addresses, certificate)))


def _print_start(
    server: WebServer, addresses: list[str], certificate: ServerCertificate | None
) -> None:
    if certificate is not None:
        click.echo("SHA-256 fingerprint of the certificate, which browsers do not know:")
        middle = len(certificate.fingerprint) // 2
        click.echo(f"  {certificate.fingerprint[:middle]}")
        click.echo(f"  {certificate.fingerprint[middle + 1 :]}")
    click.echo("Open this link; it works once, for one device:")
    _print_link(server, addresses, is_first=True)
    if certificate is None:
        click.echo("Only this machine can open it; --lan serves phones in the local network.")


def _print_link(server: WebServer, addresses: list[str], is_first: bool) -> None:
    from diffbotctl.web.link import page_link, qr_text

    scheme, port, code = server.origin.scheme, server.port, server.sessions.code
    for address in addresses:
        click.echo(f"  {page_link(scheme, address, port, code)}")
    # A phone cannot open the address of this machine's loopback.
    is_for_others = server.origin.scheme == "https"
    if sys.stdout.isatty() and is_for_others and (is_first or len(addresses) > 1):
        start, end = QR_COLOURS
        for line in qr_text(page_link(scheme, addresses[0], port, code)).splitlines():
            write_raw(sys.stdout, f"{start}{line}{end}\n")
    sys.stdout.flush()
