"""Many loggers at a glance: who comes and goes, and a summary of each, without asking again and again.

One session per configuration, whatever the number of robots behind it (`silo.fleet.link`); one to the socket of each
logger of this computer. Each way has a thread, so that one that is silent holds up no other; `Fleet.now` never waits.
Who looks once, as `silo ls` does and every command that is given a name, has the same with another plan.
"""

import logging
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from silo.errors import SiloError
from silo.fleet.link import FOLLOWING, Change, FleetLink, FleetQuestion
from silo.fleet.member import HELPER_DOWN, Member
from silo.fleet.memory import remember
from silo.fleet.near import Near, down_text, near_loggers
from silo.fleet.routers import RouterTold
from silo.net.found import LoggerAddress
from silo.net.keys import Root
from silo.net.remotes import LOCAL, remotes
from silo.state.requests import Hello
from silo.version import VERSION

SCAN_S = 1.0  # how often is looked for sockets and remotes
REMEMBER_S = 60.0  # how often it is noted who is there, beside who comes and goes

log = logging.getLogger("silo.client")


@dataclass(frozen=True)
class FleetNow:
    """All loggers, by host and name; `number` counts changes. `unreachable` says of remotes why they aren't reached."""

    number: int = 0
    members: tuple[Member, ...] = ()
    near: Near = field(default_factory=Near)
    unreachable: dict[str, str] = field(default_factory=dict)
    ready: bool = False  # every way has been tried
    routers: tuple[RouterTold, ...] = ()  # that refused logins within the last hour

    def meant(self, pattern: str) -> list[Member]:
        """Return those that a glob, a name or an address means, also those that nobody can reach now."""
        down = (Member(found, problem=down_text(found), mute=HELPER_DOWN) for found in self.near.down)
        return [one for one in (*self.members, *down) if is_meant(one.found, pattern)]


def is_meant(found: LoggerAddress, pattern: str) -> bool:
    """Return whether a glob, a name or an address means a logger; an empty one all."""
    return found.is_meant_by(pattern) or found.matches(pattern)


def looked(config: str, plan: FleetQuestion) -> FleetNow:
    """Look around once: it takes as long as the slowest way, of which each step has its limit.

    Raises ConnectionLostError where `config` can't be reached.
    """
    with Fleet(config, plan) as fleet:
        return fleet.whole()


def surveyed(config: str = "", pattern: str = "", answer_s: float = 1.0) -> FleetNow:
    """Look around once, and ask each that a pattern means for all that there is to say of it, all at the same time.

    Raises ConnectionLostError where `config` can't be reached.
    """
    return looked(
        config, FleetQuestion(Hello(version=VERSION), lambda found: is_meant(found, pattern), answer_s=answer_s)
    )


