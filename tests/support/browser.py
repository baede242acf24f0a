"""A headless Chromium, commanded through the pipe of its DevTools protocol.

Protocol: https://chromedevtools.github.io/devtools-protocol/. The browser reads commands from file
descriptor 3 and writes replies and events to 4, each JSON text ended by a zero byte.
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any, Self

REPLY_TIMEOUT_S = 60.0
POLL_PERIOD_S = 0.02
SPARE_FILE = 100  # file descriptors from here on are free
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--headless=new",
    "--remote-debugging-pipe",
    "--no-first-run",
    "--no-sandbox",  # the tests may run as root; they open only pages of their own
    "--disable-gpu",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics processor
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--disable-sync",
    "--mute-audio",
)
DESKTOP = (1280, 800)
PHONE = (390, 844)
PHONE_USER_AGENT = (
    "Mozilla/5.0 (Linux; Android 14; Pixel 8) AppleWebKit/537.36 (KHTML, like Gecko) "
    "Chrome/130.0.0.0 Mobile Safari/537.36"
)


def chromium() -> str | None:
    """The Chromium of this machine; None where there is none."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


class Browser:
    """A browser with its profile in `folder`. `arguments` are added to its command line."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        program = chromium()
        assert program is not None, "no chromium: run `make packages`"
        read_end, self.commands = os.pipe()
        self.replies, write_end = os.pipe()

        def pass_pipes() -> None:
            ends = [fcntl.fcntl(end, fcntl.F_DUPFD, SPARE_FILE) for end in (read_end, write_end)]
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)
            os.setpgid(0, 0)

        self.process = subprocess.Popen(
            [program, *ARGUMENTS, f"--user-data-dir={folder}", *arguments, "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            close_fds=False,
            preexec_fn=pass_pipes,
        )
        os.close(read_end)
        os.close(write_end)
        self.number = 0
        self.answers: dict[int, dict[str, Any]] = {}
        self.events: list[dict[str, Any]] = []
        self.news = threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def command(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """Send a command and wait for its result."""
        return self.result(self.send(method, session, **params), method)

    def send(self, method: str, session: str | None = None, **params: Any) -> int:
        """Send a command without waiting. Returns its number."""
        with self.news:
            self.number += 1
            number = self.number
        fields: dict[str, Any] = {"id": number, "method": method, "params": params}
        if session is not None:
            fields["sessionId"] = session
        os.write(self.commands, json.dumps(fields).encode() + b"\0")
        return number

    def result(self, number: int, method: str) -> dict[str, Any]:
        """The result of command `number`."""
        with self.news:
            came = self.news.wait_for(lambda: number in self.answers, REPLY_TIMEOUT_S)
            assert came, f"the browser did not answer {method}"
            answer = self.answers.pop(number)
        assert "error" not in answer, f"{method}: {answer['error']}"
        result: dict[str, Any] = answer["result"]
        return result

    def open_page(self, address: str = "about:blank", context: str | None = None) -> Page:
        """A new tab; `context` is a browser context with cookies of its own."""
        place = {} if context is None else {"browserContextId": context}
        target = self.command("Target.createTarget", url="about:blank", **place)["targetId"]
        attached = self.command("Target.attachToTarget", targetId=target, flatten=True)
        page = Page(self, attached["sessionId"], target)
        if address != "about:blank":
            page.open(address)
        return page

    def signal(self, number: int) -> None:
        """Send a signal to all processes of the browser."""
        os.killpg(self.process.pid, number)

    def close(self) -> None:
        """End the browser at once."""
        if self.process.poll() is None:
            self.signal(signal.SIGKILL)
        self.process.wait()
        os.close(self.commands)
        self.reader.join()
        os.close(self.replies)

    def _read(self) -> None:
        buffer = b""
        while data := os.read(self.replies, 1 << 16):
            *texts, buffer = (buffer + data).split(b"\0")
            with self.news:
                for text in texts:
                    fields = json.loads(text)
                    if "id" in fields:
                        self.answers[fields["id"]] = fields
                    else:
                        self.events.append(fields)
                self.news.notify_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Page:
    """A tab of `browser`."""

    def __init__(self, browser: Browser, session: str, target: str) -> None:
        self.browser, self.session, self.target = browser, session, target
        for domain in ("Page", "Runtime", "Network"):
            self.command(f"{domain}.enable")

    def command(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a command for this tab and wait for its result."""
        return self.browser.command(method, self.session, **params)

    def open(self, address: str) -> None:
        """Go to `address`."""
        self.command("Page.navigate", url=address)
        self.until("document.readyState === 'complete'")

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression; a promise is awaited."""
        reply = self.command(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in reply, f"{expression}: {reply['exceptionDetails']}"
        return reply["result"].get("value")

    def until(self, expression: str) -> Any:
        """Evaluate the expression until it is true; an exception, as while it loads, is not."""
        deadline = time.monotonic() + REPLY_TIMEOUT_S
        attempt = f"(() => {{ try {{ return ({expression}) }} catch {{ return false }} }})()"
        while not (value := self.evaluate(attempt)):
            if time.monotonic() > deadline:
                text = self.evaluate("document.body.innerText")
                raise AssertionError(f"never true: {expression}; the page shows: {text}")
            time.sleep(POLL_PERIOD_S)
        return value

    def emulate_phone(self, size: tuple[int, int] = PHONE) -> None:
        """A touch screen in portrait format, with a phone's name."""
        self.resize(size, is_phone=True)
        self.command("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)
        self.command("Emulation.setUserAgentOverride", userAgent=PHONE_USER_AGENT)

    def resize(self, size: tuple[int, int], is_phone: bool = False) -> None:
        """Give the page another size, in CSS pixels."""
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=size[0],
            height=size[1],
            deviceScaleFactor=2 if is_phone else 1,
            mobile=is_phone,
        )

    def prefer_dark(self, is_dark: bool) -> None:
        """Ask for dark or light colours."""
        scheme = {"name": "prefers-color-scheme", "value": "dark" if is_dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[scheme])

    def centre(self, selector: str) -> tuple[float, float]:
        """The middle of an element, in CSS pixels."""
        x, y = self.evaluate(
            f"(r => [r.x + r.width / 2, r.y + r.height / 2])"
            f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())"
        )
        return x, y

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """`touchStart`, `touchMove` with all fingers that are down, or `touchEnd` without any."""
        fingers = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self.command("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    def mouse(self, kind: str, place: tuple[float, float], button: str = "left") -> None:
        """`mousePressed`, `mouseMoved` or `mouseReleased`."""
        x, y = place
        self.command(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=1, clickCount=1
        )

    def click(self, selector: str) -> None:
        """Press and release the mouse on an element."""
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, self.centre(selector))

    def tap(self, selector: str) -> None:
        """Touch an element for a moment."""
        self.touch("touchStart", self.centre(selector))
        self.touch("touchEnd")

    def screenshot(self, path: Path) -> None:
        """Write what the page shows as PNG."""
        data = self.command("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))

    def addresses(self) -> list[str]:
        """Every address that this tab has requested, also by web sockets."""
        with self.browser.news:
            events = [each for each in self.browser.events if each.get("sessionId") == self.session]
        requests = [
            each["params"]["request"]["url"]
            for each in events
            if each["method"] == "Network.requestWillBeSent"
        ]
        sockets = [
            each["params"]["url"] for each in events if each["method"] == "Network.webSocketCreated"
        ]
        return requests + sockets
