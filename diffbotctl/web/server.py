"""The page's server: files, sessions and web sockets, for one running engine."""

from __future__ import annotations

import asyncio
import gzip
import socket
import time
from collections.abc import Callable
from importlib.resources import files
from typing import Any, NamedTuple

from aiohttp import web

from diffbotctl.client.connections import Peer, client_name, serving
from diffbotctl.client.request_check import RequestRefusalError, ServerOrigin, check_origin
from diffbotctl.control_socket.address import EngineAddress
from diffbotctl.control_socket.connection import TokenBucket
from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.errors import UserError
from diffbotctl.learn.learner_folder import lesson_in
from diffbotctl.ros2.robot_model import run_file, urdf_of_run
from diffbotctl.ui.saved_view import ViewSettings
from diffbotctl.web.certificate import ServerCertificate
from diffbotctl.web.deadman import BEAT_PERIOD_S, BeatNumbers
from diffbotctl.web.engine_feed import EngineFeed
from diffbotctl.web.link import EVERY_ADDRESS, LOOPBACK, host_names
from diffbotctl.web.page_connection import PageConnection
from diffbotctl.web.page_view import FILE_NAME, requested_view, view_record
from diffbotctl.web.sessions import Session, Sessions

USED_CODE = (
    "this code is not valid, or another device has used it; scan the newest code in the terminal, "
    "or open its link"
)
NO_SESSION = "this device has no session; open the link or scan the code in the terminal"
PAGES_MAX = 24  # open at once
BODY_MAX_BYTES = 1024
KEEPALIVE_S = 10.0  # that an idle connection stays open
ATTEMPTS_PER_SECOND = 1.0  # wrong codes of one client
ATTEMPT_BURST = 10.0
ATTEMPTING_CLIENTS_MAX = 256
TYPES = {
    "html": "text/html",
    "js": "text/javascript",
    "css": "text/css",
    "svg": "image/svg+xml",
    "webmanifest": "application/manifest+json",
}
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; manifest-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Asset(NamedTuple):
    """A file of the page, compressed."""

    type: str
    data: bytes


def load_assets() -> dict[str, Asset]:
    folder = files("diffbotctl.web") / "assets"
    assets = {
        f"/{file.name}": Asset(
            TYPES[file.name.rpartition(".")[2]], gzip.compress(file.read_bytes(), mtime=0)
        )
        for file in folder.iterdir()
    }
    return {**assets, "/": assets["/index.html"]}


