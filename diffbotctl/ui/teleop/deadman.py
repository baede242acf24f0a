"""Dead-man logic of keyboard teleoperation: drive, release, and the detection of a lost terminal.

The terminal is asked for its cursor position and must answer. A dead ssh connection, a frozen
window or a suspended laptop sends no message, and does not answer either. A terminal multiplexer
answers in place of the terminal behind it, so inside one an answer proves nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from diffbotctl.ui.teleop.keyboard import KeyboardVelocity

CURSOR_QUERY = "\x1b[6n"  # DSR: report the cursor's position (ECMA-48)
QUERY_PERIOD_S = 0.08
REPLY_TIMEOUT_S = 0.28  # with QUERY_PERIOD_S and the delay to the wheels below half a second
SEND_PERIOD_S = 0.05  # the engine takes 0.3 s of silence for a lost operator
STALL_MIN_S = 0.15  # between two beats: this process was stopped; the engine detects that itself
FIRST_REPLY_TIMEOUT_S = 1.0  # long enough for ssh to the other side of the world


class TerminalHeartbeat:
    """Times are seconds of any one clock. Queries are answered in the order they were sent."""

    def __init__(self) -> None:
        self.pending: list[float] = []  # when each unanswered query was sent
        self.next_query = 0.0
        self.round_trip: float | None = None

    def is_due(self, now: float) -> bool:
        """True when a query is to be sent now; it is counted as sent."""
        if now < self.next_query:
            return False
        self.next_query = now + QUERY_PERIOD_S
        self.pending.append(now)
        return True

    def on_reply(self, now: float) -> None:
        if self.pending:
            self.round_trip = now - self.pending.pop(0)

    def is_lost(self, now: float) -> bool:
        """True when a query was not answered in time."""
        return bool(self.pending) and now - self.pending[0] > REPLY_TIMEOUT_S

    def extend(self, seconds: float) -> None:
        """Extend all deadlines: this process was stopped for so long."""
        self.pending = [time + seconds for time in self.pending]

    def reset(self) -> None:
        """Begin again, after a pause without queries."""
        self.pending.clear()
        self.next_query = 0.0


def multiplexer_name(environment: Mapping[str, str]) -> str:
    """The name of the multiplexer that this process runs in; empty when there is none."""
    if environment.get("TMUX"):
        return "tmux"
    return "screen" if environment.get("STY") else ""


class TeleopDeadman:
    """`send` sends a request without waiting, `query_terminal` sends CURSOR_QUERY.

    When the last key is released the robot stops at once, and one more query is sent: only a
    terminal that answers proves that the key was released and the connection not lost.
    """

    def __init__(
        self,
        keyboard: KeyboardVelocity,
        send: Callable[..., None],
        query_terminal: Callable[[], None],
        now: float,
    ) -> None:
        self.keyboard, self.send, self.query_terminal = keyboard, send, query_terminal
        self.heartbeat = TerminalHeartbeat()
        self.terminal_answers = False  # it has answered a query
        self.is_first_reply_late = False
        self.restart(now)
        self.is_driving = False  # the engine takes this client for the driver
        self.is_releasing = False  # commands zero, and waits for the last answer
        self.lost_cause = ""  # empty while the terminal is not lost

    def restart(self, now: float) -> None:
        """Wait for the first answer of the terminal from `now` on."""
        self.started = self.last_beat = now

    @property
    def is_unproven(self) -> bool:
        """True when commands are to stay, but this terminal never answered a query."""
        is_latched = self.keyboard.mode == "latched"
        return is_latched and self.is_first_reply_late and not self.terminal_answers

    def on_reply(self, now: float) -> None:
        self.terminal_answers = True
        self.heartbeat.on_reply(now)
        if self.is_releasing and not self.heartbeat.pending:
            self._release()

    def beat(self, now: float) -> None:
        """Send the command of `now`; to be called every SEND_PERIOD_S."""
        if now - self.last_beat > STALL_MIN_S:
            self.heartbeat.extend(now - self.last_beat)
        self.last_beat = now
        self.is_first_reply_late = now - self.started >= FIRST_REPLY_TIMEOUT_S
        if not self.terminal_answers and not self.is_first_reply_late:
            self._query(now)
        if self.keyboard.mode == "latched" and not self.terminal_answers:
            self.keyboard.release()  # nothing may stay in force that no terminal answers for
        velocity = self.keyboard.velocity(now)
        if velocity is None and not self.is_driving:
            return
        if self.terminal_answers and self._is_lost(now):
            self.lose("the terminal does not answer")
        elif velocity is not None:
            self._drive(*velocity)
        elif self.terminal_answers:
            self._stop(now)
        else:
            self._release()

    def release(self) -> None:
        """Release without a last query: the user asked for it."""
        self.keyboard.release()
        if self.is_driving:
            self._release()

    def lose(self, cause: str) -> None:
        """Report to the engine that the operator is lost."""
        if self.is_driving:
            self.send("operator_lost", reason=cause)
            self.lost_cause = cause
        self.on_refusal()

    def on_refusal(self) -> None:
        """The engine does not accept drive commands from this client."""
        self.keyboard.release()
        self._end_driving()

    def _drive(self, linear: float, angular: float) -> None:
        if not self.is_driving:
            self.heartbeat.reset()
            self.lost_cause = ""
        self.is_driving, self.is_releasing = True, False
        self.send("drive", linear=linear, angular=angular)

    def _stop(self, now: float) -> None:
        if not self.is_releasing:
            self.is_releasing = True
            self.heartbeat.next_query = now  # query at once
            self._query(now)
        self.send("drive", linear=0.0, angular=0.0)

    def _is_lost(self, now: float) -> bool:
        if self.is_driving and not self.is_releasing:
            self._query(now)
        return self.heartbeat.is_lost(now)

    def _query(self, now: float) -> None:
        if self.heartbeat.is_due(now):
            self.query_terminal()

    def _release(self) -> None:
        self.send("release")
        self._end_driving()

    def _end_driving(self) -> None:
        self.is_driving = self.is_releasing = False
        self.heartbeat.reset()
