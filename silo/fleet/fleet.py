"""Many loggers at a glance: who comes and goes, and a summary of each, without asking again and again.

One session per configuration, whatever the number of robots behind it (`FleetLink`); one to the socket of each
logger of this computer. Each link has a thread, so that one that is silent holds up no other; `Fleet.now` never waits.
Who looks once, as `silo ls` does and every command that is given a name, has the same with another plan.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from typing import Any

import msgspec
import zenoh
from msgspec.structs import replace

from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError, SegmentError, SiloError, VersionError
from silo.fleet.exchange import client_name, decode_reply, root_at, those_there, those_told
from silo.fleet.many import POLL_S as ANSWERED_S
from silo.fleet.many import Asking
from silo.fleet.member import HELPER_DOWN, NO_ANSWER, OTHER_SILO, Member
from silo.fleet.memory import remember, remembered
from silo.fleet.near import HERE, Near, down_text, near_loggers
from silo.fleet.routers import AskedRouters, RouterTold, told_of
from silo.net import keys
from silo.net.access.probing import REACH_S, Layer, LayerError
from silo.net.configuration import LOCAL, find_file, from_file, remotes, user_of
from silo.net.found import LoggerAddress
from silo.net.session import undeclare
from silo.net.sessions import SessionLease, borrowed
from silo.rpc.declaring import Ask
from silo.rpc.foreign import NOT_UNDERSTOOD
from silo.rpc.leases import Closing
from silo.rpc.published import Summary
from silo.rpc.refusals import checked
from silo.state.requests import GetSummary, Hello, HelloReply, SummaryReply
from silo.version import VERSION

SCAN_S = 1.0  # how often is looked for sockets and remotes
REMEMBER_S = 60.0  # how often it is noted who is there, beside who comes and goes
POLL_S = 0.1
IDLE_S = 0.5  # while nobody looks
LOOK_S = 1.0  # how often is looked whether the link is there
RETRY_S = 1.0
PATIENCE = 5  # who looks again and again spends a sixth of the time on a remote that is silent
LONGEST_PAUSE_S = 50.0
ANSWER_S = 2.0
SETTLED_S = 0.5  # in which a subscription tells of those that are there
# in which it is looked again where nobody is: beside a subscription that begins Zenoh says so of everybody
NOBODY_S = 0.3
AGAIN_S = 5.0  # until who gave no answer is asked once more
MOST = 4096  # that may come within a look

log = logging.getLogger("silo.client")

Change = Callable[[Member | None], Member | None]
_decoder = msgpack_decoder(Summary)


class FleetQuestion(msgspec.Struct, frozen=True):
    """What a fleet looks for: once, or following; `question` is asked of each whom `whom` means, None asks nobody.

    Sessions to remotes stay open until `holding` is closed, where there is one, for what is to be asked next.
    """

    question: Ask[Any] | None  # GetSummary, or Hello for all that there is to say
    whom: Callable[[LoggerAddress], bool] = lambda _: True
    follow: bool = False
    answer_s: float = ANSWER_S
    reach_s: float = REACH_S
    holding: ExitStack | None = None


# it looks for a link again and again, and is to end soon
FOLLOWING = FleetQuestion(GetSummary(), follow=True, reach_s=2.0)


class _Failure(msgspec.Struct, frozen=True):
    """Why a remote was not reached, and until when nobody tries it again without being told to."""

    error: SiloError
    until_s: float = 0.0


_failed: dict[str, _Failure] = {}  # by configuration, of all fleets of this process


class FleetNow(msgspec.Struct, frozen=True):
    """All loggers, by host and name; `number` counts changes. `unreachable` says of remotes why they aren't reached."""

    number: int = 0
    members: tuple[Member, ...] = ()
    near: Near = msgspec.field(default_factory=Near)
    unreachable: dict[str, str] = msgspec.field(default_factory=dict)
    ready: bool = False  # every link has been tried
    routers: tuple[RouterTold, ...] = ()  # that refused logins within the last hour

    def meant(self, pattern: str) -> list[Member]:
        """Return those that a glob, a name or an address means, also those that nobody can reach now."""
        down = (Member(found, problem=down_text(found), mute=HELPER_DOWN) for found in self.near.down)
        return [one for one in (*self.members, *down) if one.found.matches(pattern)]


