"""Network namespaces joined by a wire in this process, with delay, loss and cut.

Each namespace has a TUN device with an address of its own, and nothing else. Packets between them
pass through a thread here. Needs root, as the creation of a namespace does.

`python -m tests.support.lossy_network ADDRESS DESCRIPTOR` makes the device in its own
namespace, sends it through a socket, and ends when the socket is closed.
"""

import heapq
import os
import random
import select
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress
from fcntl import ioctl

from tests.support.background import BackgroundDevice

TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
DEVICE = "wire"
PACKET_MAX_BYTES = 1 << 16
POLL_PERIOD_S = 0.02
IPV4_DESTINATION = slice(16, 20)
IPV4_BYTES_MIN = 20


def can_make_namespaces() -> bool:
    """Whether this process may create a namespace with its device, and run a program in it."""
    try:
        with LossyNetwork({"one": "10.77.0.1"}, 0.0, 0.0, 0) as network:
            return subprocess.run([*network.inside("one"), "true"]).returncode == 0
    except OSError:
        return False


class LossyNetwork(BackgroundDevice):
    """One namespace for each name in `addresses`, which maps it to its IPv4 address.

    A packet takes `delay` s, and the share `loss` of them is lost. Packets from and to the names in
    `cut` are lost, too.
    """

    def __init__(self, addresses: dict[str, str], delay: float, loss: float, seed: int) -> None:
        self.delay, self.loss = delay, loss
        self.random = random.Random(seed)
        self.cut: frozenset[str] = frozenset()
        self.holders: dict[str, subprocess.Popen[bytes]] = {}
        self.sockets: list[socket.socket] = []
        self.devices: dict[str, int] = {}
        self.names = {socket.inet_aton(address): name for name, address in addresses.items()}
        for name, address in addresses.items():
            self._make_namespace(name, address)
        self.begin()

    def _make_namespace(self, name: str, address: str) -> None:
        ours, theirs = socket.socketpair()
        self.holders[name] = subprocess.Popen(
            ["unshare", "--net", sys.executable, "-m", __name__, address, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stderr=subprocess.DEVNULL,
        )
        theirs.close()
        self.sockets.append(ours)
        _, devices, _, _ = socket.recv_fds(ours, 1, 1)
        if not devices:
            raise OSError("no network namespace can be made here")
        (device,) = devices
        os.set_blocking(device, False)
        self.devices[name] = device

    def inside(self, name: str) -> list[str]:
        """The words that run a command in the namespace called `name`."""
        return ["nsenter", "--target", str(self.holders[name].pid), "--net"]

    def live(self) -> None:
        """Pass packets on until the end."""
        sources = {device: name for name, device in self.devices.items()}
        # When it arrives, number, name of the target, packet.
        on_the_way: list[tuple[float, int, str, bytes]] = []
        count = 0
        while not self.over.is_set():
            wait = POLL_PERIOD_S
            if on_the_way:
                wait = min(max(on_the_way[0][0] - time.monotonic(), 0.0), wait)
            for device in select.select(list(sources), [], [], wait)[0]:
                packet = os.read(device, PACKET_MAX_BYTES)
                target = self._target(sources[device], packet)
                if target is not None:
                    count += 1
                    arrival = time.monotonic() + self.delay
                    heapq.heappush(on_the_way, (arrival, count, target, packet))
            while on_the_way and on_the_way[0][0] <= time.monotonic():
                _, _, target, packet = heapq.heappop(on_the_way)
                if target not in self.cut:
                    with suppress(OSError):  # the device's queue is full: lost, as on a real link
                        os.write(self.devices[target], packet)

    def _target(self, source: str, packet: bytes) -> str | None:
        """To whom a packet goes; None when it is lost or not IPv4."""
        if len(packet) < IPV4_BYTES_MIN or packet[0] >> 4 != 4:
            return None
        target = self.names.get(packet[IPV4_DESTINATION])
        if target is None or {source, target} & self.cut or self.random.random() < self.loss:
            return None
        return target

    def let_go(self) -> None:
        """End the namespaces, with all that still runs in them."""
        for each in self.sockets:
            each.close()
        for holder in self.holders.values():
            holder.wait()
        for device in self.devices.values():
            os.close(device)


def hold(address: str, descriptor: int) -> None:
    """Make the device of this namespace, send it, and wait for the end."""
    device = os.open("/dev/net/tun", os.O_RDWR)
    name = struct.pack("16sH22x", DEVICE.encode(), IFF_TUN | IFF_NO_PI)
    ioctl(device, TUNSETIFF, name)
    for words in (
        ["link", "set", "lo", "up"],
        ["address", "add", f"{address}/24", "dev", DEVICE],
        ["link", "set", DEVICE, "up"],
    ):
        subprocess.run(["ip", *words], check=True)
    with socket.socket(fileno=descriptor) as parent:
        socket.send_fds(parent, [b"."], [device])
        os.close(device)
        parent.recv(1)


if __name__ == "__main__":
    hold(sys.argv[1], int(sys.argv[2]))
