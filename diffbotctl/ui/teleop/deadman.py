"""Whether the person's terminal is still there: it is asked for its cursor and must answer.

A dead ssh, a frozen window, a laptop asleep send no word; they also answer no question. A terminal
multiplexer answers in place of the terminal behind it, so that inside one this proves nothing.

A hand's wishes as words to the engine: driving, letting go, and being lost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from diffbotctl.ui.teleop.keyboard import KeyboardVelocity

CURSOR_QUERY = "\x1b[6n"  # DSR: report the cursor's position (ECMA-48)
QUERY_PERIOD_S = 0.08  # s between two questions
REPLY_TIMEOUT_S = 0.28  # s; with PERIOD and the way to the wheels it stays below half a second


class TerminalHeartbeat:
    """Times are seconds of any one clock. Questions are answered in the order they were asked."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.next = 0.0
        self.round_trip: float | None = None

    def is_due(self, now: float) -> bool:
        """True when a question is to be asked now; it is noted as asked."""
        if now < self.next:
            return False
        self.next = now + QUERY_PERIOD_S
        self.asked.append(now)
        return True

    def answered(self, now: float) -> None:
        """The terminal answered the oldest question."""
        if self.asked:
            self.round_trip = now - self.asked.pop(0)

    def is_lost(self, now: float) -> bool:
        """True when a question has waited too long."""
        return bool(self.asked) and now - self.asked[0] > REPLY_TIMEOUT_S

    def excuse(self, seconds: float) -> None:
        """We ourselves did not look for so long: that is not the terminal's fault."""
        self.asked = [time + seconds for time in self.asked]

    def forget(self) -> None:
        """Begin anew, as after a pause in which nothing was asked."""
        self.asked.clear()
        self.next = 0.0


def multiplexer_name(environment: Mapping[str, str]) -> str:
    """The name of the multiplexer that this runs inside of; empty when there is none."""
    if environment.get("TMUX"):
        return "tmux"
    return "screen" if environment.get("STY") else ""


SEND_PERIOD_S = 0.05  # s; the engine takes 0.3 s of silence for a lost operator
STALL_MIN_S = 0.15  # s between two beats: this process stood still; the engine minds that by itself
FIRST_REPLY_TIMEOUT_S = (
    1.0  # s for a terminal to answer at all; ssh to the other side of the world does
)


class TeleopDeadman:
    """`say` sends a request without waiting, `question` asks the terminal to answer.

    Whoever lets go is asked once more: the robot stands at once, but only a terminal that answers
    proves that the person let go and was not cut off.
    """

    def __init__(
        self,
        hand: KeyboardVelocity,
        say: Callable[..., None],
        question: Callable[[], None],
        now: float,
    ) -> None:
        self.hand, self.say, self.question = hand, say, question
        self.pulse = TerminalHeartbeat()
        self.answers = False  # whether this terminal answers questions
        self.since = now
        self.beaten = now  # when `beat` was called last
        self.waited = False  # long enough for a first answer
        self.drives = False  # the engine takes us for the driver
        self.ending = False  # standing, and waiting for the last answer
        self.lost = ""  # why the person was lost; empty while nobody is

    @property
    def is_unproven(self) -> bool:
        """True when commands are to stay, but this terminal never answered a question."""
        return self.hand.mode == "latched" and self.waited and not self.answers

    def answered(self, now: float) -> None:
        """The terminal answered a question."""
        self.answers = True
        self.pulse.answered(now)
        if self.ending and not self.pulse.asked:
            self._release()

    def beat(self, now: float) -> None:
        """Say what is to be said at `now`; call it every PERIOD_OF_WORDS."""
        if now - self.beaten > STALL_MIN_S:
            self.pulse.excuse(now - self.beaten)
        self.beaten = now
        self.waited = now - self.since >= FIRST_REPLY_TIMEOUT_S
        if not self.answers and not self.waited:
            self._ask(now)
        if self.hand.mode == "latched" and not self.answers:
            self.hand.let_go()  # nothing may stay in force that nobody answers for
        wanted = self.hand.wanted(now)
        if wanted is None and not self.drives:
            return
        if self.answers and self._is_lost(now):
            self.lose("the terminal does not answer")
        elif wanted is not None:
            self._drive(*wanted)
        elif self.answers:
            self._stand(now)
        else:
            self._release()

    def release(self) -> None:
        """Let go in good order, without a last question: the person asked for it."""
        self.hand.let_go()
        if self.drives:
            self._release()

    def lose(self, why: str) -> None:
        """Say that whoever drove is out of reach."""
        self.hand.let_go()
        if self.drives:
            self.say(do="lost", why=why)
            self.lost = why
        self.drives = self.ending = False
        self.pulse.forget()

    def refused(self) -> None:
        """The engine does not let us drive."""
        self.hand.let_go()
        self.drives = self.ending = False
        self.pulse.forget()

    def _drive(self, linear: float, angular: float, **fields: Any) -> None:
        if not self.drives:
            self.pulse.forget()
            self.lost = ""
        self.drives, self.ending = True, False
        self.say(do="drive", linear=linear, angular=angular, **fields)

    def _stand(self, now: float) -> None:
        if not self.ending:
            self.ending = True
            self.pulse.next = now  # ask at once
            self._ask(now)
        self.say(do="drive", linear=0.0, angular=0.0)

    def _is_lost(self, now: float) -> bool:
        if self.drives and not self.ending:
            self._ask(now)
        return self.pulse.is_lost(now)

    def _ask(self, now: float) -> None:
        if self.pulse.is_due(now):
            self.question()

    def _release(self) -> None:
        self.say(do="release")
        self.drives = self.ending = False
        self.pulse.forget()
