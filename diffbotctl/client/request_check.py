"""Which requests come from a page of this server: Host and Origin, checked on each.

Any web page in the operator's browser can send requests to this server, and any name can be made to
resolve to its address (DNS rebinding). Such requests name another origin or another host.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

SAME_SITE = ("same-origin", "none")  # Sec-Fetch-Site of a page's own requests, and of a typed link


class RequestRefusalError(Exception):
    """A request that is refused, with the status of the reply and the cause."""

    def __init__(self, status: int, cause: str) -> None:
        super().__init__(cause)
        self.status = status
        self.cause = cause


class ServerOrigin(NamedTuple):
    """What this server is called: `names` besides the address at which a connection came in."""

    scheme: str
    port: int
    names: Collection[str]

    def hosts(self, address: str) -> set[str]:
        """The values of Host that are right for a connection to the local `address`."""
        return {f"{name}:{self.port}" for name in (address, *self.names)}


def check_origin(
    origin: ServerOrigin, address: str, method: str, headers: Mapping[str, str]
) -> None:
    """Raise RequestRefusalError unless Host and Origin are this server's.

    `address` is the local address of the connection. A request that changes something, and the
    start of a web socket, must have an Origin.
    """
    host = headers.get("Host", "").lower()
    if host not in origin.hosts(address):
        raise RequestRefusalError(421, "this server is not called that; use the link it printed")
    sent = headers.get("Origin")
    is_plain_read = method == "GET" and headers.get("Upgrade") is None
    if sent is None and is_plain_read:
        _check_fetch_site(headers)
    elif sent != f"{origin.scheme}://{host}":
        raise RequestRefusalError(403, "the request does not come from this server's page")


def _check_fetch_site(headers: Mapping[str, str]) -> None:
    """Refuse other sites that read files of the page; a link to the page itself may be followed."""
    is_link = headers.get("Sec-Fetch-Mode") == "navigate"
    if headers.get("Sec-Fetch-Site", "none") not in SAME_SITE and not is_link:
        raise RequestRefusalError(403, "the request does not come from this server's page")
