"""Loggers of networks that were seen by this user, so that one whose link went down is missed by who looks once, too.

A file in the runtime folder, of a few hundred bytes per ten loggers, written whole by who asks them how they stand:
`silo ls`, `silo ls --follow`, silo-tui. One that is closed while somebody follows is forgotten; of one that goes while
nobody looks nobody knows whether it was closed, and it is remembered for a shorter time.
"""

import fcntl
import logging
import os
import time
from collections.abc import Iterable

import msgspec

from silo.core.runtime import closing_file, read_own, runtime_dir, write_private
from silo.decoding import json_decoder
from silo.errors import SiloError
from silo.fleet.member import Member
from silo.net.configuration import find_file
from silo.net.found import LoggerAddress
from silo.net.keys import Root

NAME = "fleet.seen"
LOST_S, GONE_S = 12 * 3600.0, 2 * 3600.0  # for how long one is remembered that was seen to go, and one that wasn't
MOST = 1000

log = logging.getLogger("silo.client")


class Seen(msgspec.Struct, frozen=True):
    """A logger that was there, by the file of its configuration. `lost_ns` is 0 where nobody saw it go."""

    file: str
    host: str
    logger: str
    id: str
    seen_ns: int
    lost_ns: int = 0

    @property
    def until_ns(self) -> int:
        """Until when it is remembered."""
        return int(self.lost_ns + LOST_S * 1e9 if self.lost_ns else self.seen_ns + GONE_S * 1e9)


_decoder = json_decoder(list[Seen])


def remembered(config: str) -> list[Member]:
    """Return the loggers that were seen by a configuration, all of them gone: who looks finds those that are there."""
    try:
        file, known = find_file(config), _read()
    except (OSError, SiloError) as error:
        log.debug("loggers that were seen are not remembered: %s", error)
        return []
    now_s, now_ns = time.monotonic(), time.time_ns()
    return [_gone(config, one, now_s, now_ns) for one in known if one.file == file]


def _gone(config: str, one: Seen, now_s: float, now_ns: int) -> Member:
    at_s = now_s - max(0, now_ns - one.seen_ns) / 1e9
    since_s = now_s - max(0, now_ns - (one.lost_ns or one.seen_ns)) / 1e9
    found = LoggerAddress.behind(config, Root(one.host, one.logger, one.id))
    why = "it can't be reached" if one.lost_ns else "it was closed or can't be reached: nobody looked when it went"
    return Member(found, here=False, problem=why, seen_s=at_s, since_s=since_s, unwatched=not one.lost_ns)


def remember(configs: Iterable[str], members: Iterable[Member]) -> None:
    """Keep what is known now of the loggers of some configurations, in place of what was.

    Nothing that is shown of those that are there needs it: a folder that can't be written to is told in the log alone.
    """
    try:
        _replace({config: find_file(config) for config in configs}, members)
    except (OSError, SiloError) as error:
        log.debug("loggers that were seen are not remembered: %s", error)


def _replace(files: dict[str, str], members: Iterable[Member]) -> None:
    """Raises OSError, SiloError."""
    now_s, now_ns = time.monotonic(), time.time_ns()
    mine = [_seen(files[one.found.config], one, now_s, now_ns)
            for one in members if one.found.config in files and (one.here or one.lost) and not one.dead]  # fmt: skip
    with closing_file(os.open(runtime_dir(), os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)) as descriptor:
        fcntl.flock(descriptor, fcntl.LOCK_EX)  # another one that looks keeps what it saw by other configurations
        known = _read()
        kept = [one for one in known if one.file not in files.values()] + mine
        if kept or known:
            kept = sorted(kept, key=lambda one: -one.until_ns)[:MOST]
            write_private(runtime_dir() / NAME, msgspec.json.encode(kept).decode())


def _seen(file: str, one: Member, now_s: float, now_ns: int) -> Seen:
    seen_ns = now_ns if one.here else now_ns - int(1e9 * (now_s - one.seen_s))
    lost_ns = 0 if one.here or one.unwatched else now_ns - int(1e9 * (now_s - one.since_s))
    return Seen(file, one.found.host, one.found.name, one.found.id, seen_ns, lost_ns)


def _read() -> list[Seen]:
    """Raises OSError, SiloError."""
    try:
        known = _decoder.decode(read_own(runtime_dir() / NAME))
    except FileNotFoundError:
        return []
    except msgspec.MsgspecError as error:
        log.debug("what was seen before can't be read: %s", error)
        return []
    now_ns = time.time_ns()
    return [one for one in known if one.until_ns > now_ns]
