"""Repeat a test that failed while the computer stood still; say so at the end.

Tests with an emulated board run in real time. A computer that gives its programs no processor for a
tenth of a second (another virtual machine has it) stops the emulated robot, as it should: such a
failure shows nothing about the program. A process of its own measures how late it is woken up, and
an engine states that it was not run, or that who drives it was not: beside processes that compute,
one that sleeps is woken up in time, and the others wait. Nothing is repeated that failed without a
stall, and what fails again has failed.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _pytest.runner import runtestprotocol

STALL_MIN = 0.1  # s; the engine stops the robot when it did not run for 0.15 s
REPEATS = 2
# Codes of the stops of an engine that was not run for 0.15 s, or whose driver was not for 0.3 s.
LATE = ("host_frozen", "operator_lost")
PROPERTY = "repeated"
WATCH = f"""
import select, sys, time
before = time.monotonic()
print(before, 0.0, flush=True)
while not select.select([sys.stdin], [], [], 0.02)[0]:
    now = time.monotonic()
    if now - before > {STALL_MIN} + 0.02:
        print(now, now - before - 0.02, flush=True)
    before = now
"""


class StalledComputer:
    """When the computer stood still, and the tests that are repeated for it (a pytest plugin)."""

    def __init__(self) -> None:
        self.log = Path(tempfile.mkstemp(prefix="diffbotctl-stalls-")[1])
        with self.log.open("w", encoding="ascii") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-c", WATCH], stdin=subprocess.PIPE, stdout=output
            )

    def longest_since(self, begin: float) -> float:
        """The longest stall, in s, that ended after `begin` (s, monotonic clock)."""
        text = self.log.read_text(encoding="ascii")
        lines = text[: text.rfind("\n") + 1].splitlines()  # the last one may be half written
        stalls = [tuple(map(float, line.split())) for line in lines]
        return max((seconds for end, seconds in stalls if end >= begin), default=0.0)

    def pytest_runtest_protocol(self, item, nextitem):
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        stalls = []
        for repeats_left in reversed(range(REPEATS + 1)):
            begin = time.monotonic()
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            failures = [report for report in reports if report.failed]
            stall = self.longest_since(begin)
            text = "".join(report.longreprtext for report in failures)
            late = [code for code in LATE if code in text]
            if not failures or not repeats_left or not (stall or late):
                break
            how = f"the computer stood still for {stall:.2f} s" if stall else f"failed by {late[0]}"
            stalls.append(f"{item.nodeid}: {how}")
            item._initrequest()
        reports[0].user_properties += [(PROPERTY, line) for line in stalls]
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def pytest_terminal_summary(self, terminalreporter):
        reports = [report for each in terminalreporter.stats.values() for report in each]
        lines = [
            line
            for report in reports
            for name, line in getattr(report, "user_properties", ())
            if name == PROPERTY
        ]
        if lines:
            terminalreporter.section("repeated tests")
            terminalreporter.write_line("\n".join(dict.fromkeys(lines)))

    def pytest_unconfigure(self):
        self.process.communicate()
        self.log.unlink()
