"""A phone that drives from the page, and is lost: the time until the wheels are commanded zero."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from diffbotctl.processes.real_time import ENGINE_PRIORITY, prefer
from tests.support.browser import Browser, Page, chromium
from tests.support.page_server import PageServer, serving
from tests.support.running import PlainClient, moves, running, stands
from tests.support.tcp_relay import TcpRelay
from tests.support.trials.leftovers import processes_of
from tests.support.trials.row import NoData, Row
from tests.support.trials.section import drawn
from tests.support.wheel_watcher import WheelWatcher

WAIT_S = 60.0  # for what must come; a trial fails by itself afterwards
FINGER_LIFT_PX = 80.0
PRESSES_MAX, PRESS_TIMEOUT_S = 6, 10.0
STOP_TIME_MAX_S = 0.5  # from the loss to the zero command of the wheels


class Phone:
    """An emulated phone with the page open, behind a relay that can fall silent."""

    def __init__(self, folder: Path, server: PageServer) -> None:
        link = server.next_link()
        self.relay = TcpRelay(server.port)
        rule = f"MAP 127.0.0.1:{server.port} 127.0.0.1:{self.relay.port}"
        profile = tempfile.mkdtemp(dir=folder)
        self.browser = Browser(Path(profile), f"--host-resolver-rules={rule}")
        self.page: Page = self.browser.open_page()
        self.page.emulate_phone()
        self.page.open(link)
        self.page.until("document.body.dataset.connected === 'yes'")
        self.page.until("document.getElementById('role').textContent.includes('phone')")
        self.other = ""  # a second tab

    def press(self) -> None:
        """Put a finger on the joystick and push it forward."""
        x, y = self.page.centre("#pad")
        self.page.touch("touchStart", (x, y))
        self.page.touch("touchMove", (x, y - FINGER_LIFT_PX))

    def lift(self) -> None:
        """Lift the finger."""
        self.page.touch("touchEnd")

    def close(self) -> None:
        """End browser and relay."""
        self.relay.is_cut = False
        self.browser.close()
        self.relay.close()


def release(phone: Phone) -> None:
    """The finger is lifted."""
    phone.browser.send(
        "Input.dispatchTouchEvent", phone.page.session, type="touchEnd", touchPoints=[]
    )


def hide(phone: Phone) -> None:
    """Another tab comes to the front."""
    phone.browser.command("Target.createTarget", url="about:blank")


def blur(phone: Phone) -> None:
    """The window loses the focus."""
    phone.page.evaluate("void dispatchEvent(new Event('blur'))")


def freeze(phone: Phone) -> None:
    """The tab is frozen: no timer runs, and no event notifies the page."""
    busy = "const end = Date.now() + 3000; while (Date.now() < end);"
    phone.browser.send("Runtime.evaluate", phone.page.session, expression=busy)


def sleep(phone: Phone) -> None:
    """The phone sleeps: all processes of the browser are suspended."""
    phone.browser.signal(signal.SIGSTOP)


def cut(phone: Phone) -> None:
    """The phone leaves the Wi-Fi: nothing arrives, no connection is closed."""
    phone.relay.is_cut = True


def kill(phone: Phone) -> None:
    """The browser is killed."""
    phone.browser.signal(signal.SIGKILL)


def close_tab(phone: Phone) -> None:
    """The tab is closed."""
    phone.browser.send("Target.closeTarget", targetId=phone.page.target)


class Loss(NamedTuple):
    """A way to lose the phone, and part of the cause that the stop names; None: no stop."""

    do: Callable[[Phone], None]
    cause: str | None


LOSSES = {
    "released": Loss(release, None),
    "hidden": Loss(hide, "its page"),
    "blurred": Loss(blur, "its page lost the focus"),
    "closed": Loss(close_tab, "its page"),
    "frozen": Loss(freeze, "command"),
    "asleep": Loss(sleep, "command"),
    "out of Wi-Fi": Loss(cut, "command"),
    "killed": Loss(kill, ""),
}


class LossResult(NamedTuple):
    """Seconds from the loss to the command of zero, and the cause of the stop."""

    seconds: float
    cause: str


Station = tuple[PageServer, PlainClient, WheelWatcher]


@contextmanager
def station(folder: Path) -> Iterator[Station]:
    """A run that waits for a driver, the server of its page, and clients that watch.

    The robot's computer is not the phone, whose browser would take its processor here.
    """
    with running(folder, "standby", "--stay"), serving(folder) as server:
        for pid in processes_of(folder):
            prefer(pid, ENGINE_PRIORITY)
        yield server, PlainClient(folder), WheelWatcher(folder)


def _drive(phone: Phone, client: PlainClient, wheels: WheelWatcher) -> None:
    """Press until the wheels turn.

    A busy computer may lose the page at once, with a stop, or before it drives, when its finger
    must be lifted, too: then again.
    """
    for _ in range(PRESSES_MAX):
        phone.press()
        deadline = time.monotonic() + PRESS_TIMEOUT_S
        while time.monotonic() < deadline and not (status := client.request("status"))["held"]:
            if moves(status) and not wheels.is_zero:
                return
        phone.lift()
        client.until(stands)
        client.request("resume")
    raise AssertionError(f"no press drives; the status is {status}")


def lose_once(folder: Path, parts: Station, loss: Loss) -> LossResult:
    """Drive, lose the phone, and clean up."""
    server, client, wheels = parts
    phone = Phone(folder, server)
    try:
        _drive(phone, client, wheels)
        began = time.monotonic()
        loss.do(phone)
        seconds = wheels.wait(is_zero=True) - began
        status = client.request("status")
        if loss.cause is not None:
            status = client.until(lambda status: status["held"])
        held = status["held"]
        return LossResult(seconds, "" if held is None else held["cause"])
    finally:
        phone.close()
        client.request("resume")


def rows(seed: int, trials: int, kinds: int = len(LOSSES)) -> Iterator[Row]:
    """A row for each way to lose the phone."""
    if chromium() is None:
        yield NoData("a phone that drives is lost", "no Chromium", "`make packages`", True)
        return
    with tempfile.TemporaryDirectory(prefix="diffbotctl-") as name, station(Path(name)) as parts:
        for title, loss in drawn(LOSSES.items(), kinds, seed):
            results = [lose_once(Path(name), parts, loss) for _ in range(trials)]
            yield _row(title, loss, results)


def _row(title: str, loss: Loss, results: list[LossResult]) -> Row:
    good = sum(
        result.seconds <= STOP_TIME_MAX_S and (loss.cause is None or "phone" in result.cause)
        for result in results
    )
    slowest = max(result.seconds for result in results)
    named = "" if loss.cause is None else ", cause names the phone"
    figure = f"{good} of {len(results)}"
    if loss.cause:  # a busy computer may notice the silence first
        stated = sum(loss.cause in result.cause for result in results)
        figure += f" ({stated} '{loss.cause}')"
    return Row(
        f"phone that drives {title}: wheels 0{named}",
        f"{figure}, {slowest * 1e3:.0f} ms",
        f"all, {STOP_TIME_MAX_S * 1e3:.0f} ms",
        good == len(results),
    )
