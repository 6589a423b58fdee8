"""A way of a fleet: one session, and the loggers behind it, in a thread.

A subscription to their liveliness tokens, one to their summaries, and one question to each that has just come: nobody
is asked again and again, and what is told at first costs one round trip whatever their number.
"""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Protocol

import msgspec
import zenoh

from silo.errors import SiloError
from silo.ipc import keys
from silo.ipc.asking import Asking
from silo.ipc.discovery import nobody_there, those_there
from silo.ipc.exchange import checked_reply, client_name, decode_reply, root_at
from silo.ipc.foreign import NOT_UNDERSTOOD
from silo.ipc.found import Found
from silo.ipc.member import Member
from silo.ipc.messages import GetSummary
from silo.ipc.published import Summary
from silo.ipc.sessions import Borrowed, borrowed, undeclare

POLL_S = 0.1
IDLE_S = 0.5  # while nobody looks
LOOK_S = 1.0  # how often is looked whether the link is there
RETRY_S = 1.0
REACH_S = 2.0  # it looks for a way again and again, and is to end soon
PATIENCE = 5  # who looks again and again spends a sixth of the time on a remote that is silent
ANSWER_S = 2.0
SETTLED_S = 0.5  # in which a subscription tells of those that are there
AGAIN_S = 5.0  # until who gave no answer is asked once more
MOST = 4096  # that may come within a look

Change = Callable[[Member | None], Member | None]
_decoder = msgspec.msgpack.Decoder(Summary)


class Told(Protocol):
    """Who gathers what the ways report. `attentive`: somebody looks at summaries."""

    attentive: bool

    def reached(self, name: str, why: str) -> None:
        """Note that a way was tried, and why it isn't there."""

    def change(self, changes: Iterable[tuple[str, Change]]) -> None:
        """Replace what is known of loggers, by their keys."""


