"""The port on which a bridge waits for viewers: bound where its address is asked for, so that who asks is told at once.

Light enough for a robot program to import.
"""

import importlib.util
import socket

from silo.errors import SiloError, reason

LOOPBACK = ("127.0.0.1", "::1", "localhost")


def check_installed(package: str, extra: str) -> None:
    """Raise SiloError where a package of one of silo's extras is missing."""
    if importlib.util.find_spec(package) is None:
        raise SiloError(f"{package} is missing: pip install 'silo-logger[{extra}]'")


def bound(bind: str, port: int) -> socket.socket:
    """Return a TCP socket that listens, `port` 0 being one that is free. Raises SiloError where that can't be."""
    listening = socket.socket(socket.AF_INET6 if ":" in bind else socket.AF_INET)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((bind, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise SiloError(
            f"can't listen at {bind} port {port}: {reason(error)}; port 0 takes one that is free"
        ) from error
    return listening
