"""Endless recordings from the terminal: the lines that begin one, the questions that end one."""

from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from silo.core.elements import Action, BufferType
from silo.core.names import matching
from silo.core.quantities.reading import read_keep, read_split
from silo.core.quantities.writing import duration, many, size_text
from silo.errors import SiloError
from silo.recorder.requests import DEFAULT_FOLDER, RecorderInfo
from silo.recordings.requests import Recordings
from silo_tui.actions import key_of
from silo_tui.context import Context
from silo_tui.model.lists.recorders import size_of
from silo_tui.model.table.changes import cost_of
from silo_tui.model.table.fields import Field
from silo_tui.model.words import text
from silo_tui.screens.dialogs.form import Form, taken
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.sessions.live import Session

LINES = (("signals",), ("to", "name"), ("split", "keep"))
HINTS = {
    "signals": "all, marked, or names: joints/* imu", "to": "a folder: recordings", "name": "else the logger's",
    "split": "e.g. 1GB or 10min", "keep": "all, or e.g. 50GB",
}  # fmt: skip
ALL, MARKED = "all", "marked"


@dataclass(frozen=True)
class Wish:
    """What `Client.record` is to be asked for; `signals` are the patterns as they were typed."""

    signals: str
    patterns: tuple[str, ...]
    to: str
    split: str
    keep: str
    name: str


class RecordDialog(Form[Wish]):
    """Answers with what is to be recorded on Enter."""

    KEYS_HERE = "Enter Records  Tab Next field  → Edits what stands there  Esc Back"
    ABOUT: ClassVar = {
        "signals": "all, marked, or names of the table, with * for any part",
        "to": "a folder in that of the logger, on the robot; empty: recordings",
        "name": "of the recording and its files; empty: the logger's",
        "split": "a part ends at about so much, up to half more while it lags, or after so long; empty: never",
        "keep": "beyond so much the oldest parts of this name are deleted; all: it stops when the disk is full",
    }

    def __init__(self, session: Session, found: Recordings | None, begun: Wish, problem: str = "") -> None:
        values = {name: getattr(begun, name) for names in LINES for name in names}
        super().__init__(f"Record on {session.name}, until it is stopped", LINES, values, HINTS, problem, "signals")
        self._session, self._found = session, found

    def _patterns(self) -> tuple[str, ...]:
        """Return what is typed as patterns; without any, all is meant. ValueError where nothing matches one."""
        session, words = self._session, self.fields["signals"].split()
        if words in ([], [ALL]):
            return ()
        marked = [name for name, is_marked in zip(session.table.names, session.rows.marked, strict=True) if is_marked]
        found = [each for word in words for each in (marked if word == MARKED else [word])]
        for pattern in found:
            if not matching(session.table.names, [pattern]):
                raise ValueError(f"no element matches '{pattern}'")
        if not found:
            raise ValueError("nothing is marked: mark elements in the table, or write all, or names")
        return tuple(found)

    def made(self) -> Wish:
        fields, split = self.fields, self.fields["split"]
        keep = "" if fields["keep"] == ALL else fields["keep"]
        read_split(split)
        read_keep(keep)
        return Wish(fields["signals"], self._patterns(), fields["to"], split, keep, fields["name"])

    async def look(self) -> str:
        """Return how many signals that are, how fast the files grow, and for how long there is room."""
        wish, session = self.made(), self._session
        meant = set(matching(session.table.names, wish.patterns))
        rows = [row for row, name in enumerate(session.table.names) if name in meant]
        values = session.table.server[:, rows]
        on = int((values[Field.ENABLED] != 0).sum())
        off = f", {len(rows) - on} of them off" if on < len(rows) else ""
        samples = values[Field.SIZE].astype(float) * np.maximum(1, values[Field.DIVIDER])
        is_full = (values[Field.ENABLED] != 0) & (values[Field.BUFFER] == BufferType.FIXED) & (samples <= session.ticks)
        is_full &= (values[Field.ACTION] == Action.SAVE) & session.running
        values = np.where(is_full & (np.arange(len(values))[:, None] == Field.ENABLED), 0, values)
        elements = [session.table.elements[row] for row in rows]
        bytes_s = cost_of(elements, values, session.rate_hz).recorded_bytes_s
        first = f"{many(len(rows), 'signal')}{off}: about {size_text(bytes_s)}/s in .mcap files"
        if full := int(is_full.sum()):
            has, loops = ("has its", "it loop") if full == 1 else ("have their", "them loop")
            first += (
                f"\n{many(full, 'signal')} {has} fixed buffer full: 0 samples; {key_of('next_buffer')} makes {loops}"
            )
        room = read_keep(wish.keep)
        if not bytes_s:
            return first
        if room:
            kept = f"{first}\nkeeps about the newest {duration(room / bytes_s)}, then the oldest parts of its name go"
            name = wish.name or session.name
            found = await self._folder()
            if found is not None and (earlier := found.recorded.get(f"{wish.to or DEFAULT_FOLDER}/{name}")):
                kept += f"\n{size_text(earlier)} of earlier recordings '{name}' go first: another name keeps them"
            half = room // 2  # a part ends there, so that one can go while the next is written
            return f"{kept}\na part ends at {size_text(half)}, half of it" if read_split(wish.split)[0] > half else kept
        found = await self._folder()
        if found is not None and found.free_bytes:
            return f"{first}\nthe disk takes {duration(found.free_bytes / bytes_s)} of it, then it stops by itself"
        return first

    async def _folder(self) -> Recordings | None:
        """Return what is known of the folder of the logger; None where it can't be asked for."""
        if self._found is None:
            with suppress(SiloError):
                self._found = await self._session.recordings(1)
        return self._found


