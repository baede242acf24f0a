"""The driver of the clients, on a channel of its own, in logical time."""

import pickle
import socket

import pytest

from diffbotctl.control_socket.command_driver import DRIVE_TIMEOUT, ControlClientDriver
from diffbotctl.control_socket.engine_channel import (
    ClientDisconnected,
    EngineChannel,
    EngineCommand,
    EngineUpdate,
    ResultCode,
)
from diffbotctl.control_socket.requests import (
    DriveRequest,
    GotoRequest,
    OperatorLostRequest,
    RearmRequest,
    ReleaseRequest,
    ResumeRequest,
)
from diffbotctl.drivers.goal_queue import Operator
from diffbotctl.engine.live_changes import LiveChanges
from diffbotctl.graph import Graph
from diffbotctl.messages import Goal, Stop
from diffbotctl.time import MILLISECOND as MS
from diffbotctl.time import NEVER


class Desk:
    """The server's end of the channel, and the driver at the engine's end."""

    def __init__(self, goals=()):
        ours, self.hub = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.ended = []
        self.operator = Operator(list(goals), lambda code, cause: self.ended.append(cause))
        changes = LiveChanges(Graph([], {}), {})
        self.person = ControlClientDriver(EngineChannel(ours), self.operator, changes, wakes=False)
        self.replies = {}

    def send(self, request, client=1, number=1):
        command = EngineCommand(number, client, "ann", request)
        self.hub.send(pickle.dumps(tuple(command)))

    def idle(self, now):
        """One idle time; the answers' codes."""
        self.person.idle(now)
        try:
            data = self.hub.recv(1 << 16, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return []
        return [result.code for result in EngineUpdate(*pickle.loads(data)).results]

    def instant(self, now):
        """What both drivers deliver at `now`, by wire; the gate's stops come back at once."""
        delivered = {}
        for driver in (self.operator, self.person):
            if driver.due() <= now:
                delivered.update({wire: message for wire, message in driver.deliver(now)})
        halt = delivered.get("operator.halt")
        if halt is not None:
            self.operator.stop_sink("gate.stop")(now, halt)
        if "operator.resume" in delivered:
            self.operator.stop_sink("gate.stop")(now, Stop(now, "", "", False))
        return delivered


def test_the_robot_is_stopped_exactly_when_the_lease_ends():
    desk = Desk()
    desk.send(DriveRequest(0.2, 0.0))
    assert desk.idle(1000 * MS) == [""]
    assert desk.instant(1000 * MS + 1)["operator.twist"].linear == 0.2
    assert desk.person.due() == 1000 * MS + DRIVE_TIMEOUT
    assert desk.instant(1000 * MS + DRIVE_TIMEOUT - 1) == {}
    delivered = desk.instant(1000 * MS + DRIVE_TIMEOUT)
    assert (delivered["operator.twist"].linear, delivered["operator.twist"].angular) == (0.0, 0.0)
    halt = delivered["operator.halt"]
    assert (halt.code, halt.latched) == ("operator_lost", True)
    assert halt.cause == "ann was driving and sent no command for 300 ms"
    assert desk.person.due() == NEVER


def test_each_command_renews_the_lease():
    desk = Desk()
    for step in range(10):
        desk.send(DriveRequest(0.2, 0.0))
        desk.idle(step * 200 * MS)
        assert "operator.halt" not in desk.instant(step * 200 * MS + 1)
    assert desk.person.due() == 9 * 200 * MS + DRIVE_TIMEOUT


def test_the_robot_is_stopped_when_the_driving_client_disconnects_and_no_other():
    desk = Desk()
    desk.send(DriveRequest(0.2, 0.0), client=1)
    desk.send(ClientDisconnected(), client=2)
    desk.idle(0)
    assert "operator.halt" not in desk.instant(1)
    desk.send(ClientDisconnected(), client=1)
    desk.idle(10)
    assert desk.instant(11)["operator.halt"].cause == "ann was driving and disconnected"


def test_a_dead_server_counts_as_a_lost_operator_only_while_a_client_drives():
    watched, driven = Desk(), Desk()
    driven.send(DriveRequest(0.2, 0.0))
    driven.idle(0)
    for desk in (watched, driven):
        desk.instant(1)
        desk.hub.close()
        desk.person.idle(10)
    assert watched.instant(11) == {}
    assert driven.instant(11)["operator.halt"].code == "operator_lost"


def test_a_loss_that_is_reported_after_resume_does_not_stop_the_robot_again():
    desk, report = Desk(), OperatorLostRequest("its terminal was closed")
    desk.send(DriveRequest(0.2, 0.0))
    desk.idle(0)
    desk.instant(1)
    assert desk.instant(DRIVE_TIMEOUT)["operator.halt"].code == "operator_lost"
    desk.send(report, number=2)
    desk.idle(DRIVE_TIMEOUT + 5)
    better = desk.instant(DRIVE_TIMEOUT + 6)["operator.halt"]
    assert better.cause == "ann was driving and its terminal was closed"
    desk.send(ResumeRequest(), client=2, number=3)
    desk.idle(DRIVE_TIMEOUT + 10)
    assert "operator.resume" in desk.instant(DRIVE_TIMEOUT + 11)
    desk.send(report, number=4)
    assert desk.idle(DRIVE_TIMEOUT + 20) == [""]
    assert "operator.halt" not in desk.instant(DRIVE_TIMEOUT + 21)
    desk.send(DriveRequest(0.0, 0.0), number=5)
    desk.send(DriveRequest(0.2, 0.0), number=6)
    desk.send(report, number=7)
    desk.idle(DRIVE_TIMEOUT + 30)
    assert desk.instant(DRIVE_TIMEOUT + 31)["operator.halt"].code == "operator_lost"


def test_a_goal_is_paused_until_resume_while_a_client_drives_and_after_it_is_lost():
    desk = Desk([Goal(0, 0, 1.0, 0.0)])
    assert desk.instant(1)["operator.goal"].number == 1
    desk.send(DriveRequest(0.2, 0.0))
    desk.idle(10)
    assert desk.instant(11)["operator.goal"].number == 0
    desk.instant(10 + DRIVE_TIMEOUT)
    desk.send(DriveRequest(0.2, 0.0))
    desk.send(ResumeRequest(), number=2)
    assert desk.idle(20 + DRIVE_TIMEOUT) == [ResultCode.STOPPED, ""]
    delivered = desk.instant(21 + DRIVE_TIMEOUT)
    assert delivered["operator.goal"].number == 1 and "operator.resume" in delivered


def expired(desk):
    """Client 1 drives and falls silent; then another client resumes. The time (ns)."""
    desk.send(DriveRequest(0.2, 0.0))
    desk.idle(0)
    for now in (1, DRIVE_TIMEOUT):
        desk.instant(now)
    desk.send(ResumeRequest(), client=2)
    assert desk.idle(1000 * MS) == [""]
    desk.instant(1000 * MS + 1)
    return 1001 * MS


def test_a_client_that_fell_silent_does_not_go_on_after_a_resume_of_another():
    desk = Desk()
    now = expired(desk)
    for step in range(20):
        desk.send(DriveRequest(0.2, 0.0))
        assert desk.idle(now + step * 250 * MS) == [ResultCode.EXPIRED]
        assert "operator.twist" not in desk.instant(now + step * 250 * MS + 1)
    desk.send(DriveRequest(0.2, 0.0), client=2)
    assert desk.idle(now + 5000 * MS) == [""]


@pytest.mark.parametrize(
    "afresh", [DriveRequest(0.0, 0.0), ReleaseRequest(), ResumeRequest(), None]
)
def test_a_client_that_fell_silent_may_begin_afresh(afresh):
    desk = Desk()
    now = expired(desk)
    desk.send(DriveRequest(0.2, 0.0))
    assert desk.idle(now) == [ResultCode.EXPIRED]
    if afresh is not None:
        desk.send(afresh)
        desk.idle(now + 10 * MS)
        desk.instant(now + 10 * MS + 1)
    desk.send(DriveRequest(0.2, 0.0))
    assert desk.idle(now + (20 * MS if afresh else DRIVE_TIMEOUT)) == [""]


def test_another_client_is_refused_unless_it_takes_over():
    desk = Desk()
    desk.send(DriveRequest(0.2, 0.0), client=1)
    desk.send(DriveRequest(0.1, 0.0), client=2)
    desk.send(ReleaseRequest(), client=2)
    assert desk.idle(0) == ["", ResultCode.BUSY, ResultCode.NOT_DRIVING]
    desk.send(DriveRequest(0.1, 0.0, take_over=True), client=2)
    desk.send(DriveRequest(0.2, 0.0), client=1)
    assert desk.idle(10) == ["", ResultCode.BUSY]
    assert desk.instant(11)["operator.twist"].linear == 0.1


def test_only_the_last_of_several_velocities_in_one_idle_time_counts():
    desk = Desk()
    for step in range(30):
        desk.send(DriveRequest(step / 100, 0.0))
    assert len(desk.idle(0)) == 16  # the rest waits for the next idle time
    assert desk.instant(1)["operator.twist"].linear == 0.15


def test_the_goal_of_a_client_does_not_end_the_run():
    from diffbotctl.messages import GoalState

    desk = Desk([Goal(0, 0, 1.0, 0.0)])
    desk.send(GotoRequest(0.5, 0.5, None))
    desk.idle(10)
    assert desk.instant(11)["operator.goal"].number == 2
    desk.operator.on_goal_state(20, GoalState(20, 2, "reached", 0.0, 0.0))
    desk.send(GotoRequest(0.5, 0.5, None))
    desk.idle(30)
    desk.instant(31)
    desk.operator.on_goal_state(40, GoalState(40, 3, "stuck", 0.0, 0.0, "a wall"))
    assert desk.ended == []


def lost_at(desk, now, client=1):
    """`client` drives, and reports at `now` that its operator is lost."""
    desk.send(DriveRequest(0.2, 0.0), client)
    desk.idle(now - 10 * MS)
    desk.instant(now - 9 * MS)
    desk.send(OperatorLostRequest("/teleop is silent"), client)
    assert desk.idle(now) == [""]
    desk.instant(now + 1)
    assert desk.operator.stops_in_force["gate.stop"].latched


def test_a_client_ends_the_stop_that_it_reported_and_the_goal_stays_paused():
    desk = Desk([Goal(0, 1, 1.0)])
    desk.instant(1)
    lost_at(desk, 1000 * MS)
    desk.send(RearmRequest())
    assert desk.idle(1010 * MS) == [""]
    delivered = desk.instant(1011 * MS)
    assert "operator.resume" in delivered and "operator.goal" not in delivered
    assert desk.operator.paused is not None and desk.operator.active is None
    desk.send(DriveRequest(0.1, 0.0))
    assert desk.idle(1020 * MS) == [""]


def test_a_client_cannot_end_the_stop_of_another_cause_or_of_another_client():
    desk = Desk()
    desk.send(RearmRequest())
    assert desk.idle(10 * MS) == [ResultCode.STOPPED]
    lost_at(desk, 1000 * MS)
    desk.send(RearmRequest(), client=2)
    assert desk.idle(1010 * MS) == [ResultCode.STOPPED]
    button = Stop(0, "stop_button", "the stop button is pressed", True)
    desk.operator.stop_sink("guard.stop")(1020 * MS, button)
    desk.send(RearmRequest())
    assert desk.idle(1030 * MS) == [ResultCode.STOPPED]


def test_a_stop_is_ended_by_its_client_once_only():
    desk = Desk()
    lost_at(desk, 1000 * MS)
    desk.send(RearmRequest())
    desk.send(RearmRequest())
    assert desk.idle(1010 * MS) == ["", ResultCode.STOPPED]
