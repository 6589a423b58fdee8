"""Serving a logger to viewers until Ctrl-C."""

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

from silo.bridges.feed import Feed
from silo.bridges.foxglove.server import Server, Terms
from silo.errors import ConnectionLostError

if TYPE_CHECKING:
    from silo.ipc.client import Client

Connect = Callable[[], "Client"]
SERVICES = ("start", "stop", "save")


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


def run(
    terms: Terms, connect: Connect, listening: socket.socket, tell: Callable[[str], None], ends_with: int | None = None
) -> None:
    """Serve on a socket until Ctrl-C or SIGTERM, or until `ends_with`, a descriptor, is at its end."""
    asyncio.run(_run(terms, connect, listening, tell, ends_with))


async def _run(
    terms: Terms, connect: Connect, listening: socket.socket, tell: Callable[[str], None], ends_with: int | None
) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    if ends_with is not None:
        loop.add_reader(ends_with, lambda: None if os.read(ends_with, 1) else ended.set())
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
