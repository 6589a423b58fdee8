"""Serving a logger to viewers until Ctrl-C."""

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import Callable

from silo.bridges.feed import LoggerFollower
from silo.bridges.foxglove.server import Terms, ViewerServer
from silo.bridges.services import Connect


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
    server = ViewerServer(terms, lambda listener: LoggerFollower(connect, listener), tell)
    with contextlib.closing(listening):
        await server.serve(listening, ended)
