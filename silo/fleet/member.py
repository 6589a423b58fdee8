"""A logger of a fleet, as far as it is known: how it stands, in words, and what of it wants to be looked at first."""

import enum
import functools
from collections.abc import Iterable

import msgspec

from silo.core.elements import SLOW_SHARE, State, Status, is_stalled
from silo.core.names import grouped
from silo.core.quantities.writing import wall_clock
from silo.net.found import LoggerAddress
from silo.rpc.published import Summary

FULL_SHARE = 0.95  # of a disk
NO_TICK, NO_ANSWER, OTHER_SILO, HELPER_DOWN = "no tick", "no answer", "other silo", "helper down"


class Stands(enum.IntEnum):
    """How a logger stands, the worst first."""

    DEAD = 0
    SILENT = 1  # it went without a word, or the link is cut
    STALLED = 2  # it runs, and doesn't tick
    MUTE = 3  # it is there, and tells nothing of itself
    RED = 4  # a limit
    FULL = 5  # its disk, nearly
    YELLOW = 6
    SLOW = 7
    LOST = 8  # samples
    FINE = 9
    CLOSED = 10


class Member(msgspec.Struct, frozen=True, dict=True):
    """A logger of the fleet. `here`: its helper process lives, and so does the link to it.

    `summary` is the newest, from before it was lost as well; None where it gave none, and `problem` says why, `mute` in
    a word. `status` is there where it was asked for all that there is to say. `unwatched`: it went while nobody looked,
    perhaps because it was closed; then nothing is known of it but when it was seen last, which `since_s` says.
    `seen_s` is when it gave its last sign of life, `since_s` since when it is here or not, `told_s` of when its summary
    is (all of `time.monotonic`).
    """

    found: LoggerAddress
    summary: Summary | None = None
    here: bool = True
    problem: str = ""
    seen_s: float = 0.0
    since_s: float = 0.0
    told_s: float = 0.0
    status: Status | None = None
    mute: str = NO_ANSWER
    unwatched: bool = False

    @property
    def key(self) -> str:
        """What tells it from all others."""
        return self.found.key

    @property
    def state(self) -> State | None:
        """The state that it told last."""
        return self.summary.state if self.summary is not None else None

    @property
    def told(self) -> bool:
        """Whether there is anything to show of it."""
        return self.summary is not None or bool(self.problem)

    @property
    def dead(self) -> bool:
        """Whether its program is dead."""
        return self.found.dead if self.summary is None else self.summary.state is State.DEAD

    @property
    def closed(self) -> bool:
        """Whether its program closed it: that it is gone is as it should be."""
        return self.summary is not None and self.summary.closed

    @property
    def down(self) -> bool:
        """Whether it logs, and has no helper process by which it could be reached."""
        return self.mute == HELPER_DOWN

    @property
    def lost(self) -> bool:
        """Whether it went without a word: killed, or the link is cut."""
        return not self.here and not self.closed and not self.dead

    @property
    def word(self) -> str:
        """Its state in a word, as people read it."""
        if self.lost:
            return "silent"
        if self.dead or self.closed:
            return "dead" if self.dead else "closed"
        if self.summary is None:
            return self.mute if self.problem else "..."
        return NO_TICK if self.stalled else self.summary.state.value

    @property
    def stalled(self) -> bool:
        """Whether it runs but doesn't tick: its program is frozen, or doesn't call collect()."""
        one = self.summary
        return one is not None and self.running and is_stalled(one.idle_s, one.frequency_hz)

    def idle_s(self, now_s: float) -> float:
        """Return for how long it has had no tick, where it is stalled; else 0."""
        return self.summary.idle_s + max(0.0, now_s - self.told_s) if self.summary and self.stalled else 0.0

    @property
    def rate(self) -> str:
        """How fast it ticks as far as that was measured, in Hz; `-` where it doesn't run, or nobody knows yet."""
        one = self.summary
        if one is None or not self.running or not (one.measured_hz or self.stalled):
            return "-"
        return f"{0.0 if self.stalled else one.measured_hz:.4g}"

    @property
    def lost_count(self) -> int | None:
        """Samples lost, as it told; None where nobody knows: what counted them went with the program that died."""
        one = self.summary
        return None if one is None or (self.dead and not one.lost) else one.lost

    @property
    def running(self) -> bool:
        """Whether it logs now, as far as is known."""
        return self.here and self.state is State.RUNNING

    @property
    def slow(self) -> bool:
        """Whether it ticks more slowly than it is to."""
        one = self.summary
        return one is not None and self.running and 0 < one.measured_hz < SLOW_SHARE * one.frequency_hz

    @property
    def disk_share(self) -> float | None:
        """How full its disk is, 0 ... 1; None where nobody tells."""
        one = self.summary
        return 1 - one.disk_free_bytes / one.disk_bytes if one is not None and one.disk_bytes else None

    @functools.cached_property
    def stands(self) -> Stands:
        """How it stands: the worst that there is to say."""
        one, full = self.summary, self.disk_share
        if self.dead or self.lost or self.closed:
            return Stands.DEAD if self.dead else Stands.SILENT if self.lost else Stands.CLOSED
        if one is None:
            return Stands.MUTE if self.problem else Stands.FINE
        alarms = Stands.FINE
        if one.alarms:
            from silo.conditions.standing import LimitWord  # which takes long to be loaded

            alarms = Stands.RED if LimitWord(one.alarm).is_red else Stands.YELLOW
        disk = Stands.FULL if full is not None and full >= FULL_SHARE else Stands.FINE
        rate = Stands.STALLED if self.stalled else Stands.SLOW if self.slow else Stands.FINE
        return min(alarms, disk, rate, Stands.LOST if one.lost else Stands.FINE)

    @property
    def sign(self) -> str:
        """The worst in two letters, as lists show it; empty for nothing."""
        signs = {Stands.SLOW: "<<", Stands.LOST: "XX", Stands.FULL: "##", Stands.SILENT: "~~", Stands.MUTE: "~~"}
        signs[Stands.STALLED] = "!!"
        if self.stands in (Stands.RED, Stands.YELLOW) and self.summary is not None:
            return self.summary.alarm
        return signs.get(self.stands, "")

    def run_s(self, now_ns: int) -> float | None:
        """Return for how long it has run; None where it doesn't."""
        one = self.summary
        return (now_ns - one.started_ns) / 1e9 if self.running and one is not None and one.started_ns else None

    def unseen_s(self, now_s: float) -> float:
        """Return for how long it is not here; 0 while it is."""
        return 0.0 if self.here else now_s - self.since_s

    @property
    def people(self) -> list[str]:
        """Who is connected, who has control first, without the programs that they use."""
        one = self.summary
        if one is None or not self.here:
            return []
        names = list(dict.fromkeys(name.split(" ", 1)[0] for name in one.clients))
        control = one.control.split(" ", 1)[0]
        return [f"{control}*", *(name for name in names if name != control)] if control else names


