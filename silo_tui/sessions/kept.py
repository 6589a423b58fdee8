"""What is kept on this machine of a logger: a terminal that is lost, or a kill, doesn't take it along.

Edits that were not applied: one small file per logger and process in `$XDG_STATE_HOME/silo/edits/`, written anew after
each edit, gone when nothing is pending: two terminals on one logger keep theirs apart. What processes left that are no
more is offered at a start. What the robot program judges and derives, and edits that were applied: one file per logger,
of the newest program.
"""

import os
import re
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias, TypeVar

import msgspec

from silo.core.conditions import NO_CONDITIONS, Conditions, Derived, SignalLimits, TriggerOptions
from silo.core.elements import Status
from silo.core.quantities.writing import and_more, many
from silo.core.runtime import state_folder
from silo.decoding import json_decoder
from silo_tui.model.table.fields import Field
from silo_tui.model.table.state import KeptEdit, TableState
from silo_tui.sessions.link import refusal

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.conditions.standing import LimitStatus, TriggerStatus
    from silo_tui.sessions.link import Link

Kept = TypeVar("Kept")
Condition: TypeAlias = Derived | SignalLimits | TriggerOptions
Had: TypeAlias = tuple[dict[str, Condition], list[KeptEdit]]
_Kind = TypeVar("_Kind", Derived, SignalLimits, TriggerOptions)


class KeptEdits(msgspec.Struct, frozen=True):
    """What was pending, and when."""

    time_s: float
    edits: list[KeptEdit]


class KeptConditions(msgspec.Struct, frozen=True):
    """What a robot program has, and what that before it had alone."""

    there: Conditions
    gone: Conditions = NO_CONDITIONS
    program: str = ""  # as an older silo-tui left it: another one than is there
    edits: list[KeptEdit] = []  # that were applied
    gone_edits: list[KeptEdit] = []


def path_of(host: str, logger: str) -> Path:
    """Return the file of this process for a logger."""
    return _folder() / f"{_stem(host, logger)}.{os.getpid()}.json"


def left_behind(host: str, logger: str) -> dict[Path, KeptEdits]:
    """Return what processes that are no more kept of a logger, by file; what can't be read is none."""
    found = ((path, read(path)) for path in of_the_dead(_folder(), f"{_stem(host, logger)}.*.json"))
    return {path: kept for path, kept in found if kept is not None and kept.edits}


def of_the_dead(folder: Path, pattern: str) -> list[Path]:
    """Return the files of a folder that belong to processes that are no more, by the number before the ending."""
    found = [(path, path.name.split(".")[-2]) for path in sorted(folder.glob(pattern))]
    return [path for path, pid in found if pid.isdecimal() and not lives(int(pid))]


def _folder() -> Path:
    return state_folder() / "edits"


def _stem(host: str, logger: str) -> str:
    return re.sub(r"[^\w-]", "_", f"{host or 'here'}-{logger}")


def lives(pid: int) -> bool:
    """Return whether another process of that number runs."""
    if pid == os.getpid():
        return False  # this process has just begun with this logger
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def keep(path: Path, edits: Sequence[KeptEdit]) -> None:
    """Write what is pending, or remove the file where nothing is. Raises OSError."""
    if not edits:
        path.unlink(missing_ok=True)
        return
    _write(path, KeptEdits(time.time(), list(edits)))


def read(path: Path) -> KeptEdits | None:
    """Return what was kept; None for nothing, or what can't be read."""
    return _read(path, KeptEdits)


def conditions_of(host: str, logger: str) -> KeptConditions | None:
    """Return what was kept of what a logger judges and derives."""
    return _read(_path_of_conditions(host, logger), KeptConditions)


def keep_conditions(host: str, logger: str, found: KeptConditions) -> None:
    """Write what a logger judges and derives. Raises OSError."""
    _write(_path_of_conditions(host, logger), found)


def _path_of_conditions(host: str, logger: str) -> Path:
    return state_folder() / "conditions" / f"{_stem(host, logger)}.json"


def _write(path: Path, what: msgspec.Struct) -> None:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    beside = path.with_suffix(f".{os.getpid()}.new")
    beside.write_bytes(msgspec.json.encode(what))
    beside.replace(path)


def _read(path: Path, kind: type[Kept]) -> Kept | None:
    try:
        return json_decoder(kind).decode(path.read_bytes())
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None


class OpenLogger(Protocol):
    """What is needed of a session."""

    name: str
    status: Status
    table: TableState
    triggers: "list[TriggerStatus]"
    limits: "list[LimitStatus]"

    @property
    def connection(self) -> "Link":
        """The connection to the logger."""

    def short_name(self, name: str) -> str:
        """Return a name as it is shown."""

    async def reload(self) -> None:
        """Read the table again."""

    async def refresh_conditions(self) -> None:
        """Ask how triggers and limits stand."""


