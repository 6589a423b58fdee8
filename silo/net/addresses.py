"""Addresses as URLs: `silo://robot3/anymal/log/joints/q` is one element of one logger, wherever it is asked for.

Without a host (`silo:///anymal/log/joints/q`) the name alone decides, as everywhere. Behind the URL stands all that a
program in another language needs: the key, and a configuration of Zenoh.
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

from silo.errors import ConnectionLostError
from silo.net.configuration import FORCED, PATHS, find_file, from_file, written
from silo.net.found import ADDRESS, LoggerAddress
from silo.net.session import leading_to

SCHEME = "silo://"


class Address(NamedTuple):
    """What a URL names: a logger (`robot3/anymal`), and an element of it, empty for none."""

    logger: str
    element: str = ""


def is_url(text: str) -> bool:
    """Return whether this is meant as a URL of ours."""
    return text.startswith(SCHEME)


def parse_url(text: str) -> Address:
    """Return what a URL names; its element has a leading slash.

    Raises ConnectionLostError for one that names no logger.
    """
    host, _, path = text.removeprefix(SCHEME).partition("/")
    name, _, element = path.partition("/")
    logger = f"{host}/{name}" if host else name
    if not is_url(text) or not ADDRESS.fullmatch(logger):
        raise ConnectionLostError(
            f"{text}: is no address of a logger: write {SCHEME}HOST/LOGGER or {SCHEME}HOST/LOGGER/ELEMENT, "
            f"like {SCHEME}robot3/anymal/log/joints/q ({SCHEME}/anymal/... without a host); nothing was asked"
        )
    return Address(logger, f"/{element}" if element else "")


def logger_of(text: str) -> str:
    """Return the logger that a word means, a URL or an address.

    Raises ConnectionLostError for a URL that names an element: the whole logger would be more than it says.
    """
    if not is_url(text):
        return text
    address = parse_url(text)
    if address.element:
        raise ConnectionLostError(
            f"{text}: names an element, and this is for a whole logger: {SCHEME}{address.logger}; nothing was asked"
        )
    return address.logger


def url_of(address: str, element: str = "") -> str:
    """Return the URL of a logger's address (`robot3/anymal`, `anymal`), or of one of its elements."""
    logger = address if "/" in address else f"/{address}"
    return f"{SCHEME}{logger}{'/' if element else ''}{element.strip('/')}"


def zenoh_settings(found: LoggerAddress) -> dict[str, Any]:
    """Return a configuration of Zenoh by which a program in any language reaches this logger, ready for JSON.

    Raises ConnectionLostError for a remote whose file is gone.
    """
    scouting = FORCED["scouting"]
    if found.config:
        file = find_file(found.config)
        given = written(file)
        absolute = from_file(file)
        for key in PATHS:
            _make_absolute(given, key.split("/"), json.loads(absolute.get_json(key)))
        return {**given, "mode": "client", "scouting": scouting}
    return {"mode": "client", **leading_to(Path(found.socket)), "scouting": scouting}


def _make_absolute(settings: dict[str, Any], names: list[str], path: str | None) -> None:
    """Put a path where the file has one."""
    *above, last = names
    for name in above:
        settings = settings.get(name, {})
    if last in settings and path:
        settings[last] = path