def looked(config: str, plan: FleetQuestion) -> FleetNow:
    """Look around once: it takes as long as the slowest link, of which each step has its limit.

    Raises ConnectionLostError where `config` can't be reached.
    """
    with Fleet(config, plan) as fleet:
        return fleet.whole()


def asked_all(config: str = "", pattern: str = "", answer_s: float = 1.0) -> FleetNow:
    """Look around once, and ask each that a pattern means for all that there is to say of it, all at the same time.

    Raises ConnectionLostError where `config` can't be reached.
    """
    return looked(
        config, FleetQuestion(Hello(version=VERSION), lambda found: found.matches(pattern), answer_s=answer_s)
    )


class Fleet(Closing):
    """Knows all loggers that a user can reach, and follows them until it is closed. A context manager."""

    def __init__(self, config: str = "", plan: FleetQuestion = FOLLOWING) -> None:
        """`config` is a remote or a configuration, to look there alone; `local` for this computer alone."""
        self._config, self._plan = config, plan
        self._changed = threading.Condition()
        self._now = FleetNow()
        self._links: dict[str, FleetLink] = {}
        self._tried: set[str] = set()
        self._members: dict[str, Member] = {}
        self._failed: dict[str, SiloError] = {}  # by link, why it isn't there
        self._near = Near()
        self._routers: dict[keys.Root, RouterTold | None] = {}
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

    def wait_ready(self, timeout_s: float) -> FleetNow:
        """Return what is known once every link was tried, or after the timeout.

        Those that are there have half a second more to say how they stand.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._now.ready or self._stop.is_set(), timeout_s)
            self._changed.wait_for(lambda: all(one.told for one in self._now.members), 0.5)
            return self._now

    def whole(self) -> FleetNow:
        """Return what was found, of who looks once. Raises ConnectionLostError where the only link isn't there."""
        for link in self._links.values():
            link.thread.join()
        if self._config in self._failed and not (self._now.members or self._now.routers):
            raise self._failed[self._config]
        self._remember()
        return self._now

    def attend(self, *, attentive: bool) -> None:
        """Have summaries come, or only who comes and goes while nobody looks: over a thin link each byte counts."""
        if attentive != self.attentive:
            self.attentive = attentive
            for link in list(self._links.values()):
                link.again.set()
        if attentive:
            self._again.set()

    def look_again(self) -> None:
        """Forget those that are gone, and try at once what could not be reached."""
        with self._changed:
            for key in [key for key, one in self._members.items() if not one.here]:
                del self._members[key]
            self._tell()
        self._again.set()
        for link in list(self._links.values()):
            link.again.set()

    def close(self) -> None:
        """End the threads and the sessions; closing twice is fine."""
        self._stop.set()
        self._again.set()
        with self._changed:
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()
        self._end_links()

    # --------------------------------------------------------------------------------------------- the links there are

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
        self._end_links()

    def _remember(self) -> None:
        """Note whom we see, for who looks later, where that is something new."""
        if self._plan.question is None:
            return
        with self._changed:
            far = [one for one in self._now.members if one.found.config]
            configs = [name for name, link in self._links.items() if link.far and name in self._tried]
        told = frozenset((one.key, one.here, one.closed or one.dead) for one in far)
        now_s = time.monotonic()
        if configs and (told != self._noted or now_s >= self._noted_s + REMEMBER_S):
            self._noted, self._noted_s = told, now_s
            remember(configs, far)

    def _end_links(self) -> None:
        for link in self._links.values():
            link.end()
        for link in self._links.values():
            link.thread.join()

    def _look(self) -> None:
        wanted: dict[str, LoggerAddress | None] = {}  # by socket a logger of this computer, else a configuration
        near = Near()
        if self._config in ("", LOCAL):
            near = self._near_loggers()
            asked = self._plan.whom if self._plan.question is not None else lambda _: False
            wanted |= {found.socket: found for found in near.loggers if asked(found)}
        if self._config == "":
            wanted |= dict.fromkeys(remotes())
        elif self._config != LOCAL:
            wanted[self._config] = None
        self._have_links(wanted)
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
            self._failed = {name: error for name, error in self._failed.items() if name in wanted or name == HERE}
            self._tried |= {""}
            self._tell()

    def _near_loggers(self) -> Near:
        """Return those of this computer; who follows goes on where they can't be looked for, and tells why."""
        try:
            near = near_loggers()
        except SegmentError as error:
            if not self._plan.follow:
                raise
            self._failed[HERE] = error
            return self._near
        self._failed.pop(HERE, None)
        return near

    def _have_links(self, wanted: dict[str, LoggerAddress | None]) -> None:
        for name, link in list(self._links.items()):
            if name not in wanted:
                link.end()
            if not link.thread.is_alive():
                del self._links[name]
        for name, found in wanted.items():
            if name not in self._links:
                self._links[name] = FleetLink(name, found, self, self._plan, patient=name != self._config)

    # ------------------------------------------------------------------------------------------- what the links report

    def reached(self, name: str, error: SiloError | None, missed: Iterable[Member] = ()) -> None:
        """Note that a link was tried, why it isn't there, and who was behind it before."""
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

    def refused(self, routers: Mapping[keys.Root, RouterTold | None]) -> None:
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
        # a logger of this computer that is seen through a router too is one, and the shorter one is taken
        near = {one.found.root for one in self._members.values() if one.found.socket and one.found.id}
        members = sorted(
            (one for one in self._members.values() if one.found.socket or one.found.root not in near),
            key=lambda one: (one.found.host, one.found.name, one.found.pid, one.found.id),
        )
        ready = self._tried >= {"", *self._links} and bool(self._tried)
        told = replace(
            self._now, members=tuple(members), near=self._near, ready=ready,
            routers=tuple(one for _, one in sorted(self._routers.items()) if one is not None and one.denied),
            unreachable={name: str(error) for name, error in sorted(self._failed.items())},
        )  # fmt: skip
        if told != self._now:
            self._now = replace(told, number=self._now.number + 1)
            self._changed.notify_all()


