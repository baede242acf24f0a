"""`diffbotctl ros2`: a running engine as a node of ROS 2."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import click

from diffbotctl.cli.command import argument, command, option
from diffbotctl.cli.contradictions import exclusive
from diffbotctl.cli.engine_client import host
from diffbotctl.cli.options import ENGINE, ROBOT
from diffbotctl.errors import Problem, RunError

if TYPE_CHECKING:
    from diffbotctl.control_socket.address import EngineAddress
    from diffbotctl.ros2.find_python import RosPython


# After the first word of a command of ROS 2, such as `ros2 topic echo --once`, its options follow.
@command(
    "Drive",
    6,
    "Connect a running engine to ROS 2",
    context_settings={"allow_interspersed_args": False},
)
@exclusive("--socket", ("--engine",), "each names the engine")
@exclusive(
    "--check",
    ("--drive", "--engine", "--namespace", "--frame-prefix", "--peer", "--robot", "--socket"),
    "it starts no node",
)
def ros2(
    engine: str | None = ENGINE,
    socket: Path | None = option("Control socket of the engine, such as a forwarded one."),
    drive: bool = option("Let ROS nodes move the robot and set parameters."),
    check: bool = option("Report what is missing, and end."),
    python: str | None = option("Python that has rclpy; default: python3.", metavar="PATH"),
    namespace: str = option("Namespace of topics and services.", default="", metavar="NAME"),
    frame_prefix: str = option("Prefix of all frames.", default="", metavar="TEXT"),
    peers: tuple[str, ...] = option(
        "--peer", "Also find nodes of HOST. Repeatable.", metavar="HOST"
    ),
    robot: str | None = ROBOT,
    words: tuple[str, ...] = argument(""),
) -> int:
    """Connect a running engine to ROS 2: its messages, frames and services as a node.

    Without --drive nodes only watch, and may stop the robot. Only nodes of this computer are found,
    unless --peer names others. Ends with the run, or with Ctrl-C.
    """
    from diffbotctl.ros2.find_python import find_python, missing_problem

    if words:
        from diffbotctl.cli.other_words import ros_error

        raise ros_error(["ros2", *words]) or click.UsageError(f"unknown word '{words[0]}'")
    if host():
        raise click.UsageError(
            "--at: the node needs a control socket on this computer. Forward it with ssh -L, and "
            "name it with --socket (docs/ros2.md)"
        )
    found = find_python(python)
    if check:
        return _report(found, python)
    if not found.is_usable:
        from diffbotctl.errors import RunError

        raise RunError(missing_problem(found))
    address = _address(engine, socket)
    _warn(drive, peers, found)
    _start(found, address, drive, namespace, frame_prefix, peers, robot)
    return 0


def _report(python: RosPython, given: str | None) -> int:
    """Print what the bridge would use; 0 when it can run. `given`: the option --python."""
    from diffbotctl.ros2.find_python import OPTIONAL_MODULES, missing_problem, version_text

    click.echo(f"python      {python.path} ({version_text(python)})")
    click.echo(f"ROS 2       {python.distribution or 'not sourced'}")
    click.echo(f"middleware  {python.middleware or 'the default of this rclpy'}")
    for name, purpose in OPTIONAL_MODULES.items():
        if name in python.missing and "rclpy" not in python.missing:
            package = f"ros-{python.distribution or 'jazzy'}-{name.replace('_', '-')}"
            click.echo(f"missing     {name}: no {purpose}; sudo apt-get install {package}")
    if python.is_usable:
        option = "" if given is None else f" --python {shlex.quote(given)}"
        click.echo(f"the bridge can run: diffbotctl ros2{option}")
        return 0
    click.echo(missing_problem(python).render(), err=True)
    return 1


def _address(engine: str | None, socket: Path | None) -> EngineAddress:
    from diffbotctl.control_socket.address import EngineAddress
    from diffbotctl.control_socket.client import choose_engine

    if socket is not None:
        return EngineAddress(socket.stem, socket.absolute(), None)
    return choose_engine(engine)


def _warn(drive: bool, peers: tuple[str, ...], python: RosPython) -> None:
    if peers:
        may = "may drive the robot" if drive else "may watch and stop the robot"
        click.echo(
            f"warning: every program on {', '.join(peers)} {may}; ROS asks no password", err=True
        )
    if not drive:
        click.echo("watching only; --drive lets ROS nodes move the robot", err=True)
    if "tf2_msgs" in python.missing:
        click.echo("no /tf: tf2_msgs is missing; see diffbotctl ros2 --check", err=True)


def _explain_time(engine: str, drive: bool) -> None:
    """Raises RunError where nodes would drive a robot whose time they cannot keep up with."""
    if drive:
        cause = "its time does not follow the clock, so that no node can drive its robot"
        raise RunError(Problem("E-ROS2", engine, cause, "start the run without --fast"))
    click.echo("the time of this run is on /clock: give nodes use_sim_time:=true", err=True)


def _start(
    python: RosPython,
    address: EngineAddress,
    drive: bool,
    namespace: str,
    frame_prefix: str,
    peers: tuple[str, ...],
    robot: str | None,
) -> None:
    from diffbotctl.control_socket.client import ControlClient
    from diffbotctl.ros2.find_python import start_bridge
    from diffbotctl.ros2.options import BridgeOptions, encode_options
    from diffbotctl.ros2.robot_model import model_of_run

    client = ControlClient(address, "diffbotctl ros2")
    status = client.request("status")
    model, complaint = model_of_run(status, robot)
    client.close()
    is_paced = status.get("paced", True)  # an older engine has no such field
    if not is_paced:
        _explain_time(address.name, drive)
    if complaint:
        click.echo(f"{complaint}; name its file with --robot", err=True)
    options = BridgeOptions(
        address.name, str(address.socket), drive, namespace, frame_prefix, model
    )
    start_bridge(python, encode_options(options), peers)