class Fleet:
    """Knows all loggers that a user can reach, and follows them until it is closed. A context manager."""

    def __init__(self, config: str = "", plan: FleetQuestion = FOLLOWING) -> None:
        """`config` is a remote or a configuration, to look there alone; `local` for this computer alone."""
        self._config, self._plan = config, plan
        self._changed = threading.Condition()
        self._now = FleetNow()
        self._ways: dict[str, FleetLink] = {}
        self._tried: set[str] = set()
        self._members: dict[str, Member] = {}
        self._failed: dict[str, SiloError] = {}  # by way, why it isn't there
        self._near = Near()
        self._routers: dict[Root, RouterTold | None] = {}
        self._noted: frozenset[tuple[str, bool, bool]] = frozenset()
        self._noted_s = 0.0
        self._stop = threading.Event()
        self._again = threading.Event()
        self.attentive = True
        self._thread = threading.Thread(target=self._scan, name="silo-fleet") if plan.follow else None
        if self._thread is not None:
            self._thread.start()
        else:
            self._look()

    def now(self) -> FleetNow:
        """Return what is known."""
        return self._now

    def wait(self, number: int, timeout_s: float) -> FleetNow:
        """Return what is known as soon as it is newer than change `number`, or after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._now.number != number or self._stop.is_set(), timeout_s)
            return self._now

    def wait_ready(self, timeout_s: float, answers_s: float = 0.5) -> FleetNow:
        """Return what is known once every way was tried, or after the timeout.

        Those that are there have `answers_s` more to say how they stand.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._now.ready or self._stop.is_set(), timeout_s)
            self._changed.wait_for(lambda: all(one.told for one in self._now.members), answers_s)
            return self._now

    def whole(self) -> FleetNow:
        """Return what was found, of who looks once. Raises ConnectionLostError where the only way isn't there."""
        for way in self._ways.values():
            way.thread.join()
        if self._config in self._failed and not (self._now.members or self._now.routers):
            raise self._failed[self._config]
        self._remember()
        return self._now

    def attend(self, *, attentive: bool) -> None:
        """Have summaries come, or only who comes and goes while nobody looks: over a thin link each byte counts."""
        if attentive != self.attentive:
            self.attentive = attentive
            for way in list(self._ways.values()):
                way.again.set()
        if attentive:
            self._again.set()

    def look_again(self) -> None:
        """Forget those that are gone, and try at once what could not be reached."""
        with self._changed:
            for key in [key for key, one in self._members.items() if not one.here]:
                del self._members[key]
            self._tell()
        self._again.set()
        for way in list(self._ways.values()):
            way.again.set()

    def close(self) -> None:
        """End the threads and the sessions; closing twice is fine."""
        self._stop.set()
        self._again.set()
        with self._changed:
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()
        self._end_ways()

    def __enter__(self) -> "Fleet":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --------------------------------------------------------------------------------------------- the ways there are

    def _scan(self) -> None:
        """Look for sockets and remotes, and have a thread for each."""
        main = threading.main_thread()
        while not self._stop.is_set() and main.is_alive():
            self._again.clear()
            try:
                self._look()
            except OSError:
                log.exception("can't look for loggers")
            self._remember()
            self._again.wait(SCAN_S)
        self._remember()
        self._stop.set()
        self._end_ways()

    def _remember(self) -> None:
        """Note whom we see, for who looks later, where that is something new."""
        if self._plan.question is None:
            return
        with self._changed:
            far = [one for one in self._now.members if one.found.config]
            configs = [name for name, way in self._ways.items() if way.far and name in self._tried]
        told = frozenset((one.key, one.here, one.closed or one.dead) for one in far)
        now_s = time.monotonic()
        if configs and (told != self._noted or now_s >= self._noted_s + REMEMBER_S):
            self._noted, self._noted_s = told, now_s
            remember(configs, far)

    def _end_ways(self) -> None:
        for way in self._ways.values():
            way.end()
        for way in self._ways.values():
            way.thread.join()

    def _look(self) -> None:
        wanted: dict[str, LoggerAddress | None] = {}  # by socket a logger of this computer, else a configuration
        near = Near()
        if self._config in ("", LOCAL):
            near = near_loggers()
            asked = self._plan.whom if self._plan.question is not None else lambda _: False
            wanted |= {found.socket: found for found in near.loggers if asked(found)}
        if self._config == "":
            wanted |= dict.fromkeys(remotes())
        elif self._config != LOCAL:
            wanted[self._config] = None
        self._have_ways(wanted)
        now_s = time.monotonic()
        with self._changed:
            self._near = near
            sockets = {found.socket for found in near.loggers}
            for found in near.loggers:  # those that don't answer are seen all the same
                known = self._members.get(found.socket)
                if known is None or (known.found.dead, known.found.host) != (found.dead, found.host):
                    self._put(replace(known, found=found) if known is not None else Member(found, since_s=now_s))
            for key, one in list(self._members.items()):
                if one.found.socket and one.here and key not in sockets:
                    self._members[key] = replace(one, here=False, since_s=now_s)
            self._failed = {name: error for name, error in self._failed.items() if name in wanted}
            self._tried |= {""}
            self._tell()

    def _have_ways(self, wanted: dict[str, LoggerAddress | None]) -> None:
        for name, way in list(self._ways.items()):
            if name not in wanted:
                way.end()
            if not way.thread.is_alive():
                del self._ways[name]
        for name, found in wanted.items():
            if name not in self._ways:
                self._ways[name] = FleetLink(name, found, self, self._plan, patient=name != self._config)

    # ------------------------------------------------------------------------------------------- what the ways report

    def reached(self, name: str, error: SiloError | None, missed: Iterable[Member] = ()) -> None:
        """Note that a way was tried, why it isn't there, and who was behind it before."""
        with self._changed:
            self._tried.add(name)
            here = [one.found for one in self._members.values() if one.here]
            for one in missed:
                if one.key not in self._members and not any(found.follows(one.found) for found in here):
                    self._members[one.key] = one
            if error is not None:
                self._failed[name] = error
            else:
                self._failed.pop(name, None)
            self._tell()

    def change(self, changes: "Iterable[tuple[str, Change]]") -> None:
        """Replace what is known of loggers, by their keys."""
        with self._changed:
            for key, change in changes:
                made = change(self._members.get(key))
                if made is not None:
                    self._put(made)
            self._tell()

    def refused(self, routers: Mapping[Root, RouterTold | None]) -> None:
        """Note what routers refused; None of one that isn't reached."""
        with self._changed:
            self._routers |= routers
            self._tell()

    def _put(self, one: Member) -> None:
        self._members[one.key] = one
        if one.here:  # one that is gone and came back under another key is this one
            for key, other in list(self._members.items()):
                if not other.here and key != one.key and one.found.follows(other.found):
                    del self._members[key]

    def _tell(self) -> None:
        """Make what is known from now on; with the lock."""
        # a logger of this computer that is seen through a router too is one, and the short way is taken
        near = {one.found.root for one in self._members.values() if one.found.socket and one.found.id}
        members = sorted(
            (one for one in self._members.values() if one.found.socket or one.found.root not in near),
            key=lambda one: (one.found.host, one.found.name, one.found.pid, one.found.id),
        )
        ready = self._tried >= {"", *self._ways} and bool(self._tried)
        told = replace(
            self._now, members=tuple(members), near=self._near, ready=ready,
            routers=tuple(one for _, one in sorted(self._routers.items()) if one is not None and one.denied),
            unreachable={name: str(error) for name, error in sorted(self._failed.items())},
        )  # fmt: skip
        if told != self._now:
            self._now = replace(told, number=self._now.number + 1)
            self._changed.notify_all()