# ----------------------------------------------------------------------------------------------------- one link


class FleetLink:
    """A thread with one session: to the logger `found` of this computer, or to the configuration `name`."""

    def __init__(
        self, name: str, found: LoggerAddress | None, told: "Fleet", plan: FleetQuestion, *, patient: bool
    ) -> None:
        """Who is `patient` leaves a remote alone for a while that didn't answer."""
        self._name, self._found, self._told, self._plan, self._patient = name, found, told, plan, patient
        self._question = plan.question and replace(plan.question, client=client_name())
        self._stop = threading.Event()
        self.again = threading.Event()
        self._here: dict[str, keys.Root] = {}  # by the key of its member, who has a token now
        self._routers: set[keys.Root] = set()  # that told what they refused
        self._silent: dict[str, float] = {}  # by key, when one that gave no answer is asked again
        self._reached, self._first = False, True
        self.thread = threading.Thread(target=self._run, name="silo-fleet link")
        self.thread.start()

    @property
    def far(self) -> bool:
        """Whether it leads to a configuration, and not to a logger of this computer."""
        return self._found is None

    def end(self) -> None:
        """Have the thread end."""
        self._stop.set()
        self.again.set()

    def _run(self) -> None:
        main = threading.main_thread()
        known = _failed.get(self._name)
        if not self._plan.follow and self._patient and known is not None and time.monotonic() < known.until_s:
            self._reach(known.error)
            return
        while not self._stop.is_set():
            begun_s, self._reached = time.monotonic(), False
            try:
                self._visit(main)
                _failed.pop(self._name, None)
            except SiloError as error:
                self._fail(error, time.monotonic() - begun_s)
            except zenoh.ZError as error:
                self._fail(ConnectionLostError(f"the session ended: {error}"), 0.0)
            if not self._plan.follow:
                return
            self._lose(list(self._here))
            self._told.refused(dict.fromkeys(self._routers))
            if self._stop.is_set() or not main.is_alive():
                return
            failure = _failed.get(self._name)
            self.again.wait(max(RETRY_S, failure.until_s - time.monotonic() if failure is not None else 0.0))
            self.again.clear()

    def _reach(self, error: SiloError | None) -> None:
        """Say that the link was tried; the first time, after who is there, also who was behind it before."""
        first, self._first = self._first, False
        missed = remembered(self._name) if first and self.far and self._question is not None else []
        self._told.reached(self._name, error, missed)

    def _fail(self, error: SiloError, took_s: float) -> None:
        if self._found is None:
            pause_s = 0.0 if self._reached else min(PATIENCE * took_s, LONGEST_PAUSE_S)
            _failed[self._name] = _Failure(error, time.monotonic() + pause_s)
            self._reach(error)
            return
        found = self._found
        self._told.change([(found.socket, lambda known: _failing(error)(known or Member(found)))])
        self._reach(None)

    def _visit(self, main: threading.Thread) -> None:
        """Have a session, and use it. Raises SiloError, ZError."""
        socket, config = (self._found.socket, "") if self._found else ("", self._name)
        with ExitStack() as here:
            holding = self._plan.holding if self._plan.holding is not None and config else here
            mine = holding.enter_context(borrowed(socket, config, self._plan.reach_s))
            self._reached = True
            if self._plan.follow:
                self._follow(mine, main)
            else:
                self._look(mine)

    # ------------------------------------------------------------------------------------------------------- a look

    def _look(self, mine: SessionLease) -> None:
        """Say who is there, and what they answer. Raises SiloError, ZError."""
        if self._found is not None:
            there = [root_at(mine, self._found, self._plan.answer_s)]
        else:
            there = who_is_there(mine, keys.ANY_ALIVE, self._plan.answer_s)
        # who began to follow in the same session just now has every answer be overtaken for a while
        asking = Asking(mine, self._plan.answer_s, patient=bool(mine.followed))
        routers = self._ask_routers(mine)
        self._come(there, asking)
        while asking.count or (routers is not None and not routers.done):
            self._take_answers(asking)
            self._take_routers(routers)
            time.sleep(ANSWERED_S)
        self._reach(self._problem(mine.session))

    # ---------------------------------------------------------------------------------------------------- following

    def _follow(self, mine: SessionLease, main: threading.Thread) -> None:
        """Follow who comes, who goes and what they say, until the link is given up. Raises SiloError, ZError."""
        answer_s = self._plan.answer_s
        session, root = mine.session, root_at(mine, self._found, answer_s) if self._found is not None else None
        alive = root.key("alive") if root is not None else keys.ANY_ALIVE
        summary = root.key("summary") if root is not None else keys.ANY_SUMMARY
        declared: list[Any] = []
        summaries: Any = None
        try:
            with mine.looking:
                # Those that are there already have an end, which a subscription has not. Until Zenoh has come to terms
                # with a subscription it tells who asks that nobody is there: 29 of 40 sessions, for up to 0.2 s.
                there = those_there(mine, alive, answer_s)
                tokens = session.liveliness().declare_subscriber(alive, zenoh.handlers.RingChannel(MOST), history=True)
                declared.append(tokens)
                news = _history(tokens, there, SETTLED_S + mine.slack_s)
                _settle(mine, alive, len(there), answer_s)
                self._note(there)
                mine.followed[self] = self._here
            asking = Asking(mine, answer_s)
            routers = self._ask_routers(mine)
            looked_s = 0.0
            while not self._stop.is_set() and main.is_alive():
                now_s = time.monotonic()
                if now_s - looked_s >= LOOK_S:
                    looked_s = now_s
                    self._reach(self._problem(session))  # first: where no link was tried nobody is noted who goes
                    self._ask_again(asking, now_s)
                if self._told.attentive and summaries is None:
                    # before anybody is asked: what is told between its answer and this must not be missed
                    summaries = session.declare_subscriber(summary, zenoh.handlers.RingChannel(MOST))
                    for key in self._here:
                        self._ask(key, asking)
                elif not self._told.attentive and summaries is not None:
                    undeclare(summaries)
                    summaries = None
                while (sample := tokens.try_recv()) is not None:
                    news.append(sample)
                if summaries is not None:
                    self._take_summaries(summaries)  # first: who goes has said before that it is closed
                self._take_tokens(news, asking)
                news = []
                self._take_answers(asking)
                self._take_routers(routers)
                idle_s = POLL_S if self._told.attentive else IDLE_S
                self.again.wait(idle_s if not asking.count else POLL_S / 10)
                self.again.clear()
        finally:
            mine.followed.pop(self, None)
            undeclare(*declared, summaries)

    def _problem(self, session: zenoh.Session) -> SiloError | None:
        """Why nobody is seen here; None where somebody is."""
        if self._found is not None or self._here:
            return None
        if not session.info.routers_zid() and not session.info.peers_zid():
            text = f"{self._name}: the link is cut, or what it leads to has ended; connecting again by itself"
            return ConnectionLostError(text)
        return LayerError(Layer.ROLE, _nobody_there(self._name, session))

    def _take_tokens(self, news: list[zenoh.Sample], asking: Asking) -> None:
        gone = []
        for sample in news:
            root = keys.robot_of(str(sample.key_expr))
            if root is None:
                continue
            if sample.kind == zenoh.SampleKind.PUT:
                self._come([root], asking)
            else:
                gone.append(self._key(root))
        self._lose(gone)

    def _key(self, root: keys.Root) -> str:
        return self._found.socket if self._found is not None else str(root)

    def _found_at(self, root: keys.Root) -> LoggerAddress:
        if self._found is not None:
            return replace(self._found, host=root.host, id=root.id)
        return LoggerAddress.behind(self._name, root)

    def _come(self, roots: Iterable[keys.Root], asking: Asking) -> None:
        new = self._note(roots)
        if self._told.attentive:
            for key in new:
                self._ask(key, asking)

    def _note(self, roots: Iterable[keys.Root]) -> list[str]:
        """Note who is there; return the keys of those who were not."""
        now_s, changes = time.monotonic(), []
        for root in roots:
            key = self._key(root)
            if key not in self._here:
                self._here[key] = root
                changes.append((key, _coming(self._found_at(root), now_s)))
        if changes:
            self._told.change(changes)
        return [key for key, _ in changes]

    def _lose(self, gone: list[str]) -> None:
        now_s = time.monotonic()
        changes: list[tuple[str, Change]] = []
        for key in gone:
            if self._here.pop(key, None) is not None:
                self._silent.pop(key, None)
                changes.append((key, lambda known: known and replace(known, here=False, since_s=now_s)))
        if changes:
            self._told.change(changes)

    def _take_summaries(self, summaries: Any) -> None:
        newest: dict[str, Summary] = {}
        routers: dict[keys.Root, RouterTold] = {}
        while (sample := summaries.try_recv()) is not None:
            try:
                found = _decoder.decode(sample.payload.to_bytes())
            except NOT_UNDERSTOOD:
                continue  # of a silo that says it otherwise: its row says what was asked for
            root = keys.robot_of(str(sample.key_expr))
            if root is not None and (told := told_of(root, found)) is not None:
                routers[root] = told
            elif root is not None:
                newest[self._key(root)] = found
        self._note_routers(routers)
        if newest:
            self._told.change([(key, _saying(found)) for key, found in newest.items()])

    # ------------------------------------------------------------------------------------------------- the questions

    def _ask(self, key: str, asking: Asking) -> None:
        root = self._here[key]
        if self._question is not None and self._plan.whom(self._found_at(root)):
            asking.add(key, root, self._question)

    def _ask_routers(self, mine: SessionLease) -> AskedRouters | None:
        return AskedRouters(mine, self._plan.answer_s) if self.far and self._question is not None else None

    def _take_routers(self, routers: AskedRouters | None) -> None:
        if routers is not None:
            self._note_routers(routers.poll())

    def _note_routers(self, found: Mapping[keys.Root, RouterTold]) -> None:
        if found:
            self._routers |= found.keys()
            self._told.refused(found)

    def _ask_again(self, asking: Asking, now_s: float) -> None:
        for key in [key for key, due_s in self._silent.items() if now_s >= due_s]:
            del self._silent[key]
            self._ask(key, asking)

    def _take_answers(self, asking: Asking) -> None:
        changes: list[tuple[str, Change]] = []
        for key, payload in asking.poll():
            root = self._here.get(key)
            if root is None or self._question is None:
                continue  # gone meanwhile
            who = f"logger '{self._found.name if self._found is not None else root.address}'"
            try:
                if payload is None:
                    raise ConnectionLostError(f"{who} {self._silence}")
                changes.append(
                    (key, _answering(checked(self._question, decode_reply(payload, who, type(self._question)))))
                )
            except SiloError as error:
                self._silent[key] = time.monotonic() + AGAIN_S
                changes.append((key, _failing(error)))
        if changes:
            self._told.change(changes)

    @property
    def _silence(self) -> str:
        """What it means that no answer came."""
        if self._found is not None:
            answer_s = self._plan.answer_s
            return f"did not answer within {answer_s:g} s: its helper process is frozen or overloaded; try again"
        return "gave no answer: its helper process is frozen, overloaded or gone, or no role lets this user ask"


