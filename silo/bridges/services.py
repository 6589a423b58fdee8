"""What a bridge with `--control` lets others do to a logger: start, stop, save."""

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING

from silo.errors import ConnectionLostError
from silo.files.ros_types import ENCAPSULATION

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


def reached(connect: Connect) -> str:
    """Return the name of the logger that is there. Raises ConnectionLostError where none is."""
    with connect() as client:
        name = client.status().logger
    if not name:
        raise ConnectionLostError("the logger has no name")
    return name


def trigger_response(text: str, *, success: bool) -> bytes:
    """Return the answer of a `std_srvs/srv/Trigger`, in CDR."""
    letters = text.encode() + b"\0"
    return ENCAPSULATION + bytes([success, 0, 0, 0]) + struct.pack("<I", len(letters)) + letters
