"""Episodes as they stand among the marks of a run, and what those marks say.

episode "pick" begin {"object":"cup"}     more facts, if they don't fit: episode "pick" about {...}
episode "pick" end good                   or `end bad: ValueError: no grip`, or `end` alone
episode "pick" redo                       what somebody says of the newest one: good, bad, redo

So they are kept as marks are: in shared memory at once, in every file, part and capture. An episode begins with the
tick after its first mark and ends with that of its last one.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import msgspec
import numpy as np

from silo.core.arguments import line, shown
from silo.core.elements import MARKER, STARTED, LoggedEvent
from silo.decoding import json_decoder
from silo.errors import ElementError

MOST_BYTES = 200  # of a mark of an episode: it fits into a slot of the segment and through a client's request
NAME_BYTES = 60
GOOD, BAD, REDO = VERDICTS = ("good", "bad", "redo")
BEGIN, ABOUT, END = "begin", "about", "end"

Fact = str | int | float | bool
_MARK = re.compile(r'episode ("(?:[^"\\]|\\.)*") (begin|about|end|good|bad|redo)(?:(?: |: )(.*))?', re.DOTALL)
_ENCODE = msgspec.json.Encoder().encode


class ToldEvent(Protocol):
    """A line of what happened: `silo.core.elements.LoggedEvent`, or one of those that an index keeps."""

    @property
    def kind(self) -> str:
        """Of which marks alone count."""

    @property
    def text(self) -> str:
        """The words."""

    @property
    def tick(self) -> int:
        """Since the start of the run."""

    @property
    def who(self) -> str:
        """A client as it names itself, or the logger."""


@dataclass(frozen=True)
class Episode:
    """A stretch of a run.

    Attributes:
        name: what was done.
        first: its first tick since the start of the run; where its beginning isn't known, 0.
        last: its last tick; where its end isn't known, the newest of the run.
        verdict: `"good"`, `"bad"`, `"redo"` (bad, and to be done again), or empty.
        why: what was said of that: the error that ended it.
        about: what was said of it at its beginning.
        whole: whether it was told where it begins and ends; a program that was killed told no end.
        start_s: where it begins, in seconds since the first tick of the log.
        stop_s: where it ends.
        number: from 0 on within its run.
    """

    name: str
    first: int
    last: int
    verdict: str = ""
    why: str = ""
    about: Mapping[str, Fact] = field(default_factory=dict)
    whole: bool = True
    start_s: float = 0.0
    stop_s: float = 0.0
    number: int = 0

    @property
    def success(self) -> bool | None:
        """Whether it went well; None where nobody said so."""
        return self.verdict == GOOD if self.verdict else None

    @property
    def facts(self) -> dict[str, Fact]:
        """What conditions know of it: `about`, `good`, `bad`, `redo`, and `success`, no where nobody said so."""
        return {**self.about, "success": bool(self.success), **{one: self.verdict == one for one in VERDICTS}}


class Said(msgspec.Struct, frozen=True):
    """What one mark says of an episode: `word` is begin, about, end, or a verdict; `rest` what follows it."""

    name: str
    word: str
    rest: str = ""


def said_by(text: str) -> Said | None:
    """Return what a mark says of an episode, None for any other mark."""
    if not text.startswith("episode ") or (found := _MARK.fullmatch(text)) is None:
        return None
    try:
        return Said(json_decoder(str).decode(found[1]), found[2], found[3] or "")
    except msgspec.MsgspecError:
        return None


def begin_marks(name: object, about: Mapping[str, object]) -> list[str]:
    """Return the marks with which an episode begins. Raises ElementError for words that don't fit into one."""
    called = line("name", name, 'log.episode("pick")').strip()
    if not called or len(called.encode()) > NAME_BYTES:
        raise ElementError(
            f"an episode's name has 1 to {NAME_BYTES} bytes, got {shown(name)}; say more by object='cup'"
        )
    marks: list[str] = []
    word, facts = BEGIN, dict[str, Fact]()
    for key, value in about.items():
        one = value.item() if isinstance(value, np.generic) else value
        given = one if isinstance(one, str | int) or (isinstance(one, float) and math.isfinite(one)) else str(one)
        if len(_mark(called, ABOUT, {key: given}).encode()) > MOST_BYTES:
            raise ElementError(f"{key} of episode '{called}' is too long: {shown(value)}; what doesn't fit is a mark")
        if len(_mark(called, word, {**facts, key: given}).encode()) > MOST_BYTES:
            marks.append(_mark(called, word, facts))
            word, facts = ABOUT, {}
        facts[key] = given
    return [*marks, _mark(called, word, facts)]


def end_mark(name: str, success: bool | None, why: str = "") -> str:
    """Return the mark with which an episode ends."""
    verdict = {True: f" {GOOD}", False: f" {BAD}", None: ""}[success]
    return f"{_mark(name, END)}{verdict}{f': {why}' if why else ''}"