# ------------------------------------------------------------------------------------------------------- who is there


def who_is_there(mine: SessionLease, alive: str, timeout_s: float) -> list[keys.Root]:
    """Return whose tokens are there, sorted; where nobody is, it is looked again for a moment."""
    with mine.looking:
        roots = those_there(mine, alive, timeout_s)
        until_s = time.monotonic() + NOBODY_S + mine.slack_s
        while not roots and time.monotonic() < until_s:
            time.sleep(NOBODY_S / 10)
            roots = those_there(mine, alive, timeout_s)
    return roots


def _nobody_there(config: str, session: zenoh.Session) -> str:
    """What it means that a session by a configuration sees no logger."""
    user = user_of(from_file(find_file(config)))
    who = f"user '{user}' is let in" if user else "we are let in without a user name"
    nobody = "no robot is connected to this router now, or " if session.info.routers_zid() else ""
    rules = f"{nobody}the rules (access_control) on the other side give it no role"
    return f"{config}: {who}, but sees no logger: {rules}"


def _settle(mine: SessionLease, alive: str, count: int, timeout_s: float) -> None:
    """Wait until who asks is told of so many again; one that went meanwhile is waited for no longer than that takes."""
    until_s = time.monotonic() + SETTLED_S + mine.slack_s
    while len(those_told(mine, alive, timeout_s)) < count and time.monotonic() < until_s:
        time.sleep(POLL_S / 10)


