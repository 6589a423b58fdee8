"""What happened to a logger, as screens show it: a letter per kind, the place in plots, which lines match a filter.

Pure functions on lines of the event log.
"""

import io
import itertools
import re
from collections.abc import Callable, Collection, Sequence
from datetime import datetime, timezone

from msgspec import structs

from silo.core.elements import GOES_ON, LoggedEvent
from silo.core.episodes.words import said_by
from silo.core.quantities.writing import wall_clock
from silo.net.access.senders import short_words
from silo.recordings.requests import SavedRecording
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among

LETTERS = {
    "marker": "M", "triggered": "T", "captured": "T", "started": "S", "stopped": "S", "closed": "S", "edited": "E",
    "script loaded": "E", "lost": "X", "crashed": "X", "blind": "X", "files deleted": "X", "unheld": "X", "limit": "H",
}  # fmt: skip
NAMES = {"M": "marker", "T": "trigger", "S": "start/stop", "E": "edit", "X": "loss", "H": "limit, of any kind"}
EVENT_LINE = "╎"
RANK = "XSTMEH"  # of several in one cell that one is shown which comes first
MOST = 2000  # that a session keeps of limits, and as many of all else: a limit that flickers pushes nothing out
RECORDED = "recording "  # with its name why a part of an endless recording was saved, which names no logger
LIMITS = {"limit", "limit ended"}
WRITTEN = {"saved", "captured", "recovered", "recording", "files deleted"}  # after which other files are there
LONG = 24  # letters of a name that isn't shortened in a line
FOLDED_FROM = 4  # a limit that is crossed, and left, twice


def letter(event: LoggedEvent) -> str:
    """Return the letter of its kind; a space for what is no matter of the data (a save, a journal).

    A cut is how an edit is applied, and no start.
    """
    return "E" if event.text == GOES_ON else LETTERS.get(event.kind, " ")


def words(event: LoggedEvent, shown: Callable[[str], str] = str) -> str:
    """Return what happened: a mark in quotes, as somebody wrote it; all else with names as they are `shown`.

    What is said of an episode is a mark, and has quotes of its own.
    """
    told = text.clean(event.text)
    return f'"{told}"' if event.kind == "marker" and said_by(told) is None else shown(told)


def of_last_run(events: Sequence[LoggedEvent]) -> list[LoggedEvent]:
    """Return what happened in the newest run: only its ticks are on the clock of the plots."""
    run = next((event.run for event in reversed(events) if event.run), "")
    return [event for event in events if event.run == run]


def in_time(events: Sequence[LoggedEvent]) -> list[LoggedEvent]:
    """Return what happened in the order of ticks and of time, run by run, whose clocks may differ.

    A mark is of a moment before it was written, the last limits of a run are told when the next one goes on already.
    What is of no tick stands where the newest one stood when it was told, what is of no run behind all before it.
    """
    ranks: dict[str, int] = {}
    stamps: dict[str, int] = {}  # by run, the newest so far
    places, newest = [], (0, 0, 0)
    for event in events:
        if event.run:
            stamp_ns = event.stamp_ns or stamps.get(event.run, 0)
            stamps[event.run] = max(stamp_ns, stamps.get(event.run, 0))
            place = (ranks.setdefault(event.run, len(ranks)), stamp_ns, event.clock_ns)
        else:
            place = newest
        newest = max(newest, place)
        places.append(place)
    return [event for _, event in sorted(zip(places, events, strict=True), key=lambda one: one[0])]


def folded(events: Sequence[LoggedEvent]) -> list[LoggedEvent]:
    """Return events in time with those of the limits of one signal as one, and the parts that a recording finished.

    Nothing but such came between.

    It is the newest of them, with how many there are in which time; its number is that of the first. How often a value
    was beyond a limit for that newest one is left out: beside the other count nobody could tell which is which.
    """
    found: list[LoggedEvent] = []
    for run, group in itertools.groupby(events, lambda event: event.run if _about(event) else ""):
        by_about: dict[str, list[LoggedEvent]] = {}
        for event in group if run else ():
            by_about.setdefault(_about(event), []).append(event)
        found += in_time([one for like in by_about.values() for one in _fold(like)]) if run else group
    return found


