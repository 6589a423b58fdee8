"""Who may connect: plain rules on the headers of a request.

Reading needs no token on loopback, since PlotJuggler knows host and port alone; so any user of the computer can look.
What web pages may do is decided by their origin, which they can't choose: programs that are no browsers send none.
"""

import hmac
import re
from collections.abc import Sequence

OWN_HOSTS = ("127.0.0.1", "localhost", "[::1]")
VIEWERS = ("https://app.foxglove.dev", "https://lichtblick-suite.github.io")
_PORT = r"(?::\d{1,5})?"
_LOCAL = "|".join(map(re.escape, OWN_HOSTS))
_OWN_HOST = re.compile(rf"(?:{_LOCAL}){_PORT}", re.IGNORECASE)
_OWN_ORIGIN = re.compile(rf"https?://(?:{_LOCAL}){_PORT}|file://|app://.*", re.IGNORECASE)


def refusal(path: str, host: str, origin: str | None, token: str, origins: Sequence[str], *, on_loopback: bool) -> str:
    """Return why a request is refused, empty where it isn't.

    Args:
        path: of the request; its first part is the token.
        host: the header.
        origin: the header, None where there is none.
        token: that has to be there, empty for none.
        origins: web pages that may connect, beside those of this computer and the known viewers.
        on_loopback: whether the server listens on loopback alone; then no other name may have led here.
    """
    if on_loopback and not _OWN_HOST.fullmatch(host):
        return f"'{host}' is no address of this computer"  # a name that was bent to 127.0.0.1
    first = path.split("?", maxsplit=1)[0].strip("/").partition("/")[0]
    if token and not hmac.compare_digest(first.encode(), token.encode()):
        return "the address has not the token that silo foxglove printed"
    if origin is None or origin in (*VIEWERS, *origins) or _OWN_ORIGIN.fullmatch(origin):
        return ""
    return f"pages of {origin} may not connect; `silo foxglove --origin {origin}` lets them"
