"""What stands for a machine of its own runs before other programs, where the system permits it."""

import os
import subprocess
import sys
import threading
from pathlib import Path

from diffbotctl.config.load import load_robot
from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.virtual_board import virtual_board
from diffbotctl.processes.real_time import (
    BOARD_PRIORITY,
    ENGINE_PRIORITY,
    prefer,
    preferred_engine,
)
from tests.support.running import PlainClient, running
from tests.support.virtual_board import board

NORMAL = os.SCHED_OTHER
ROOT = Path(__file__).parents[2]
UNPRIVILEGED = """
import os, resource
from diffbotctl.processes import real_time
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if not os.getuid():
    os.setuid(65534)
niceness = os.nice(3)
with real_time.preferred_engine():
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    print(policy, os.getpriority(os.PRIO_PROCESS, 0) - niceness)
"""
POLICY = "import os; print(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)"


def policy(process=0):
    return os.sched_getscheduler(process) & ~os.SCHED_RESET_ON_FORK


def in_a_thread(work):
    """The result of `work`, called in a thread of its own."""
    results = []
    thread = threading.Thread(target=lambda: results.append(work()))
    thread.start()
    thread.join()
    return results[0]


def test_a_thread_is_preferred_without_the_programs_that_it_starts():
    def work():
        permitted = prefer()
        child = subprocess.run([sys.executable, "-c", POLICY], capture_output=True, check=True)
        return permitted, policy(), int(child.stdout)

    permitted, own, of_child = in_a_thread(work)
    assert own == (os.SCHED_RR if permitted else NORMAL)
    assert of_child == policy() == NORMAL


def test_a_board_that_keeps_pace_is_preferred_and_one_in_lockstep_is_not():
    expected = os.SCHED_RR if in_a_thread(prefer) else NORMAL
    with virtual_board(load_robot("book_2wd").robot, seed=1) as virtual, Emulator([]) as lockstep:
        assert policy(virtual.board.emulator.pid) == expected
        assert policy(lockstep.pid) == NORMAL


def test_an_engine_is_preferred_while_it_runs_and_boards_precede_it():
    def work():
        with preferred_engine():
            return policy(), os.sched_getparam(0).sched_priority

    expected = (os.SCHED_RR, ENGINE_PRIORITY) if in_a_thread(prefer) else (NORMAL, 0)
    assert in_a_thread(work) == expected
    assert ENGINE_PRIORITY < BOARD_PRIORITY
    assert in_a_thread(lambda: (in_a_thread(work), policy()))[1] == NORMAL


def test_an_engine_without_the_permission_runs_at_its_niceness():
    words = [sys.executable, "-c", UNPRIVILEGED]
    shown = subprocess.run(words, capture_output=True, check=True, text=True, cwd=ROOT)
    assert shown.stdout.split() == [str(NORMAL), "0"]


def test_a_run_on_a_port_is_preferred_and_a_simulated_one_is_not(tmp_path):
    expected = os.SCHED_RR if in_a_thread(prefer) else NORMAL
    with board() as virtual:
        assert policy_of_a_run(tmp_path, "--port", virtual.usb) == expected
    assert policy_of_a_run(tmp_path) == NORMAL


def policy_of_a_run(folder, *words):
    with running(folder, "standby", "--robot", "book_2wd", "--stay", *words, sets=()) as process:
        client = PlainClient(folder)
        client.until(lambda status: status["time"] > 0)
        return policy(process.pid)
