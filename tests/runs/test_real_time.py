"""What stands for a machine of its own runs before other programs, where the system permits it."""

import os
import subprocess
import sys
import threading

from diffbotctl.config.load import load_robot
from diffbotctl.emulator.process import Emulator
from diffbotctl.emulator.virtual_board import virtual_board
from diffbotctl.processes.real_time import prefer

NORMAL = os.SCHED_OTHER
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
    with virtual_board(load_robot("book_2wd").robot, seed=1) as board, Emulator([]) as lockstep:
        assert policy(board.board.emulator.pid) == expected
        assert policy(lockstep.pid) == NORMAL
