"""Serving a logger to viewers until Ctrl-C."""

import asyncio
import contextlib
import signal
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

from silo.bridges.feed import Feed
from silo.bridges.foxglove.server import Server, Terms
from silo.errors import ConnectionLostError, SiloError

if TYPE_CHECKING:
    from silo.ipc.client import Client

Connect = Callable[[], "Client"]
SERVICES = ("start", "stop", "save")


def bound(bind: str, port: int) -> socket.socket:
    """Return a socket that is bound. Raises SiloError for a port that is taken or no port of ours."""
    family = socket.AF_INET6 if ":" in bind else socket.AF_INET
    listening = socket.socket(family)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((bind, port))
    except OSError as error:
        listening.close()
        raise SiloError(
            f"can't listen at {bind} port {port}: {error.strerror or error}; `--port 0` takes one that is free"
        ) from error
    return listening


def services(connect: Connect, prefix: str) -> dict[str, Callable[[], str]]:
    """Return what viewers may call, by name: each connects, does it, and says what came of it."""

    def start() -> str:
        with connect() as client:
            return f"{client.found.label} is {client.start().state.value}"

    def stop() -> str:
        with connect() as client:
            return f"{client.found.label} is {client.stop().state.value}"

    def save() -> str:
        with connect() as client:
            return "saved " + ", ".join(file.path for file in client.wait_saved(client.save()))

    return {f"/{prefix}/{name}": call for name, call in zip(SERVICES, (start, stop, save), strict=True)}


def run(terms: Terms, connect: Connect, listening: socket.socket, tell: Callable[[str], None]) -> None:
    """Serve on a socket until Ctrl-C or SIGTERM."""
    asyncio.run(_run(terms, connect, listening, tell))


async def _run(terms: Terms, connect: Connect, listening: socket.socket, tell: Callable[[str], None]) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    server = Server(terms, lambda listener: Feed(connect, listener), tell)
    with contextlib.closing(listening):
        await server.serve(listening, ended)


def once(connect: Connect) -> str:
    """Return the name of the logger that is there. Raises ConnectionLostError where none is."""
    with connect() as client:
        name = client.status().logger
    if not name:
        raise ConnectionLostError("the logger has no name")
    return name