class WebServer:
    """Serves the page of `engine` on `listener`. `report` is called when a device has joined.

    Without a `certificate` the listener must be on the loopback address. `view`: what a page shows
    when it is opened.
    """

    def __init__(
        self,
        engine: EngineAddress,
        listener: socket.socket,
        certificate: ServerCertificate | None,
        report: Callable[[Session], None],
        view: ViewSettings | None = None,
    ) -> None:
        self.engine = engine
        self.view = view
        self.listener = listener
        self.certificate = certificate
        self.report = report
        address, self.port = listener.getsockname()
        names = {"localhost"} if address == LOOPBACK else {"localhost", *host_names()}
        assert certificate is not None or address != EVERY_ADDRESS
        self.origin = ServerOrigin("https" if certificate else "http", self.port, names)
        self.cookie = f"diffbotctl_{self.port}"  # browsers share cookies between ports
        self.sessions = Sessions()
        self.attempts: dict[str, TokenBucket] = {}  # by client, the latest last
        self.assets = load_assets()
        self.numbers = BeatNumbers()
        self.pages: dict[PageConnection, None] = {}
        self.driver: PageConnection | None = None
        self.feed = EngineFeed(self._publish, lambda: bool(self.pages))

    async def run(self, is_ready: Callable[[], None]) -> None:
        """Serve until the run has ended. `is_ready` is called when the page can be opened."""
        await self.feed.connect(self.engine)
        application = web.Application(middlewares=[self._check], client_max_size=BODY_MAX_BYTES)
        application.router.add_get("/socket", self._open_socket)
        application.router.add_post("/session", self._enter)
        application.router.add_get("/session", self._show_session)
        application.router.add_get("/robot.urdf", self._send_urdf)
        application.router.add_get("/lesson.md", self._send_lesson)
        application.router.add_get("/view.json", self._send_view)
        application.router.add_get(f"/{FILE_NAME}", self._send_view_file)
        application.router.add_get("/{file:.*}", self._send_asset)
        context = None if self.certificate is None else self.certificate.context
        async with serving(application, self.listener, context, self._is_page, KEEPALIVE_S):
            is_ready()
            beating = asyncio.create_task(self._beat())
            try:
                await self.feed.run()
                for page in self.pages:
                    page.note(ended=True)
                await asyncio.sleep(BEAT_PERIOD_S)  # for the pages to receive it
            finally:
                beating.cancel()

    def _is_page(self, peer: Peer) -> bool:
        return any(page.peer == peer for page in self.pages)

    # Requests.

    @web.middleware
    async def _check(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Check Host and Origin; a refusal is a text."""
        try:
            address = request.transport.get_extra_info("sockname")[0] if request.transport else ""
            check_origin(self.origin, address, request.method, request.headers)
            response: web.StreamResponse = await handler(request)
        except RequestRefusalError as refusal:
            text = f"{refusal.cause}\n"
            return web.Response(status=refusal.status, text=text, headers=HEADERS)
        except web.HTTPException as error:
            return web.Response(status=error.status, text=f"{error.reason}\n", headers=HEADERS)
        return response

    async def _send_asset(self, request: web.Request) -> web.StreamResponse:
        asset = self.assets.get(request.path)
        if asset is None:
            raise RequestRefusalError(404, "there is no such file")
        headers = {**HEADERS, "Content-Encoding": "gzip"}
        return web.Response(
            body=asset.data, content_type=asset.type, charset="utf-8", headers=headers
        )

    async def _send_urdf(self, request: web.Request) -> web.StreamResponse:
        """The robot's model, for a device with a session."""
        self._require_session(request)
        try:
            # A thread reads the files: pages that drive are served meanwhile.
            text = await asyncio.to_thread(urdf_of_run, await self.feed.status())
        except UserError as error:
            problem = error.problems[0]
            cause = f"the run's robot file cannot be read here: {problem.file}: {problem.cause}"
            raise RequestRefusalError(404, cause) from error
        except RefusalError as refusal:
            raise RequestRefusalError(503, refusal.cause) from refusal
        if not text:
            raise RequestRefusalError(404, "this run has no robot")
        return web.Response(text=text, content_type="application/xml", headers=HEADERS)

    async def _send_lesson(self, request: web.Request) -> web.StreamResponse:
        """The text of the lesson to which the run's pipeline belongs; empty without one."""
        self._require_session(request)
        try:
            pipeline = run_file(await self.feed.status(), "pipeline")
            lesson = await asyncio.to_thread(lesson_in, pipeline.parent)
            text = "" if lesson is None else lesson.text
        except RefusalError as refusal:
            raise RequestRefusalError(503, refusal.cause) from refusal
        return web.Response(text=text, content_type="text/markdown", headers=HEADERS)

    async def _send_view(self, request: web.Request) -> web.StreamResponse:
        """The view that a page opens with, for a device with a session."""
        self._require_session(request)
        return web.json_response(view_record(self.view), headers=HEADERS)

    async def _send_view_file(self, request: web.Request) -> web.StreamResponse:
        """The file of the view that the query describes, for a device with a session."""
        self._require_session(request)
        text = requested_view(request.query)
        headers = {**HEADERS, "Content-Disposition": f'attachment; filename="{FILE_NAME}"'}
        return web.Response(text=text, content_type="application/yaml", headers=headers)

    async def _enter(self, request: web.Request) -> web.StreamResponse:
        """A device presents a code, and gets a session."""
        code = (await request.read()).decode("ascii", "replace")
        session = self.sessions.enter(code, request.headers.get("User-Agent", ""))
        if session is None:
            raise self._wrong_code(request)
        self.report(session)
        response = web.Response(text=session.proof, headers=HEADERS)
        response.set_cookie(
            self.cookie,
            session.key,
            httponly=True,
            samesite="Strict",
            secure=self.certificate is not None,
            path="/",
        )
        return response

    def _wrong_code(self, request: web.Request) -> RequestRefusalError:
        """The refusal of a wrong code, with the rate of its client; a right one is always taken."""
        now, name = time.monotonic(), client_name(request.remote or LOOPBACK)
        bucket = self.attempts.pop(name, None)
        bucket = bucket or TokenBucket(ATTEMPTS_PER_SECOND, ATTEMPT_BURST, now)
        self.attempts[name] = bucket
        if len(self.attempts) > ATTEMPTING_CLIENTS_MAX:
            del self.attempts[next(iter(self.attempts))]
        if not bucket.allows(now):
            return RequestRefusalError(429, "too many codes were tried; wait some seconds")
        bucket.spend()
        return RequestRefusalError(403, USED_CODE)

    async def _show_session(self, request: web.Request) -> web.StreamResponse:
        """The device's name, for a page that was reloaded."""
        session = self._require_session(request)
        return web.Response(text=f"{session.name}\n", headers=HEADERS)

    def _require_session(self, request: web.Request) -> Session:
        session = self.sessions.find(self._key(request))
        if session is None:
            raise RequestRefusalError(401, NO_SESSION)
        return session

    def _key(self, request: web.Request) -> str:
        return request.cookies.get(self.cookie, "")

    async def _open_socket(self, request: web.Request) -> web.StreamResponse:
        proof = request.headers.get("Sec-WebSocket-Protocol", "")
        session = self.sessions.find_proven(self._key(request), proof)
        if session is None:
            raise RequestRefusalError(401, NO_SESSION)
        if len(self.pages) >= PAGES_MAX:
            raise RequestRefusalError(503, f"{PAGES_MAX} pages are open; close one")
        page = PageConnection(self, session)
        self.pages[page] = None
        try:
            return await page.serve(request)
        finally:
            self.pages.pop(page, None)

    # Pages.

    def add(self, page: PageConnection) -> None:
        page.session.sockets += 1
        self.tell_roles()

    def remove(self, page: PageConnection) -> None:
        page.session.sockets -= 1
        self.pages.pop(page, None)
        if self.driver is page:
            self.driver = None
        self.tell_roles()

    def require_control(self, page: PageConnection) -> None:
        """Give control to `page` if no page has it. Raises RefusalError if another page has."""
        if self.driver is None:
            self.driver = page
            self.tell_roles()
        if self.driver is not page:
            raise RefusalError("E-BUSY", f"{self.driver.name} is in control; take over first")

    def take_control(self, page: PageConnection) -> None:
        """Give control to `page`. Raises RefusalError while another one drives by hand."""
        if self.driver is not None and self.driver.deadman.is_driving and self.driver is not page:
            raise RefusalError("E-BUSY", f"{self.driver.name} is driving")
        self.driver = page
        self.tell_roles()

    def give_control(self, page: PageConnection) -> None:
        """End the control of `page`."""
        if self.driver is page:
            page.deadman.release(page.deadman.press)
            self.driver = None
            self.tell_roles()

    def tell_roles(self) -> None:
        """Notify each page who is in control."""
        name = None if self.driver is None else self.driver.name
        for page in self.pages:
            page.note(
                n=self.numbers.number,  # it may drive at once
                role={
                    "you": page.name,
                    "driver": name,
                    "is_driver": page is self.driver,
                    "sets_goals": page.session.sets_goals,
                },
            )

    def _publish(self, picture: str) -> None:
        for page in self.pages:
            page.show(picture)

    async def _beat(self) -> None:
        """Send numbers to the page in control, to all if there is none; notice silent pages."""
        while True:
            await asyncio.sleep(BEAT_PERIOD_S)
            now = time.monotonic()
            number = self.numbers.next(now)
            for page in self.pages:
                page.deadman.beat(now)
                if page is self.driver or self.driver is None:
                    page.note(n=number)