class Lent:
    """What was given to a robot program from outside, which goes with it where no script of it has that.

    That is what it judges and derives, by words, and edits that were applied.
    """

    def __init__(self, session: OpenLogger) -> None:
        self._session = session
        self.gone: dict[str, Condition] = {}  # with the program before
        self.gone_edits: list[KeptEdit] = []
        self._kept: KeptConditions | None = None  # for the next start
        self._untold = False

    def had(self) -> Had:
        """Return what it has, and what went before and was not given again."""
        return {**self.gone, **self._by_words(self._judged())}, [*self.gone_edits, *self._session.table.applied()]

    def of_before(self, had: Had) -> None:
        """Take over what the program before had."""
        self.gone, self.gone_edits = had
        self._untold = True
        self._look()

    def _look(self) -> None:
        """Leave out what the program has by now: it may have given it itself, or somebody else has."""
        there = self._by_words(self._judged())
        self.gone = {words: one for words, one in self.gone.items() if words not in there}
        self.gone_edits = list(filter(self._is_gone, self.gone_edits))

    def _is_gone(self, edit: KeptEdit) -> bool:
        table, row = self._session.table, self._session.table.row(edit.name)
        if row is None or edit.field >= len(Field):
            return not self._session.status.started_ns  # it may come still
        now = table.server[edit.field, row]
        return bool(now != edit.new and now == table.given[edit.field, row])

    def words(self, *kinds: type) -> str:
        """Return what went with the program before; of some kinds alone. Empty for nothing."""
        fields = dict.fromkeys(Field(edit.field).label for edit in self.gone_edits)
        edits = f"{many(len(self.gone_edits), 'applied edit')} ({', '.join(fields)})" if fields and not kinds else ""
        names = [words for words, one in self.gone.items() if not kinds or isinstance(one, kinds)]
        return and_more([*filter(None, [edits]), *names], 4)

    def to_tell(self) -> str:
        """Return once what went with the program before; until the new one has started it may give it itself."""
        if not self._untold or not self._session.status.started_ns:
            return ""
        self._untold = False
        self._look()
        return f":restore brings back what is gone: {words}" if (words := self.words()) else ""

    def keep(self) -> str:
        """Keep it for the next start; return what went since the last one. Raises OSError."""
        status, name, before = self._session.status, self._session.name, self._kept
        program = status.program or str(status.pid)
        if before is None:
            before = conditions_of(status.host, name)
        if self._kept is None and before is not None:
            is_new = before.program != program
            there, edits = (before.there, before.edits) if is_new else (before.gone, before.gone_edits)
            self._untold = self._untold or is_new
            self.gone, self.gone_edits = {**self._by_words(there), **self.gone}, [*edits, *self.gone_edits]
        self._look()
        told = self.to_tell()
        gone = Conditions(self._gone(Derived), self._gone(SignalLimits), self._gone(TriggerOptions))
        self._kept = KeptConditions(self._judged(), gone, program, self._session.table.applied(), self.gone_edits)
        if self._kept != before:
            keep_conditions(status.host, name, self._kept)
        return told and f"the program is a new one; {told}"

    def _gone(self, kind: type[_Kind]) -> tuple[_Kind, ...]:
        return tuple(one for one in self.gone.values() if isinstance(one, kind))

    def _judged(self) -> Conditions:
        """Return what is derived and judged: a new program begins with what its script says."""
        from silo_tui.model.table.derived import present  # which loads expressions: a first screen waits for none

        limits = {one.limits: one.options for one in self._session.limits}
        triggers = tuple(one.options for one in self._session.triggers if not one.owner)
        return Conditions(present(self._session.table), tuple(limits.values()), triggers)

    def _by_words(self, found: Conditions) -> dict[str, Condition]:
        short = self._session.short_name
        return {
            **{f"derived {short(one.name)}": one for one in found.derived},
            **{f"limits of {short(one.name)}": one for one in found.limits},
            **{f"trigger {one.name}": one for one in found.triggers},
        }

    async def restore(self) -> tuple[list[str], list[str], int]:
        """Set again what went; return what was set, what was refused with the reason, how many edits are to be applied.

        What is refused can be tried again; edits of elements that are not there stay.
        """
        done, refused, session = list[str](), list[str](), self._session
        for words, one in list(self.gone.items()):
            if problem := await refusal(session.connection.call(partial(_set, one))):
                refused.append(f"{words}: {problem}")
            else:
                done.append(words)
                del self.gone[words]
        await session.reload()
        await session.refresh_conditions()
        edits, row_of = self.gone_edits, session.table.row
        self.gone_edits = [edit for edit in edits if row_of(edit.name) is None]
        return done, refused, session.table.take_up([edit for edit in edits if row_of(edit.name) is not None])


def _set(one: Condition, client: "Client") -> object:
    """Have a logger judge or derive something."""
    if isinstance(one, Derived):
        return client.derive(one.name, one.expression, one.unit)
    return client._set_limits(one) if isinstance(one, SignalLimits) else client._set_trigger(one)