def _history(tokens: Any, there: list[keys.Root], timeout_s: float) -> list[zenoh.Sample]:
    """Return what a subscription tells until it has told of all who are there."""
    news: list[zenoh.Sample] = []
    missing, until_s = set(there), time.monotonic() + timeout_s
    while missing and time.monotonic() < until_s:
        if (sample := tokens.try_recv()) is None:
            time.sleep(POLL_S / 50)
            continue
        news.append(sample)
        missing.discard(keys.robot_of(str(sample.key_expr)))
    return news


# ------------------------------------------------------------------------------------------------- what becomes known


def _coming(found: LoggerAddress, now_s: float) -> Change:
    def come(known: Member | None) -> Member:
        before = known or Member(found)
        return replace(before, found=found, here=True, problem="", seen_s=now_s, since_s=now_s, unwatched=False)

    return come


def _answering(reply: HelloReply | SummaryReply) -> Change:
    if isinstance(reply, SummaryReply):
        return _saying(reply.summary)
    status, summary = reply.status, _saying(Summary.of(reply.status))
    return lambda known: (told := summary(known)) and replace(told, status=status)


def _saying(found: Summary) -> Change:
    now_s = time.monotonic()
    return lambda known: known and replace(known, summary=found, problem="", seen_s=now_s, told_s=now_s)


def _failing(error: SiloError) -> Change:
    mute = OTHER_SILO if isinstance(error, VersionError) else NO_ANSWER
    return lambda known: known and replace(known, problem=str(error), mute=mute)
