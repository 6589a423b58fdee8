"""Who may open the page: plain rules on the headers of a request, without a web server.

Loopback is open to every user of this computer, and to every web page that somebody looks at. So whoever asks has to
know the token, for looking too: what a robot logs is kept from other users elsewhere as well (folders of mode 0700).
"""

import hmac
import re
import secrets

HOSTS = ("127.0.0.1", "localhost", "[::1]")
_HOST = re.compile(rf"(?:{'|'.join(map(re.escape, HOSTS))})(?::\d{{1,5}})?", re.IGNORECASE)
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; worker-src 'self' blob:; "
        "form-action 'none'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",  # the address has the token
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def new_token() -> str:
    """Return a token that can't be guessed (192 bits)."""
    return secrets.token_urlsafe(24)


def refusal(path: str, host: str, origin: str | None, token: str, *, is_socket: bool) -> str:
    """Return why a request is refused, empty where it isn't. A port may differ: `ssh -L` forwards to another one."""
    if not _HOST.fullmatch(host):
        return "this page is for addresses of this computer alone"  # a name that was bent to 127.0.0.1
    first = path.lstrip("/").partition("/")[0]
    if not hmac.compare_digest(first.encode(), token.encode()):
        return "the address has not the token that silo-tui --serve printed"
    if origin is None:
        return "a page has to say where it is from" if is_socket else ""  # every browser does
    return "" if origin.lower() == f"http://{host.lower()}" else "another page asks for this one"
