"""The port on which a bridge waits for viewers: bound where its address is asked for, so that who asks is told at once.

And where a request there has to go: to this computer, by the token. Light enough for a robot program to import.
"""

import hmac
import importlib.util
import re
import socket

from silo.errors import SiloError, reason

LOOPBACK = ("127.0.0.1", "::1", "localhost")
LOCAL = r"(?:127\.0\.0\.1|localhost|\[::1\])(?::\d{1,5})?"  # how addresses name this computer
_LOCAL_HOST = re.compile(LOCAL, re.IGNORECASE)


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


def refusal(path: str, host: str | None, token: str, program: str) -> str:
    """Return why a request is refused, by where it goes; empty where it isn't.

    Args:
        path: of the request; its first part is the token.
        host: the header, whose port may be another (`ssh -L`); None where any name may have led here.
        token: that has to be there, empty for none.
        program: which printed it.
    """
    if host is not None and not _LOCAL_HOST.fullmatch(host):
        return f"'{host}' is no address of this computer"  # a name that was bent to 127.0.0.1
    first = path.split("?", maxsplit=1)[0].lstrip("/").partition("/")[0]
    if token and not hmac.compare_digest(first.encode(), token.encode()):
        return f"the address has not the token that {program} printed"
    return ""
