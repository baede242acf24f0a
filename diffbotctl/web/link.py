"""The link to the page as the terminal shows it: addresses of this machine, link and QR code."""

from __future__ import annotations

import fcntl
import io
import socket
import struct

import segno

LOOPBACK = "127.0.0.1"
EVERY_ADDRESS = "0.0.0.0"
SIOCGIFADDR = 0x8915  # netdevice(7): the address of an interface
INTERFACE = struct.Struct("16s24x")
ADDRESS_OFFSET = 20  # of sin_addr in the reply: ifr_name[16], sin_family, sin_port
QR_BORDER = 2  # light modules around it


def network_addresses() -> list[str]:
    """The IPv4 address of each interface except the loopback, in the order of the interfaces."""
    addresses = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            try:
                reply = fcntl.ioctl(probe, SIOCGIFADDR, INTERFACE.pack(name.encode()[:15]))
            except OSError:
                continue  # this interface has no address
            address = socket.inet_ntoa(reply[ADDRESS_OFFSET : ADDRESS_OFFSET + 4])
            if not address.startswith("127."):
                addresses.append(address)
    return addresses


def host_names() -> set[str]:
    """The names of this machine in its network."""
    name = socket.gethostname().lower()
    return {name, f"{name}.local"}


def page_link(scheme: str, address: str, port: int, code: str) -> str:
    """The link with the code in its fragment, which browsers keep out of requests and logs."""
    return f"{scheme}://{address}:{port}/#{code}"


def qr_text(link: str) -> str:
    """The QR code of a link in half blocks: dark modules are spaces on a dark terminal."""
    out = io.StringIO()
    segno.make(link, error="l", micro=False).terminal(out, border=QR_BORDER, compact=True)
    return out.getvalue()
