"""Measures how long the instants of a run take, and reports what takes too long.

While a block computes, no telemetry is read and no command is sent. Times are wall-clock times;
what the operating system gave to other programs meanwhile (the thread's run delay) is counted
separately, so that a block is not blamed for a busy computer.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from diffbotctl.engine.driver import Delivery
from diffbotctl.messages import LogLine, Stop
from diffbotctl.time import MILLISECOND, SECOND

SCHEDSTAT = "/proc/thread-self/schedstat"  # time on a processor, time waiting for one, in ns
SCHEDSTAT_BYTES_MAX = 64
# Reactions longer than this part of the limit of an instant are added up.
SLOW_PART = 20
PAUSE = ""  # in the set of what has been warned of, beside names of blocks
OVERLOADED = (
    "an instant took {:.2f} s, for {:.2f} s of which the computer gave diffbotctl no processor; "
    "close other programs"
)
NOT_RUNNING = (
    "diffbotctl did not run for {:.2f} s: it was suspended, or the computer was overloaded"
)


class InstantLimits(NamedTuple):
    """Limits in ns.

    `budget`: of one reaction of a block, the period of the telemetry. `stop`: of one instant, half
    of the dead-man's time. `frozen`: of a late wake-up, the dead-man's time; None in a simulation,
    which waits for its engine.
    """

    budget: int
    stop: int
    frozen: int | None


def instant_limits(deadman: float, telemetry: float, is_real: bool) -> InstantLimits:
    """The limits for a board with this dead-man's time (s) and telemetry rate (Hz)."""
    time_to_stop = round(deadman * SECOND)
    return InstantLimits(
        round(SECOND / telemetry), time_to_stop // 2, time_to_stop if is_real else None
    )


class InstantMonitor:
    """Collects in `events` what the loop has to deliver at once: warnings, and latched stops.

    A block's first overrun of the budget is a warning with its name. Time that no single block took
    stops a robot only while `is_driving`; at rest the first such pause is a warning.
    """

    def __init__(
        self, limits: InstantLimits, is_driving: Callable[[], bool] = lambda: True
    ) -> None:
        self.limits = limits
        self.is_driving = is_driving
        self.events: list[Delivery] = []
        self.stops = False  # there is a stop among the events
        self._warned: set[str] = set()
        self._delay_before = self._spent_before = 0
        self._slow: dict[str, int] = {}  # ns that each slow block took since `begin`
        self._is_slowness_reported = False  # since `begin`
        self._schedstat: int | None = None
        with suppress(OSError):
            self._schedstat = os.open(SCHEDSTAT, os.O_RDONLY | os.O_CLOEXEC)

    def begin(self) -> None:
        """Called before each step."""
        self._delay_before = self._run_delay()
        self._spent_before = time.thread_time_ns()
        if self._slow:
            self._slow, self._is_slowness_reported = {}, False

    def take_events(self) -> list[Delivery]:
        events, self.events, self.stops = self.events, [], False
        return events

    def timed(self, name: str, react: Callable[..., Any]) -> Callable[..., Any]:
        """`react` of the block `name`, with its time checked."""
        clock, check = time.perf_counter_ns, self._check_reaction
        short = min(self.limits.budget, self.limits.stop // SLOW_PART)

        def timed_react(*arguments: Any) -> Any:
            begin = clock()
            output = react(*arguments)
            spent = clock() - begin
            if spent > short:
                check(name, spent)
            return output

        return timed_react

    def check_step(self, busy: int) -> None:
        """Check the time between two waits of the loop, which no single block accounts for."""
        if self.limits.frozen is None or busy <= self.limits.stop or self.stops:
            return
        if self._is_slowness_reported:
            return
        waited = self._run_delay() - self._delay_before
        spent = time.thread_time_ns() - self._spent_before
        if busy - waited <= self.limits.stop:
            self._pause("host_frozen", OVERLOADED.format(busy / SECOND, waited / SECOND))
        elif sum(self._slow.values()) > (busy - waited) // 2:
            self._pause("block_overrun", self._slow_blocks())
        elif (
            spent < (busy - waited) // 2
        ):  # nor did it compute: a signal has suspended it within an instant
            self._pause("host_frozen", NOT_RUNNING.format((busy - spent) / SECOND))
        else:
            cause = f"one instant of the engine took {busy / SECOND:.2f} s, with no slow block"
            self._pause("block_overrun", cause)

    def check_wake_up(self, late: int) -> None:
        if self.limits.frozen is not None and late > self.limits.frozen:
            self._pause("host_frozen", NOT_RUNNING.format(late / SECOND))

    def close(self) -> None:
        if self._schedstat is not None:
            os.close(self._schedstat)
            self._schedstat = None

    def _check_reaction(self, name: str, spent: int) -> None:
        waited = min(spent, self._run_delay() - self._delay_before)
        own, limits = spent - waited, self.limits
        if own > limits.budget and name not in self._warned:
            self._warned.add(name)
            self._warn(
                f"block {name} took {own / MILLISECOND:.0f} ms for one reaction; telemetry comes "
                f"every {limits.budget / MILLISECOND:.0f} ms and waits meanwhile. Above "
                f"{limits.stop / MILLISECOND:.0f} ms the robot is stopped"
            )
        if own > limits.stop:
            cause = (
                f"block {name} took {own / SECOND:.2f} s for one reaction; "
                f"{limits.stop / SECOND:.2f} s, half of the dead-man's time, is the limit"
            )
            self._stop("block_overrun", cause)
        elif spent > limits.stop and limits.frozen is not None:
            self._pause("host_frozen", OVERLOADED.format(spent / SECOND, waited / SECOND))
        self._slow[name] = self._slow.get(name, 0) + own
        if sum(self._slow.values()) > limits.stop and not self._is_slowness_reported:
            self._is_slowness_reported = True
            if not self.stops:
                self._pause("block_overrun", self._slow_blocks())

    def _slow_blocks(self) -> str:
        """The cause of a stop: the blocks that took the time between two waits of the loop."""
        slowest = sorted(self._slow.items(), key=lambda item: -item[1])
        blocks = ", ".join(f"{name} {spent / SECOND:.2f} s" for name, spent in slowest[:3])
        return (
            f"the blocks took {sum(self._slow.values()) / SECOND:.2f} s together ({blocks}) "
            f"while no command could be sent; {self.limits.stop / SECOND:.2f} s, half of the "
            "dead-man's time, is the limit"
        )

    def _pause(self, code: str, cause: str) -> None:
        """Stop a robot that drives; at rest no command was late."""
        if self.is_driving():
            self._stop(code, cause)
        elif PAUSE not in self._warned:
            self._warned.add(PAUSE)
            self._warn(f"{cause}. The robot stood meanwhile")

    def _warn(self, text: str) -> None:
        self.events.append(Delivery("operator.log", LogLine(0, "warning", "engine", text)))

    def _stop(self, code: str, cause: str) -> None:
        self.stops = True
        self.events.append(Delivery("operator.halt", Stop(0, code, cause, True)))

    def _run_delay(self) -> int:
        """Time in ns for which this thread has waited for a processor; 0 where it is not known."""
        if self._schedstat is None:
            return 0
        return int(os.pread(self._schedstat, SCHEDSTAT_BYTES_MAX, 0).split()[1])
