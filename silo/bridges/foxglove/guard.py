"""Who may connect: plain rules on the headers of a request.

Reading needs no token on loopback, since PlotJuggler knows host and port alone; so any user of the computer can look.
What web pages may do is decided by their origin, which they can't choose: programs that are no browsers send none.
"""

import re
from collections.abc import Sequence

from silo.bridges import listening

VIEWERS = ("https://app.foxglove.dev", "https://lichtblick-suite.github.io")
_OWN_ORIGIN = re.compile(rf"https?://{listening.LOCAL}|file://|app://.*", re.IGNORECASE)


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
    if why := listening.refusal(path, host if on_loopback else None, token, "silo foxglove"):
        return why
    if origin is None or origin in (*VIEWERS, *origins) or _OWN_ORIGIN.fullmatch(origin):
        return ""
    return f"pages of {origin} may not connect; `silo foxglove --origin {origin}` lets them"