class SilentHost(msgspec.Struct, frozen=True):
    """Loggers of one host that fell silent: as a rule its link is down, and not each of them."""

    host: str
    count: int
    since_s: float  # when the first one did, or was seen last, of `time.monotonic`
    unwatched: bool = False  # nobody looked when they went

    def words(self, now_s: float, now_ns: int) -> str:
        """Return `robot4: 30 loggers unreachable since 14:26:36`."""
        return f"{self.host}: {self.count} loggers {gone_words(self.since_s, now_s, now_ns, unwatched=self.unwatched)}"


def gone_words(since_s: float, now_s: float, now_ns: int, *, unwatched: bool) -> str:
    """Return `unreachable since 14:26:36`, or that of one that went while nobody looked."""
    since = wall_clock(now_ns - int(1e9 * (now_s - since_s)))
    return f"closed or unreachable, last seen {since}" if unwatched else f"unreachable since {since}"


def segments(members: Iterable[Member]) -> list[SilentHost]:
    """Return the hosts of which several loggers fell silent, with how many, by name."""
    silent = grouped((one.found.host, one) for one in members if one.lost and one.found.host)
    return [
        SilentHost(host, len(they), min(one.since_s for one in they), all(one.unwatched for one in they))
        for host, they in sorted(silent.items())
        if len(they) > 1
    ]


def lost_lines(members: Iterable[Member], now_s: float, now_ns: int) -> list[str]:
    """Return a line for each host of which several loggers fell silent, and for each other one that did."""
    lost = [one for one in members if one.lost]
    down = segments(lost)
    hosts = {one.host for one in down}
    single = [
        f"{one.found.addresses[-1]}: {gone_words(one.since_s, now_s, now_ns, unwatched=one.unwatched)}"
        for one in lost
        if one.found.host not in hosts
    ]
    return [*(one.words(now_s, now_ns) for one in down), *single]
