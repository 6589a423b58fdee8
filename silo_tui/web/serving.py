"""Serves silo-tui to browsers of this computer: each page has a silo-tui of its own, which ends with the page."""

import asyncio
import json
import logging
import shlex
from collections.abc import Awaitable, Callable, Mapping, Sequence
from pathlib import Path
from socket import gethostname
from typing import Any

from aiohttp import WSMsgType, web
from textual_serve.app_service import AppService
from textual_serve.server import Server

from silo.bridges.listening import bound
from silo.core.child import ENDING_S, own_program
from silo_tui.web import guard

MOST_PAGES = 4  # each is a process that watches the robot
SIZES = {"width": (80, 20, 1000), "height": (24, 5, 400)}  # of a page, in cells: as it is not told, at least, at most
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
        app.router.add_get(f"/{self.token}", self._with_slash)
        app.add_subapp(f"/{self.token}", inner)
        app.router.add_get(f"/{self.token}/page.js", self._script)
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

    async def _with_slash(self, request: web.Request) -> web.StreamResponse:
        """Lead whoever copied the address without its end to the page, whose addresses are relative."""
        return web.Response(status=308, headers={"Location": f"/{self.token}/"})

    async def _script(self, request: web.Request) -> web.StreamResponse:
        return web.FileResponse(Path(__file__).parent / "page.js")

    async def handle_websocket(self, request: web.Request) -> web.StreamResponse:
        """Start a silo-tui for a page, unless there are too many, or it is gone already."""
        if not web.WebSocketResponse().can_prepare(request):
            return web.Response(status=400, text="silo-tui: a page comes here by a WebSocket\n")
        if request.transport is None or request.transport.is_closing():
            return web.Response(status=400)
        if self._pages >= MOST_PAGES:
            return web.Response(status=503, text=f"silo-tui: {MOST_PAGES} pages are open already; close one\n")
        self._pages += 1
        asked = request.clone(rel_url=request.rel_url.update_query(_sizes(request.query)))
        try:
            answer: web.StreamResponse = await super().handle_websocket(asked)
            return answer
        finally:
            self._pages -= 1

    async def _process_messages(self, websocket: web.WebSocketResponse, app_service: AppService) -> None:
        """Hand on what a page sends, until it sends what none of ours does; see to it that its silo-tui ends then."""
        try:
            async for message in websocket:
                if message.type is not WSMsgType.TEXT or not await _handed_on(message.data, websocket, app_service):
                    return
        finally:
            asyncio.get_running_loop().call_later(ENDING_S, _end, app_service)

    def initialize_logging(self) -> None:
        """Tell mistakes alone."""
        logging.basicConfig(level=logging.WARNING, format="silo-tui: %(message)s")


def _sizes(given: Mapping[str, Any]) -> dict[str, int]:
    """Return width and height as a screen may have them: a page may say anything, and its silo-tui draws all of it."""
    return {name: _size(given.get(name), *sizes) for name, sizes in SIZES.items()}


def _size(given: Any, usual: int, least: int, most: int) -> int:
    try:
        return min(max(int(given), least), most)
    except (TypeError, ValueError, OverflowError):
        return usual


async def _handed_on(text: str, websocket: web.WebSocketResponse, app_service: AppService) -> bool:
    """Do what a page wants; False for what none of ours wants."""
    try:
        kind, *given = json.loads(text)
        if kind == "stdin":
            await app_service.send_bytes(given[0].encode())
        elif kind == "resize":
            await app_service.set_terminal_size(**_sizes(dict(given[0])))
        elif kind == "ping":
            await websocket.send_json(["pong", given[0]])
        elif kind in ("blur", "focus"):
            await getattr(app_service, kind)()
        else:
            return False
    except (ValueError, TypeError, IndexError, AttributeError, RecursionError):
        return False
    return True


def _end(app_service: AppService) -> None:
    """Kill a silo-tui that has not ended, though its page is gone."""
    process = app_service._process
    if process is not None and process.returncode is None:
        process.kill()


def serve(arguments: Sequence[str], port: int, *, control: bool, tell: Callable[[str], None]) -> None:
    """Serve `silo-tui ARGUMENTS` until Ctrl-C; `tell` gets the address. SiloError when the port is taken."""
    with bound(HOST, port) as listening:
        # the child finds the robot as we do; over SSH it would leave the mouse alone, which a browser needn't
        command = [*own_program("silo_tui"), "--mouse", *([] if control else ["--read-only"]), *arguments]
        server = PageServer(f"exec {shlex.join(command)}", "silo-tui", guard.new_token())
        server.port = listening.getsockname()[1]
        what = "anybody who has this address can change and stop the logger"
        looks = "it is read-only: with --control it could change and stop the logger, too"
        way = f"ssh -L {server.port}:{HOST}:{server.port} {gethostname()}"
        tell(f"http://{HOST}:{server.port}/{server.token}/")
        tell(f"{what if control else looks}; Ctrl-C ends it")
        tell(f"To open it on another computer: first, in a shell there, `{way}`")
        server.initialize_logging()
        web.run_app(server._make_app(), sock=listening, print=None, access_log=None, shutdown_timeout=3.0)
