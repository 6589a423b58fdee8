"""Logins that Zenoh refuses: it says so in its log alone, to the standard output, and neither whose name it was nor why
beyond "Invalid user" and "Invalid password".

What rules deny stands there only at a level at which every message does, mixed with what Zenoh merely reckons
beforehand: that can't be read. Clients of silo say it themselves, under `refused/<user>`.
"""

import contextlib
import json
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable

import zenoh

from silo.net.configuration import from_file
from silo.printing import PrintedStream

_LEVELS = "off,zenoh_transport::unicast::establishment::accept=debug,zenoh_link_tcp=debug,zenoh_link_tls=debug"
_REFUSED = re.compile(r"Recv OpenSyn\. Invalid (user|password)\.")
_CAME = re.compile(r"Accepted T(?:CP|LS) connection on \S+: (?P<address>\S+:\d+)")
_LET_IN = re.compile(r"New transport link accepted .* dst: \w+/(?P<address>\S+:\d+)")
_OF_ZENOH = re.compile(r"\d{4}-\d\d-\d\dT.*zenoh")
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
PENDING_S = 10.0  # in which who connects must have shown a password

Refused = Callable[[str], None]  # takes who it was, as far as that can be told


def asks_for_passwords(config: str) -> bool:
    """Return whether those who come by a configuration must have a password."""
    return bool(json.loads(from_file(config).get_json("transport/auth/usrpwd/dictionary_file")))


class Logins:
    """Reads the lines of Zenoh's log; `refused` is called for each login that it tells was refused."""

    def __init__(self, refused: Refused) -> None:
        self._refused = refused
        self._pending: dict[str, float] = {}  # who came and hasn't been let in, and when

    def read(self, line: str, now_s: float) -> bool:
        """Take a line; returns whether it is one of Zenoh's."""
        text = _COLOURS.sub("", line)
        if found := _CAME.search(text):
            # some only look whether the port is open, and never go on
            self._pending = {who: at_s for who, at_s in self._pending.items() if now_s - at_s < PENDING_S}
            self._pending[found["address"]] = now_s
        elif found := _LET_IN.search(text):
            self._pending.pop(found["address"].rstrip(","), None)
        elif _REFUSED.search(text):
            # of several at the same moment it doesn't say which
            hosts = {who.rpartition(":")[0] for who in self._pending}
            self._refused(f"somebody at {hosts.pop()}" if len(hosts) == 1 else "somebody")
        return _OF_ZENOH.match(text) is not None

    def follow(self, lines: Iterable[str], forward: Callable[[str], None]) -> None:
        """Read lines until they end; what isn't Zenoh's is forwarded, and all where somebody wants to see its log."""
        wanted = "RUST_LOG" in os.environ
        for line in lines:
            if not self.read(line, time.monotonic()) or wanted:
                with contextlib.suppress(OSError):
                    forward(_COLOURS.sub("", line))


def watch_logins(refused: Refused) -> None:
    """Have Zenoh tell of logins that it refuses, before the first session of a process is opened.

    The standard output is read by a thread from now on; what Python prints goes where it went.
    """
    kept = os.dup(1)
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    sys.stdout = PrintedStream(os.fdopen(kept, "w", buffering=1, encoding="utf-8"))
    zenoh.init_log_from_env_or(_LEVELS)
    lines = os.fdopen(reading, encoding="utf-8", errors="replace")
    # it calls nothing of Zenoh, and may end within a line
    threading.Thread(target=Logins(refused).follow, args=(lines, sys.stdout.write), name="logins", daemon=True).start()
