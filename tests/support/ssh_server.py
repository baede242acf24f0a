"""An ssh server for tests: `python -m tests.support.ssh_server FILE COMMAND...`.

Whoever connects gets COMMAND in a pseudo-terminal of its own. The port is written to FILE.
"""

import asyncio
import os
import struct
import sys
from fcntl import ioctl
from pathlib import Path
from termios import TIOCSCTTY, TIOCSWINSZ
from typing import Any

import asyncssh


class OpenServer(asyncssh.SSHServer):
    """Lets anybody of this machine in."""

    def begin_auth(self, username: str) -> bool:
        return False


async def serve_one(client: Any) -> None:
    """One session: a pseudo-terminal between the client and the command."""
    columns, lines, *_ = client.term_size
    master, slave = os.openpty()
    ioctl(master, TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
    command = await asyncio.create_subprocess_exec(
        *sys.argv[2:],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
        preexec_fn=lambda: ioctl(0, TIOCSCTTY, 0),
        env={**os.environ, "TERM": "xterm-256color"},
    )
    os.close(slave)
    loop = asyncio.get_running_loop()
    gone = asyncio.Event()

    def from_command() -> None:
        try:
            client.stdout.write(os.read(master, 1 << 16))
        except (OSError, BrokenPipeError):
            gone.set()

    loop.add_reader(master, from_command)
    typing = asyncio.create_task(_type(client, master))
    ended = asyncio.create_task(command.wait())
    await asyncio.wait(
        [typing, ended, asyncio.create_task(gone.wait())], return_when="FIRST_COMPLETED"
    )
    loop.remove_reader(master)
    os.close(master)  # the kernel hangs up
    client.exit(0)


async def _type(client: Any, master: int) -> None:
    """From the client's keys to the command, until the client is gone."""
    while True:
        try:
            data = await client.stdin.read(1 << 16)
        except (asyncssh.Error, ConnectionError):
            return
        if not data:
            return
        os.write(master, data)


async def serve() -> None:
    """For ever."""
    key = asyncssh.generate_private_key("ssh-ed25519")
    listener = await asyncssh.create_server(
        OpenServer, "127.0.0.1", 0, server_host_keys=[key], process_factory=serve_one, encoding=None
    )
    place = Path(sys.argv[1])
    place.with_suffix(".new").write_text(str(listener.sockets[0].getsockname()[1]))
    place.with_suffix(".new").replace(place)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve())