def _about(event: LoggedEvent) -> str:
    """Return the signal whose limits it is about, or the recording of which it tells a part; empty for all else."""
    if event.kind in LIMITS:
        return event.text.split(" ", 1)[0]
    recording, finished, _ = event.text.partition(": finished a part")
    return recording if finished and event.kind == "recording" else ""


def _fold(like: Sequence[LoggedEvent]) -> Sequence[LoggedEvent]:
    if len(like) < FOLDED_FROM:
        return like
    first, last = like[0], like[-1]
    kind = "limit" if last.kind in LIMITS else last.kind  # however the newest of them left it
    newest = last.text.replace(f", {last.times} times", "", 1)
    told = f"{len(like)} events in {text.span((last.clock_ns - first.clock_ns) / 1e9, 2)}: {newest}"
    return [structs.replace(last, kind=kind, text=told, number=first.number, times=len(like))]


def in_plots(
    events: Sequence[LoggedEvent], start_ns: int, end_ns: int, names: Collection[str] | None = None
) -> list[LoggedEvent]:
    """Return what has a letter and stands from one moment to another, both included.

    Of limits only those of the signals `names`, if given: all else happened to every signal.
    """
    found = [event for event in events if start_ns <= event.at_ns <= end_ns and event.kind in LETTERS]
    if names is None:
        return found
    return [event for event in found if event.kind not in LIMITS or _is_of(event, names)]


def _is_of(event: LoggedEvent, names: Collection[str]) -> bool:
    return event.text.split(" ", 1)[0] in names or any(event.text.startswith(f"{name} ") for name in names)


def newest(events: Sequence[LoggedEvent]) -> list[LoggedEvent]:
    """Return the newest MOST limits and the newest MOST of all else, oldest first."""
    if len(events) <= MOST:
        return list(events)
    room = {True: MOST, False: MOST}
    kept = []
    for event in reversed(events):
        is_limit = event.kind in LIMITS
        if room[is_limit]:
            room[is_limit] -= 1
            kept.append(event)
    return kept[::-1]


def columns_of(events: Sequence[LoggedEvent], end: int, column_ns: int, width: int) -> dict[int, str]:
    """Return the letter of each cell that has an event; `end` is the column behind the right edge, two in a cell."""
    found: dict[int, str] = {}
    for event in events:
        if event.kind in LETTERS:
            cell = width - 1 - (end - 1 - event.at_ns // column_ns) // 2
            if 0 <= cell < width:
                found[cell] = min(found.get(cell, "H"), letter(event), key=RANK.index)
    return found


def matches(event: LoggedEvent, asked: str, told: str) -> bool:
    """Return whether a line that says `told` has all the words.

    `-E` leaves a kind out, `M` is that kind, other words stand in the line, its tick or what was written.
    """
    shown = f"{' '.join(_place(event))} {event.tick} {event.kind} {event.text} {told} {event.who}".casefold()
    for word in asked.split():
        without, name = (True, word[1:]) if word.startswith("-") and len(word) > 1 else (False, word)
        found = letter(event) == name if name in NAMES else name.casefold() in shown
        if found == without:
            return False
    return True


KINDS = "MTXHES "
ORDERS: tuple[Order[LoggedEvent], ...] = (
    Order("time", "t", "time, the newest first", lambda event: 0, True),  # as they stand in the list
    Order("kind", "k", "kind: marks, triggers, losses ...", lambda event: (KINDS.find(letter(event)), -event.clock_ns)),
    Order("who", "w", "who did it", lambda event: (event.who.casefold(), -event.clock_ns)),
)


def csv_text(events: Sequence[LoggedEvent]) -> str:
    """Return a line per event: time (UTC, ISO), tick, kind, words, who."""
    import csv

    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["time", "time_ns", "tick", "kind", "what", "who", "run"])
    for event in events:
        seconds, rest = divmod(event.clock_ns, 10**9)
        clock = f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%dT%H:%M:%S}.{rest:09}Z"
        tick = event.tick if event.tick >= 0 else ""
        writer.writerow([clock, event.clock_ns, tick, event.kind, event.text, event.who, event.run])
    return out.getvalue()


