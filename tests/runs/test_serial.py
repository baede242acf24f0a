"""The command line on a pseudo-terminal, with a fake of the book's board at the other end."""

import re
import signal

import pytest

from diffbotctl.messages import REACHED_UNSURE
from diffbotctl.processes.real_time import prefer
from tests.sampling import by_day
from tests.support.book_board import STOCK, BookBoardPort
from tests.support.command_process import command_line, start_in_pipe

STARTED = []


@pytest.fixture
def port():
    made = BookBoardPort()
    yield made
    while STARTED:  # what a test that failed left behind
        STARTED.pop().kill()
    made.close()


def start(port, *words):
    process = start_in_pipe(command_line("run", "goal", "--port", port.name, *STOCK, *words))
    prefer(process.pid)  # a host without a processor stops the robot
    STARTED.append(process)
    return process


def moving(board):
    return board.pwm["left"] > 60 and board.pwm["right"] > 60 and board.speed["left"] > 3


def stands(board):
    return board.pwm == {"left": 0, "right": 0} and abs(board.speed["left"]) < 0.1


def test_the_book_board_drives_to_its_goal_and_gets_left_and_right_together(port):
    process = start(port, "--goal", "0.2 0.1", "--for", "30s")
    out = process.communicate(timeout=60)[0]
    if "waits for `resume`" in out:  # a busy computer stopped it
        with port.changed:
            port.board.commands.clear()
        process = start(port, "--goal", "0.2 0.1", "--for", "30s")
        out = process.communicate(timeout=60)[0]
    # This board has no clock: on a busy computer the goal is reached, but unsure.
    assert process.returncode in (0, REACHED_UNSURE), out
    assert "1 of 1 reached" in out and "final stop confirmed" in out
    assert stands(port.board)
    wheels = [wheel for _, wheel, _ in port.board.commands]
    assert len(wheels) > 20
    assert wheels[::2] == ["left"] * len(wheels[::2])
    assert wheels[1::2] == ["right"] * len(wheels[1::2])


@pytest.mark.parametrize("number", by_day(1, [signal.SIGHUP, signal.SIGTERM, signal.SIGINT]))
def test_a_signal_ends_with_zero_commands_on_the_wire(port, number):
    process = start(port, "--goal", "30 0")
    port.wait_for(moving, 60)
    process.send_signal(number)
    out = process.communicate(timeout=60)[0]
    assert process.returncode == 130 and "final stop confirmed" in out
    last = [value for _, _, value in port.board.commands[-4:]]
    assert last == [0, 0, 0, 0]


def test_a_silent_link_stops_and_waits_for_resume(port):
    process = start(port, "--goal", "30 0")
    port.wait_for(moving, 60)
    with port.changed:
        port.cut = True
        before = len(port.board.commands)
        cut_at = port.board.now
    port.wait_for(lambda board: board.now > cut_at + 2.0, 60)
    port.cut = False
    port.wait_for(lambda board: len(board.commands) > before + 20, 60)
    first = [value for _, _, value in port.board.commands[before:]]
    assert set(first) == {0}  # a stop comes first, and nothing else before a person resumes
    process.terminate()
    out = process.communicate(timeout=60)[0]
    assert "telemetry_stale" in out and "resume" in out


def test_a_second_program_gets_the_name_of_the_port_s_user(port):
    process = start(port, "--goal", "30 0")
    port.wait_for(moving, 60)
    other = start(port, "--goal", "30 0").communicate(timeout=60)[0]
    process.terminate()
    process.communicate(timeout=60)
    assert re.search(r"in use by python\S* \(process \d+\)|in use by", other)
    assert "Traceback" not in other