class _Stretch(msgspec.Struct):
    """An episode as marks tell of it, one after another."""

    name: str
    first: int
    who: str = ""  # that began it
    began: bool = True
    about: dict[str, Fact] = msgspec.field(default_factory=dict)
    last: int | None = None
    ended: bool = False
    verdict: str = ""
    why: str = ""
    judged: bool = False  # by what was said apart from its end


def next_marks(
    events: Sequence[LoggedEvent], word: str, name: str = "", about: Mapping[str, object] | None = None
) -> list[str]:
    """Return the marks by which a person says something of an episode of a run: begin, end, good, bad, redo.

    A verdict ends an episode that a person began; one of the program ends when the program says so.

    Args:
        events: the event log of a logger, oldest first; its newest run is meant.
        word: what is said.
        name: of which; the newest if it is empty.
        about: what is to be known of one that begins.

    Raises:
        ElementError: there is no such episode, or a word is none of these.
    """
    if word == BEGIN:
        return begin_marks(name or "episode", about or {})
    if word not in (END, *VERDICTS):
        raise ElementError(f"of an episode one says begin, end, good, bad or redo, got {shown(word)}")
    run = next((event.run for event in reversed(events) if event.kind == STARTED), events[-1].run if events else "")
    stretches = _stretches(event for event in events if event.run == run)
    there = [one for one in stretches if name in ("", one.name) and (one.last is None or word != END)]
    if not there:
        which = f"episode '{name}'" if name else "episode"
        raise ElementError(
            f"no {which} {'goes on' if word == END else f'was begun in this run to say {word} of'}: begin one first"
        )
    one = there[-1]
    if word == END:
        return [_mark(one.name, END)]
    by_person = "@" in one.who  # the program's marks are of its logger, whose name has none
    return [f"{_mark(one.name, END)} {word}" if one.last is None and by_person else _mark(one.name, word)]


def found_episodes(events: Iterable[ToldEvent], ticks: int) -> list[Episode]:
    """Return the episodes that marks tell of, in the order in which they begin; the run has so many ticks.

    What a person says of an episode holds against what its program says.
    """
    return [
        Episode(
            one.name, one.first, ticks - 1 if one.last is None else one.last, one.verdict, one.why, one.about,
            one.began and one.ended, number=number,
        )
        for number, one in enumerate(_stretches(events))
    ]  # fmt: skip


def within_ticks(events: Iterable[LoggedEvent], first: int, last: int) -> list[LoggedEvent]:
    """Return what happened from one tick to another, and the marks of episodes that go on at the first of them."""
    kept: list[LoggedEvent] = []
    going: dict[str, list[LoggedEvent]] = {}
    for event in events:
        if first <= event.tick <= last:
            kept.append(event)
        elif event.tick < first and event.kind == MARKER and (said := said_by(event.text)) is not None:
            if said.word == END:
                going.pop(said.name, None)
            else:
                going[said.name] = [*(going.get(said.name, []) if said.word != BEGIN else []), event]
    return [*(event for some in going.values() for event in some), *kept]


def _stretches(events: Iterable[ToldEvent]) -> list[_Stretch]:
    found: list[_Stretch] = []
    newest: dict[str, _Stretch] = {}

    def begun(one: _Stretch) -> _Stretch:
        found.append(one)
        newest[one.name] = one
        return one

    for event in events:
        said = said_by(event.text) if event.kind == MARKER else None
        if said is None:
            continue
        one = newest.get(said.name)
        if said.word == BEGIN:
            if one is not None and one.last is None:  # its end was never told
                one.last = event.tick
            begun(_Stretch(said.name, event.tick + 1, event.who, about=_facts(said.rest)))
        elif said.word == END:
            if one is None or one.last is not None:  # its beginning was in another run, or is overwritten
                one = begun(_Stretch(said.name, 0, event.who, began=False))
            verdict, _, why = said.rest.partition(": ")
            if verdict in VERDICTS and not one.judged:
                one.verdict, one.why = verdict, why
            one.last, one.ended = event.tick, True
        elif one is not None and said.word == ABOUT:
            one.about |= _facts(said.rest)
        elif one is not None:
            one.verdict, one.why, one.judged = said.word, said.rest, True
    return found


def _mark(name: str, word: str, facts: Mapping[str, Fact] | None = None) -> str:
    text = f"episode {_ENCODE(name).decode()} {word}"
    return f"{text} {_ENCODE(facts).decode()}" if facts else text


def _facts(text: str) -> dict[str, Fact]:
    try:
        return json_decoder(dict[str, Fact]).decode(text)
    except msgspec.MsgspecError:  # somebody else's words, or cut
        return {}
