"""The control socket of a run: its server process, and the driver of its clients."""

from __future__ import annotations

import os
from typing import Any

from diffbotctl import __version__
from diffbotctl.config.configuration import Configuration
from diffbotctl.control_socket import process
from diffbotctl.control_socket.address import listen_on, remove_socket
from diffbotctl.control_socket.command_driver import ControlClientDriver
from diffbotctl.control_socket.engine_channel import EngineChannel
from diffbotctl.control_socket.run_state import RunInfo
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.drivers.input_leases import InputLeases
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.processes.child_process import wait_for_exit
from diffbotctl.recording.black_box_store import BlackBoxStore
from diffbotctl.render.map_scene import describe_scene
from diffbotctl.runs.build_graph import Assembly
from diffbotctl.runs.options import SocketOptions

EXIT_TIMEOUT_S = 1.5  # the server gives its clients half a second to read the rest


class RunControlSocket:
    """Engine side of the control socket. Raises RunError when it cannot be made.

    The `store` of the black box, if there is one, lives in the server process.
    """

    def __init__(
        self,
        options: SocketOptions,
        configuration: Configuration,
        assembly: Assembly,
        port: str,
        is_replay: bool = False,
        store: BlackBoxStore | None = None,
        is_paced: bool = True,
    ) -> None:
        listener, path = listen_on(options.name, configuration.name, options.group)
        robot = configuration.robot
        info = RunInfo(
            name=path.stem,
            version=__version__,
            pid=os.getpid(),
            pipeline=str(configuration.file.resolve()),
            robot=str(configuration.robot_file or ""),
            port=port,
            graph=assembly.graph,
            command=assembly.command,
            drivers={} if robot is None else _drivers(port),
            speed=None if robot is None else robot.limits.speed,
            turn_rate=None if robot is None else robot.limits.turn_rate,
            is_replay=is_replay,
            is_paced=is_paced,
            scene=_scene(configuration, assembly, port, is_replay),
            motion_inputs=frozenset(use.wire for use in configuration.inputs if use.feeds_motion),
            readers=frozenset(
                wire for use in configuration.programs for wire in use.wires.values()
            ),
        )
        shared = options.group is not None
        end, self.pid = process.start_server(listener, path, info, shared, store)
        self.path = path
        self.wires = len(assembly.graph.wires)
        self.channel = EngineChannel(end)

    def client_driver(
        self, operator: Operator, changes: LiveChanges, wakes: bool, inputs: InputLeases
    ) -> ControlClientDriver:
        return ControlClientDriver(self.channel, operator, changes, wakes, inputs)

    def end(self) -> None:
        """Wait EXIT_TIMEOUT_S for the server process to exit, then kill it."""
        remove_socket(self.path)
        wait_for_exit(self.pid, EXIT_TIMEOUT_S)


def _drivers(port: str) -> dict[str, type]:
    if port != "sim":
        return {}
    # Imported late: a run on a real port needs no plant.
    from diffbotctl.drivers.simulated_robot import SimulatedRobotDriver

    return {"robot": SimulatedRobotDriver}


def _scene(
    configuration: Configuration, assembly: Assembly, port: str, is_replay: bool
) -> dict[str, Any]:
    fields = describe_scene(configuration, assembly.graph, port)
    return {**fields, "simulated": "REPLAY"} if is_replay else fields