class Way:
    """A thread with one session: to the logger `found` of this computer, or to the configuration `name`."""

    def __init__(self, name: str, found: Found | None, told: Told) -> None:
        self._name, self._found, self._told = name, found, told
        self._stop = threading.Event()
        self.again = threading.Event()
        self._here: dict[str, keys.Root] = {}  # by the key of its member, who has a token now
        self._silent: dict[str, float] = {}  # by key, when one that gave no answer is asked again
        self._who = client_name()
        self.thread = threading.Thread(target=self._run, name="silo-fleet way")
        self.thread.start()

    def end(self) -> None:
        """Have the thread end."""
        self._stop.set()
        self.again.set()

    def _run(self) -> None:
        main = threading.main_thread()
        while not self._stop.is_set():
            begun_s, took_s = time.monotonic(), 0.0
            try:
                socket, config = (self._found.socket, "") if self._found else ("", self._name)
                with borrowed(socket, config, REACH_S) as mine:
                    self._follow(mine, main)
            except SiloError as error:
                took_s = time.monotonic() - begun_s
                self._fail(str(error))
            except zenoh.ZError as error:
                self._fail(f"the session ended: {error}")
            self._lose(list(self._here))
            if self._stop.is_set() or not main.is_alive():
                return
            self.again.wait(max(RETRY_S, PATIENCE * min(took_s, 10.0)))
            self.again.clear()

    def _fail(self, why: str) -> None:
        if self._found is None:
            self._told.reached(self._name, why)
            return
        found = self._found
        self._told.change([(found.socket, lambda known: replace(known or Member(found), problem=why))])
        self._told.reached(self._name, "")

    # ------------------------------------------------------------------------------------------------- one session

    def _follow(self, mine: Borrowed, main: threading.Thread) -> None:
        """Follow who comes, who goes and what they say, until the way is given up. Raises SiloError, ZError."""
        session, root = mine.session, root_at(mine, self._found, ANSWER_S) if self._found is not None else None
        alive = root.key("alive") if root is not None else keys.ANY_ALIVE
        summary = root.key("summary") if root is not None else keys.ANY_SUMMARY
        declared: list[Any] = []
        summaries: Any = None
        try:
            with mine.looking:
                # Those that are there already have an end, which a subscription has not. Until Zenoh has come to terms
                # with a subscription it tells who asks that nobody is there: 29 of 40 sessions, for up to 0.2 s.
                there = those_there(mine, alive, ANSWER_S)
                tokens = session.liveliness().declare_subscriber(alive, zenoh.handlers.RingChannel(MOST), history=True)
                declared.append(tokens)
                news = _history(tokens, there, SETTLED_S + mine.slack_s)
                _settle(mine, alive, len(there))
            asking: Asking[str] = Asking(mine, ANSWER_S)
            looked_s = 0.0
            while not self._stop.is_set() and main.is_alive():
                if self._told.attentive and summaries is None:
                    # before anybody is asked: what is told between its answer and this must not be missed
                    summaries = session.declare_subscriber(summary, zenoh.handlers.RingChannel(MOST))
                    for key in self._here:
                        self._ask(key, asking)
                elif not self._told.attentive and summaries is not None:
                    undeclare(summaries)
                    summaries = None
                for found in there:
                    self._come(found, asking)
                while (sample := tokens.try_recv()) is not None:
                    news.append(sample)
                self._take_tokens(news, asking)
                there, news = [], []
                if summaries is not None:
                    self._take_summaries(summaries)
                self._take_answers(asking)
                now_s = time.monotonic()
                if now_s - looked_s >= LOOK_S:
                    looked_s = now_s
                    self._told.reached(self._name, self._problem(session))
                    self._ask_again(asking, now_s)
                idle_s = POLL_S if self._told.attentive else IDLE_S
                self.again.wait(idle_s if not asking.count else POLL_S / 10)
                self.again.clear()
        finally:
            undeclare(*declared, summaries)

    def _problem(self, session: zenoh.Session) -> str:
        """Why nobody is seen here; empty where somebody is."""
        if self._found is not None or self._here:
            return ""
        if not session.info.routers_zid() and not session.info.peers_zid():
            return f"{self._name}: the link is cut, or what it leads to has ended; connecting again by itself"
        return nobody_there(self._name, session)

    def _take_tokens(self, news: list[zenoh.Sample], asking: Asking[str]) -> None:
        gone = []
        for sample in news:
            root = keys.robot_of(str(sample.key_expr))
            if root is None:
                continue
            if sample.kind == zenoh.SampleKind.PUT:
                self._come(root, asking)
            else:
                gone.append(self._key(root))
        self._lose(gone)

    def _key(self, root: keys.Root) -> str:
        return self._found.socket if self._found is not None else str(root)

    def _come(self, root: keys.Root, asking: Asking[str]) -> None:
        key = self._key(root)
        if key in self._here:
            return
        self._here[key] = root
        now_s = time.monotonic()
        if self._found is not None:
            found = replace(self._found, host=root.host, id=root.id)
        else:
            found = Found(root.logger, 0, "", "", self._name, root.host, id=root.id)

        def come(known: Member | None) -> Member:
            before = known or Member(found)
            return replace(before, found=found, here=True, problem="", seen_s=now_s, since_s=now_s)

        self._told.change([(key, come)])
        if self._told.attentive:
            self._ask(key, asking)

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
        while (sample := summaries.try_recv()) is not None:
            try:
                found = _decoder.decode(sample.payload.to_bytes())
            except NOT_UNDERSTOOD:
                continue  # of a silo that says it otherwise: its row says what was asked for
            root = keys.robot_of(str(sample.key_expr))
            if root is not None:
                newest[self._key(root)] = found
        if newest:
            self._told.change([(key, _saying(found)) for key, found in newest.items()])

    # ------------------------------------------------------------------------------------------------- the questions

    def _ask(self, key: str, asking: Asking[str]) -> None:
        asking.add(key, self._here[key], GetSummary(client=self._who))

    def _ask_again(self, asking: Asking[str], now_s: float) -> None:
        for key in [key for key, due_s in self._silent.items() if now_s >= due_s]:
            del self._silent[key]
            self._ask(key, asking)

    def _take_answers(self, asking: Asking[str]) -> None:
        changes: list[tuple[str, Change]] = []
        for key, payload in asking.poll():
            root = self._here.get(key)
            if root is None:
                continue  # gone meanwhile
            try:
                changes.append((key, _saying(_summary(payload, root.address))))
            except SiloError as error:
                self._silent[key] = time.monotonic() + AGAIN_S
                changes.append((key, _failing(str(error))))
        if changes:
            self._told.change(changes)


def _settle(mine: Borrowed, alive: str, count: int) -> None:
    """Wait until who asks is told of so many again; one that went meanwhile is waited for no longer than that takes."""
    until_s = time.monotonic() + SETTLED_S + mine.slack_s
    while len(those_there(mine, alive, ANSWER_S)) < count and time.monotonic() < until_s:
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


def _saying(found: Summary) -> Change:
    now_s = time.monotonic()
    return lambda known: known and replace(known, summary=found, problem="", seen_s=now_s, told_s=now_s)


def _failing(why: str) -> Change:
    return lambda known: known and replace(known, problem=why)


def _summary(payload: bytes | None, who: str) -> Summary:
    """Return what an answer says. Raises ConnectionLostError for none, RefusedError and the like."""
    if payload is None:
        raise SiloError(f"{who} gives no answer: its helper process is frozen or overloaded, or no role lets us ask it")
    question = GetSummary()
    return checked_reply(question, decode_reply(payload, who)).summary
