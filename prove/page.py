"""The page in a browser: time to its first picture, size, load of its server, goals by a tap."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from math import ceil, hypot, inf, log
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, get_args

from diffbotctl.messages import GoalEnd
from diffbotctl.web.server import load_assets
from tests.support.browser import DESKTOP, Browser, Page, chromium
from tests.support.command_process import processor_s
from tests.support.page_server import PageServer, serving
from tests.support.running import PlainClient, running
from tests.support.trials.row import NoData, Row

OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
PHONE = "phone"
DEVICES = ("desktop", PHONE)
FIRST_PICTURE_MAX_S = 1.5
FIRST_MAX_KIB, TOTAL_MAX_KIB = 60, 240  # gzipped
SOLID_VIEW = {"robot_view.js", "urdf_model.js", "solid_shapes.js", "matrix4.js", "robot.urdf"}
SHARE_MAX = 0.06  # of a core
SCANNING = ("wander", "--robot", "turtlebot3_burger")  # its laser scanner measures five times a s
SETTLING_TIME_S = 3.0
SHOWN = "document.getElementById('facts').textContent.includes('pose')"
PAINTED = (  # the map is not empty: at least two colours
    "(c => new Set(new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height)"
    ".data.buffer)).size > 1)(document.getElementById('map'))"
)

ZOOM_STEP = 1.4  # of the keys of the page
SCALE_MIN, SCALE_MAX = 5.0, 5000.0  # px/m of its map
OFFSET_PX = (-40.0, 30.0)  # of the tap from the middle of the map, right and up
PLACE_ERROR_MAX_PX = 2.0
ARRIVAL_ERROR_MAX_M = 0.025  # the goal's tolerance, and the rest of a simulated robot's odometry
ARRIVAL_TIMEOUT_S = 180.0


def rows(opened: int, load_s: float = 20.0, taps: int = 100) -> Iterator[Row]:
    """All rows; the page is opened `opened` times on each device.

    Its load is measured for `load_s` seconds, and goals are tapped at most `taps` times.
    """
    yield from _sizes()
    if chromium() is None:
        yield NoData("the page in a browser", "no Chromium", "`make packages`", True)
        return
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="diffbotctl-")))
        browser = stack.enter_context(Browser(folder / "profile", OFFLINE))
        stack.enter_context(running(folder, *SCANNING, name="scan", sets=()))
        server = stack.enter_context(serving(folder, "--engine", "scan"))
        for device in DEVICES:
            yield from _first_pictures(browser, server, device, opened)
        yield _load(browser, server, load_s)
        stack.enter_context(running(folder, "standby", "--stay", name="floor"))
        server = stack.enter_context(serving(folder, "--engine", "floor"))
        client = PlainClient(folder, "floor")
        for device in DEVICES:  # a page must be in front, and no one else may drive
            with Browser(folder / device, OFFLINE) as alone:
                page = _open(alone, server, device)
                _presser(page, device)("#take")
                page.until("document.getElementById('role').textContent.includes('this page')")
                yield _goals(page, client, device, taps)


def _sizes() -> Iterator[Row]:
    sizes = {path[1:]: len(asset.data) for path, asset in load_assets().items() if path != "/"}
    first = sum(size for name, size in sizes.items() if name not in SOLID_VIEW)
    for what, size, limit in (
        ("before the robot is shown in 3-D", first, FIRST_MAX_KIB),
        ("everything", sum(sizes.values()), TOTAL_MAX_KIB),
    ):
        kib = size / 1024
        yield Row.at_most(f"page, gzipped, {what}", kib, limit, "KiB")


def _new_tab(browser: Browser, device: str) -> Page:
    """An empty tab of a device of its own: with cookies and a cache of its own."""
    context = browser.command("Target.createBrowserContext")["browserContextId"]
    page = browser.open_page(context=context)
    if device == PHONE:
        page.emulate_phone()
    else:
        page.resize(DESKTOP)
    return page


def _open(browser: Browser, server: PageServer, device: str) -> Page:
    page = _new_tab(browser, device)
    page.open(server.next_link())
    page.until(SHOWN)
    return page


def _first_pictures(
    browser: Browser, server: PageServer, device: str, opened: int
) -> Iterator[Row]:
    """From the address that is entered to the values and the map; what the page asked for."""
    times, addresses = [], set()
    for _ in range(opened):
        page = _new_tab(browser, device)
        link = server.next_link()
        began = time.monotonic()
        page.command("Page.navigate", url=link)
        page.until(f"{SHOWN} && {PAINTED}")
        times.append(time.monotonic() - began)
        addresses |= {each.partition("//")[2].partition("/")[0] for each in page.addresses()}
        browser.command("Target.closeTarget", targetId=page.target)
    yield Row(
        f"page, first picture, {device}, slowest of {opened}",
        f"{max(times):.2f} s, median {median(times):.2f} s",
        f"<= {FIRST_PICTURE_MAX_S:g} s",
        max(times) <= FIRST_PICTURE_MAX_S,
    )
    others = addresses - {f"127.0.0.1:{server.port}"}
    yield Row(
        f"page, other hosts that it asked, {device}, all names unknown",
        str(len(others)),
        "0",
        not others,
    )


def _load(browser: Browser, server: PageServer, load_s: float) -> Row:
    """The processor time of the server while a page shows a run with a scan."""
    page = _open(browser, server, "desktop")
    time.sleep(SETTLING_TIME_S)
    before, began = processor_s(server.process.pid), time.monotonic()
    time.sleep(load_s)
    share = (processor_s(server.process.pid) - before) / (time.monotonic() - began)
    browser.command("Target.closeTarget", targetId=page.target)
    return Row(
        "server of a page, 10 Hz, with a scan of 5 Hz",
        f"{share:.1%} of a core",
        f"<= {SHARE_MAX:.0%}",
        share <= SHARE_MAX,
    )


class GoalTap(NamedTuple):
    """A tap at a zoom. `place_error`: of the goal from what the screen showed there, in pixels;
    `arrival_error`: of the robot from the goal, m."""

    scale: float
    place_error: float
    arrival_error: float


def _presser(page: Page, device: str) -> Callable[[str], None]:
    """How a person presses a key of the page on this device."""
    return page.tap if device == PHONE else page.click


def _goals(page: Page, client: PlainClient, device: str, most: int) -> Row:
    """A tap beside the middle of the map, at the first steps of its zoom."""
    press = _presser(page, device)
    press("#view-map")
    steps = ceil(log(SCALE_MAX / SCALE_MIN, ZOOM_STEP))
    for _ in range(steps):  # to the end of the zoom, wherever it began
        press("#zoom-in")
    taps, scale = [], SCALE_MAX
    for step in range(min(steps + 1, most)):
        if step:
            press("#zoom-out")
            scale = max(scale / ZOOM_STEP, SCALE_MIN)
        first = _set_goal(page, client, device, press, (0.0, 0.0))
        goal = _set_goal(page, client, device, press, OFFSET_PX)
        error = hypot(
            (goal["x"] - first["x"]) * scale - OFFSET_PX[0],
            (goal["y"] - first["y"]) * scale - OFFSET_PX[1],
        )
        taps.append(GoalTap(scale, error, _arrival_error(client, goal)))
    good = sum(
        tap.place_error <= PLACE_ERROR_MAX_PX and tap.arrival_error <= ARRIVAL_ERROR_MAX_M
        for tap in taps
    )
    farthest = max(tap.place_error for tap in taps)
    worst = max(tap.arrival_error for tap in taps)
    return Row(
        f"goal by a tap, {device}, {SCALE_MIN:g} to {SCALE_MAX:g} px/m: at the place, reached",
        f"{good} of {len(taps)}, {farthest:.1f} px, {worst * 1e3:.0f} mm",
        f"all, <= {PLACE_ERROR_MAX_PX:g} px, {ARRIVAL_ERROR_MAX_M * 1e3:.0f} mm",
        good == len(taps),
    )


def _set_goal(
    page: Page,
    client: PlainClient,
    device: str,
    press: Callable[[str], None],
    offset: tuple[float, float],
) -> dict[str, Any]:
    """Tap or click at an offset from the middle of the map; the goal that the engine then has."""
    before = client.request("status")["operator.goal"]
    x, y = page.centre("#map")
    place = (x + offset[0], y - offset[1])
    if device == PHONE:
        page.touch("touchStart", place)
        page.touch("touchEnd")
    else:
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, place)
    deadline = time.monotonic() + ARRIVAL_TIMEOUT_S
    while (goal := client.request("status")["operator.goal"]) in (None, before):
        if page.evaluate("document.getElementById('allow').open"):  # asked once a session
            press("#allow-yes")
        assert time.monotonic() < deadline, "the tap sets no goal"
    return dict(goal)


def _arrival_error(client: PlainClient, goal: dict[str, Any]) -> float:
    """Wait until the goal has ended; how far from it the robot is, m. Infinite if not reached."""
    deadline = time.monotonic() + ARRIVAL_TIMEOUT_S
    while time.monotonic() < deadline:
        state = client.request("status")["goal_state"]
        if state and state["number"] == goal["number"] and state["state"] in get_args(GoalEnd):
            if not state["state"].startswith("reached"):
                break
            pose = client.request("snapshot")["messages"]["odometry.odometry"]
            return hypot(pose["x"] - goal["x"], pose["y"] - goal["y"])
    return inf