def _place(event: LoggedEvent) -> tuple[str, str]:
    """Return when it was: by the clock, and its tick."""
    return wall_clock(event.clock_ns, 3), text.count(event.tick) if event.tick >= 0 else "-"


def long_words(events: Sequence[LoggedEvent], shown: Callable[[str], str]) -> tuple[str, ...]:
    """Return the names of signals, triggers and files of all events that may have no room in a line, as `shown`."""
    found = {word for event in events for word in event.text.split(" ") if len(word) > LONG}
    return tuple(map(shown, sorted(found)))


def who_did(event: LoggedEvent, logger: str) -> str:
    """Return who did it, in short; empty where it happened by itself, in the logger."""
    who = text.clean(short_words(event.who))
    return "" if who == logger else who


def line(event: LoggedEvent, told: str, width: int, logger: str, names: tuple[str, ...] = ()) -> str:
    """Return a line of the screen: time, tick, letter, what was told, who; `who` goes first where there is no room.

    Then a long name among the `names` of all lines loses what doesn't tell it apart.
    """
    clock, tick = _place(event)
    told = re.sub(rf" at tick {event.tick}\b", "", told, count=1)  # it stands beside
    head = f"  {clock}  {tick:>10} {letter(event)} "
    who = who_did(event, logger)[: max(0, min(20, width // 4))]
    room = width - len(head) - (len(who) + 2 if who else 0)
    if len(told) > room:
        room, who = width - len(head), ""
        longest = max(told.split(" "), key=len)
        if longest in names:
            fits = fitted_among(longest, names, max(LONG, room - len(told) + len(longest)))
            told = told.replace(longest, fits, 1)
    if len(told) > room:  # at a blank: half a number reads as another one
        begun = told[:room].rpartition(" ")[0]  # and a cell for the sign that it goes on
        word, left = told[len(begun) + 1 :].partition(" ")[0], room - len(begun) - 1
        if begun and len(word) > LONG <= left:  # a long name has room for its end
            told = f"{begun} {fitted_among(word, (), left)}"
        else:
            told = f"{begun or told[: max(1, room - 1)]}…"
    return f"{head}{told:<{max(1, room)}}  {who}"[:width]


def is_within(event: LoggedEvent, file: SavedRecording) -> bool:
    """Return whether what was saved has the moment of an event."""
    return 0 < file.begun_ns <= event.at_ns <= file.begun_ns + file.span_s * 1e9


def gone_words(event: LoggedEvent, events: Sequence[LoggedEvent], files: Sequence[SavedRecording] = ()) -> str:
    """Return what to say of a moment whose rows are held no more: which of the `files` has them, the shortest of
    several; where none are known to, what was saved since.
    """
    holding = [one for one in files if is_within(event, one)]
    if holding:
        return f"rows gone; {min(holding, key=lambda one: one.span_s).stem} has them"
    later = [one for one in events if one.run == event.run and one.number > event.number]
    before = [one.text for one in events if one.run == event.run and one.number < event.number]

    def has_it(one: LoggedEvent) -> bool:
        if one.kind in {"saved", "captured", "recovered"} or "; saved " in one.text:
            return True
        recording, is_part, _ = one.text.partition(": finished ")  # of one that was under way by then
        return bool(is_part) and any(text.startswith(f"{recording} of ") for text in before)

    saved = next((one.text for one in later if has_it(one)), "")
    return f"rows gone; {text.clean(saved)}" if saved else "its rows are held no more, and no save of them is known"
