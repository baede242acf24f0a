"""Operators whose terminal is lost while driving: killed, frozen, disconnected, over ssh."""

import signal

from diffbotctl.control_socket.command_driver import DRIVE_TIMEOUT
from tests.sampling import each_once
from tests.support.lost_terminal import drive, last_command_and_motion, lose, ssh_server
from tests.support.running import PlainClient, command, moves, running, stands
from tests.support.terminal import SCREEN_TIMEOUT_S, Terminal


@each_once(mode=["hold", "latched"], how=["SIGKILL", "SIGSTOP", "closed"], way=["here", "ssh"])
def test_the_robot_stops_and_the_goal_waits(tmp_path, mode, how, way):
    path = tmp_path / "lost.mcap"
    words = ["teleop", "--mode", mode]
    with running(tmp_path, "goal", "--stay", "--goal", "30 0", "--record", str(path)) as process:
        watcher = PlainClient(tmp_path)
        watcher.until(moves)
        line, environment = command(tmp_path, *words)
        with (
            ssh_server(tmp_path, *words) as ssh,
            Terminal(ssh if way == "ssh" else line, environment) as terminal,
        ):
            terminal.until(lambda text: "pose" in text, "the first picture")
            drive(terminal, watcher, mode)
            lose(terminal, how)
            held = watcher.until(lambda status: status["held"])["held"]
            assert held["code"] == "operator_lost"
            assert "teleop" in held["cause"] and "was driving" in held["cause"]
            stood = watcher.until(stands)
            assert stood["operator.goal"]["number"] == 0
            terminal.process.send_signal(signal.SIGCONT)
            if how == "closed" and way == "here":
                terminal.process.wait(
                    timeout=SCREEN_TIMEOUT_S
                )  # nothing is left behind a closed window
        assert watcher.request("resume")["ok"]
        assert watcher.until(moves)["operator.goal"]["x"] == 30.0
        process.terminate()
        process.wait(timeout=SCREEN_TIMEOUT_S)
    command_at, motion_at = last_command_and_motion(path, stood["time"])
    assert command_at > 0 and motion_at <= command_at + DRIVE_TIMEOUT
