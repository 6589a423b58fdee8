"""Who may open the page: plain rules on the headers of a request, without a web server.

Loopback is open to every user of this computer, and to every web page that somebody looks at. So whoever asks has to
know the token, for looking too: what a robot logs is kept from other users elsewhere as well (folders of mode 0700).
"""

import secrets

from silo.bridges import listening

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
    """Return why a request is refused, empty where it isn't."""
    if why := listening.refusal(path, host, token, "silo-tui --serve"):
        return why
    if origin is None:
        return "a page has to say where it is from" if is_socket else ""  # every browser does
    return "" if origin.lower() == f"http://{host.lower()}" else "another page asks for this one"
