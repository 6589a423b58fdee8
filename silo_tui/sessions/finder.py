"""Finding the loggers of this computer, or those that a configuration reaches, and connecting to them.

Zenoh is loaded when the first look around is made, in a thread.
"""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from silo.errors import SiloError
from silo_tui.model.lists.fleet import FoundLogger

if TYPE_CHECKING:
    from silo.client.bulk import Job, Outcome
    from silo.client.client import Client
    from silo.fleet.fleet import Fleet
    from silo.fleet.member import Member
    from silo.net import found

FIRST_LOOK_S = 10.0
OLD_S = 3.0  # so long what was told before nobody looked is waited for anew


class Found(msgspec.Struct, frozen=True):
    """What a look around gave; `advice` has a sentence per logger that we may not talk to."""

    loggers: tuple[FoundLogger, ...]
    advice: tuple[str, ...] = ()


class ClientFinder:
    """Follows loggers and connects to them. Calls block and are made in a thread.

    While nobody looks at the list, `rest` has only their coming and going followed.
    """

    def __init__(self, config: str = "", *, read_only: bool = False) -> None:
        self._config, self._read_only = config, read_only
        self._seen: dict[str, found.LoggerAddress] = {}
        self.own_name = ""  # how events speak of us; empty before the first look
        self._fleet: Fleet | None = None
        self._looking = threading.Lock()
        self._rested, self._since_s = False, 0.0  # and since when it attends again

    def begin(self) -> None:
        """Look around in a thread, while the screen is still being loaded; `find` waits for it."""

        def look() -> None:
            with suppress(SiloError, OSError):  # `find` meets it again, and tells it
                self.find()

        threading.Thread(target=look, daemon=True).start()

    def find(self) -> Found:
        """Return the loggers that are known now, and advice for those that are closed to us.

        The first time it waits until all ways were tried: one that comes at once needn't be the only one.
        """
        from silo.fleet.exchange import client_name
        from silo.fleet.fleet import Fleet
        from silo.fleet.near import down_text, unreachable_text

        self.own_name = client_name()
        with self._looking:
            if self._fleet is None:
                self._fleet = Fleet(self._config)
                there = self._fleet.wait_ready(FIRST_LOOK_S)
            else:
                self._since_s = time.monotonic() if self._rested else self._since_s
                self._rested = False
                self._fleet.attend(attentive=True)
                there = self._fleet.now()
        loggers = []
        for one in map(self._as_of_now, there.members):
            each = one.found
            self._seen[one.key] = each
            alike = sum((other.found.host, other.found.name) == (each.host, each.name) for other in there.members) > 1
            user = each.user or each.host
            loggers.append(FoundLogger(each.name, each.pid, user, one.key, one, each.host, each.addresses, alike))
        advice = [
            f"{folder.owner} runs {', '.join(folder.loggers) or 'a logger'}, closed to you: {folder.advice}"
            for folder in there.near.forbidden
        ] + [down_text(each) for each in there.near.down]
        advice += [unreachable_text(remote, why) for remote, why in there.unreachable.items()]
        advice += [router.words for router in there.routers]
        return Found(tuple(loggers), tuple(advice))

    def _as_of_now(self, one: "Member") -> "Member":
        """Return it without what it told before nobody looked, for a moment: it may stand otherwise by now."""
        is_old = self._since_s and one.here and one.told_s < self._since_s
        is_old = is_old and time.monotonic() - self._since_s < OLD_S
        return replace(one, summary=None) if is_old else one

    def rest(self) -> None:
        """Follow no more than who comes and goes, until somebody looks again."""
        if self._fleet is not None:
            self._rested = True
            self._fleet.attend(attentive=False)

    def look_again(self) -> None:
        """Forget those that are gone, and try at once what could not be reached."""
        if self._fleet is not None:
            self._fleet.look_again()

    def ask_many(self, loggers: "Sequence[FoundLogger]", job: "Job") -> "Iterator[Outcome]":
        """Ask all of them the same; yields an outcome for each as it comes."""
        from silo.client.bulk import outcomes

        return outcomes([self._seen[logger.key] for logger in loggers], job, read_only=self._read_only)

    def close(self) -> None:
        """End what follows them, and its sessions."""
        if self._fleet is not None:
            self._fleet.close()

    def connect(self, logger: FoundLogger) -> "Client":
        """Connect to a logger that was found. ConnectionLostError says what to do when it doesn't answer."""
        from silo.client.client import Client

        return Client.connect(self._seen[logger.key], read_only=self._read_only)
