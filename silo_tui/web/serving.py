"""Serves silo-tui to browsers of this computer: each page has a silo-tui of its own, which ends with the page."""

import logging
import shlex
import socket
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path

from aiohttp import web
from textual_serve.server import Server

from silo.core.child import own_program
from silo_tui.web import guard

MOST_PAGES = 4  # each is a process that watches the robot
HOST = "127.0.0.1"
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class PageServer(Server):  # type: ignore[misc]  # textual-serve is an extra
    """textual-serve with our own page (its own links a font from the internet), token and checks."""

    def __init__(self, command: str, title: str, token: str) -> None:
        super().__init__(command, HOST, 0, title=title, templates_path=Path(__file__).parent)
        self.token = token
        self._pages = 0

    async def _make_app(self) -> web.Application:
        app = web.Application(middlewares=[self._guarded])
        inner: web.Application = await super()._make_app()
        inner.on_startup.clear()  # its greeting; and what it would print has no token
        app.add_subapp(f"/{self.token}", inner)
        app.router.add_get(f"/{self.token}/page.js", self._script)
        self._inner = inner
        return app

    @web.middleware  # type: ignore[untyped-decorator]  # textual-serve is an extra
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        why = guard.refusal(
            request.path, request.headers.get("Host", ""), request.headers.get("Origin"), self.token,
            is_socket=is_socket,
        )  # fmt: skip
        if why:
            return web.Response(status=403, text=f"silo-tui: {why}\n", headers=guard.HEADERS)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(guard.HEADERS)
        return response

    async def handle_index(self, request: web.Request) -> web.StreamResponse:
        """Return the page; its addresses are relative, so that it works behind `ssh -L` too."""
        page = (Path(__file__).parent / "page.html").read_text("utf-8")
        socket_url = f"ws://{request.headers['Host']}/{self.token}/ws"
        return web.Response(text=page.replace("{socket}", socket_url), content_type="text/html")

    async def _script(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(Path(__file__).parent / "page.js")

    async def handle_websocket(self, request: web.Request) -> web.StreamResponse:
        """Start a silo-tui for a page, unless there are too many."""
        if self._pages >= MOST_PAGES:
            return web.Response(status=503, text=f"silo-tui: {MOST_PAGES} pages are open already; close one\n")
        self._pages += 1
        try:
            answer: web.StreamResponse = await super().handle_websocket(request)
            return answer
        finally:
            self._pages -= 1

    def initialize_logging(self) -> None:
        """Tell mistakes alone."""
        logging.basicConfig(level=logging.WARNING, format="silo-tui: %(message)s")


def serve(arguments: Sequence[str], port: int, *, control: bool, tell: Callable[[str], None]) -> None:
    """Serve `silo-tui ARGUMENTS` until Ctrl-C; `tell` gets the address. OSError when the port is taken."""
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    with listening:
        listening.bind((HOST, port))
        # the child finds the robot as we do; over SSH it would leave the mouse alone, which a browser needn't
        command = [*own_program("silo_tui"), "--mouse", *([] if control else ["--read-only"]), *arguments]
        server = PageServer(shlex.join(command), "silo-tui", guard.new_token())
        server.port = listening.getsockname()[1]
        what = "anybody who has this address can change and stop the logger" if control else "read-only"
        tell(f"http://{HOST}:{server.port}/{server.token}/\n{what}; Ctrl-C ends it")
        server.initialize_logging()
        web.run_app(server._make_app(), sock=listening, print=None, access_log=None, shutdown_timeout=3.0)
