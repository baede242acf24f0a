"""Another computer for tests: an ssh server that runs what its clients ask, here.

`python -m tests.support.far_host FOLDER HOST ADDRESS` serves until it is ended; `far_host`
starts it and an `ssh` that reaches it as HOST, with a key made for this folder.
"""

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import asyncssh

START_TIMEOUT_S = 60
CONFIG = """
Host {host}
  HostName {address}
  Port {port}
  User tester
  IdentityFile {folder}/key
  IdentitiesOnly yes
  StrictHostKeyChecking no
  UserKnownHostsFile {folder}/known_hosts
  LogLevel ERROR
"""


async def serve_one(client: Any) -> None:
    """One session: the command that the client asks for, with its own input and output."""
    command = await asyncio.create_subprocess_shell(
        client.command, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    feeding = asyncio.create_task(_feed(client, command.stdin))
    while data := await command.stdout.read(1 << 16):  # type: ignore[union-attr]
        client.stdout.write(data)
        await client.stdout.drain()
    client.exit(await command.wait())
    feeding.cancel()


async def _feed(client: Any, stdin: Any) -> None:
    """What the client sends, until it ends."""
    with suppress(asyncssh.Error, OSError):
        while data := await client.stdin.read(1 << 16):
            stdin.write(data)
            await stdin.drain()
    stdin.close()


async def serve(folder: Path, host: str, address: str) -> None:
    """For ever."""
    key = asyncssh.generate_private_key("ssh-ed25519")
    listener = await asyncssh.create_server(
        asyncssh.SSHServer,
        address,
        0,
        server_host_keys=[key],
        authorized_client_keys=str(folder / "key.pub"),
        process_factory=serve_one,
        encoding=None,
    )
    port = listener.sockets[0].getsockname()[1]
    draft = folder / "ssh_config.new"
    draft.write_text(CONFIG.format(port=port, folder=folder, host=host, address=address))
    draft.replace(folder / "ssh_config")
    await asyncio.Event().wait()


def start_server(
    folder: Path, runtime: Path, host: str, address: str, prefix: Sequence[str] = ()
) -> subprocess.Popen[bytes]:
    """The server as a process of the command `prefix`, with a key of its own in `folder`.

    Engines of `runtime` are those of that computer.
    """
    folder.mkdir()
    key = asyncssh.generate_private_key("ssh-ed25519")
    key.write_private_key(folder / "key")
    (folder / "key").chmod(0o600)
    key.write_public_key(folder / "key.pub")
    words = ["-m", "tests.support.far_host", str(folder), host, address]
    return subprocess.Popen(
        [*prefix, sys.executable, *words], env={**os.environ, "XDG_RUNTIME_DIR": str(runtime)}
    )


def ssh_path(folder: Path, servers: dict[Path, subprocess.Popen[bytes]]) -> str:
    """The PATH on which `ssh HOST` reaches the servers, which map their folders to processes."""
    deadline = time.monotonic() + START_TIMEOUT_S
    configuration = ""
    for place, server in servers.items():
        while not (place / "ssh_config").exists():
            assert time.monotonic() < deadline and server.poll() is None, "no ssh server"
            time.sleep(0.02)
        configuration += (place / "ssh_config").read_text()
    (folder / "all_hosts").write_text(configuration)
    ssh = folder / "ssh"
    ssh.write_text(f'#!/bin/sh\nexec /usr/bin/ssh -F {folder}/all_hosts "$@"\n')
    ssh.chmod(0o755)
    return f"{folder}{os.pathsep}{os.environ['PATH']}"


@contextmanager
def far_host(folder: Path, runtime: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """The server's process, and the PATH on which `ssh robot` reaches it.

    Engines of `runtime` are those of that computer.
    """
    server = start_server(folder, runtime, "robot", "127.0.0.1")
    try:
        yield server, ssh_path(folder, {folder: server})
    finally:
        server.kill()
        server.wait()


if __name__ == "__main__":
    asyncio.run(serve(Path(sys.argv[1]), *sys.argv[2:]))