async def begin(context: Context, session: Session, found: Recordings | None = None, signals: str = "") -> None:
    """Ask what is to be recorded, `signals` at first, and have it recorded; `found` is there, if that is known."""
    first = Wish(signals or (MARKED if session.rows.marked_count else ALL), (), "", "1GB", "", "")

    def form(wish: Wish | None, problem: str) -> RecordDialog:
        return RecordDialog(session, found, wish or first, problem)

    async def send(wish: Wish) -> None:
        started = await context.link.call(
            lambda client: client.record(wish.patterns, wish.to, wish.split, wish.keep, wish.name)
        )
        await _look(session)
        warned = f"; {started.text}" if started.text else ""
        context.say(f"recording '{started.name}' to {started.folder}{warned}")

    await taken(context, form, send)


async def end(context: Context, session: Session) -> None:
    """Ask which recording is to end, and have it end."""
    await _look(session)
    if not session.recorders:
        context.say(f"nothing is being recorded; {key_of('record')} begins it")
        return

    def choices() -> list[Choice]:
        leave = "Leave it" if len(session.recorders) == 1 else "Leave them"
        harmless = Choice("", "Keep recording" if any(not one.state.over for one in session.recorders) else leave)
        keys = "y" if len(session.recorders) == 1 else "123456789"  # yes is y wherever one thing is asked
        return [harmless] + [
            Choice(one.name, _words(one), keys[place : place + 1]) for place, one in enumerate(session.recorders)
        ]

    async def newer() -> list[Choice]:
        await context.quietly(session.refresh_recorders())
        return choices()

    all_stay = not any(one.keep_bytes or one.written_bytes > one.size_bytes for one in session.recorders)
    body = f"Its last part is finished, {'all its parts' if all_stay else 'those that are kept'} stay where they are."
    (first, *others) = session.recorders
    which = "which recording" if others else f"recording '{first.name}'"
    title = f"Stop {which} of {session.name}?"
    name = await context.app.push_screen_wait(Question(title, body, choices(), newer=newer))
    if name:
        context.say(await context.link.call(lambda client: client.stop_recorder(name)))
        await _look(session)


def _words(one: RecorderInfo) -> str:
    """Return how a recording stands, in the line that ends it."""
    parts, size = many(one.parts + bool(one.part), "part"), size_text(size_of(one))
    if one.written_bytes > one.size_bytes:  # the oldest were deleted, as it was told to
        parts, size = f"{parts} written", f"the newest {size_text(one.size_bytes)} kept"
    elif one.keep_bytes:  # they are deleted while it is asked, too
        size += " so far"
    verb = f"Take recording '{one.name}' off the list" if one.state.over else f"Stop recording '{one.name}'"
    return f"{verb}: {parts}, {size}, lost {text.count(one.lost)}"


async def _look(session: Session) -> None:
    await session.refresh_recorders()
    await session.refresh_status()
