"""The element table as the screen sees it: what the logger has, what somebody wants to change, and how to take it back.

`TableState` keeps two layers of shape `(5, n)` (fields x elements): the server's values, and edits on top of them,
each with the server's value that it was made on. What is pending and what is in conflict follows from these; nothing
of it is stored, so that it can't go stale.
"""

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.conditions.standing import LimitStatus
from silo.core.arrays.columns import Floats
from silo.core.elements import Edit, ElementInfo, Entry, FieldChange, Table
from silo.core.names import component_name, is_word
from silo.core.quantities.writing import many
from silo_tui.model.samples.live import has_norm
from silo_tui.model.table.facts import LIMIT_BITS, NOTHING, Facts
from silo_tui.model.table.fields import Field, Ints, options_of, phrase_for, rows_of
from silo_tui.model.words.names import first_levels, without_prefix

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]
FIELDS = len(Field)
APPLIED = "what was applied"


class PendingChange(FieldChange, frozen=True):
    """One pending edit; `theirs` is set when the logger's value is no longer the one it was made on."""

    theirs: str | None = None


class KeptEdit(msgspec.Struct, frozen=True, array_like=True):
    """A pending edit by name, with the value that it was made on."""

    name: str
    field: int
    old: int
    new: int


class _Layer(msgspec.Struct, frozen=True):
    """Edits of some rows: arrays of shape `(5, len(rows))`."""

    edited: Mask
    wanted: Ints
    based_on: Ints


class _Step(msgspec.Struct, frozen=True):
    """One undo step: the edits of `rows` before and after; of what was `applied` before is what is to be wanted back.

    That comes on top of whatever is wanted when the step is taken back.
    """

    label: str
    rows: Rows
    before: _Layer
    after: _Layer
    applied: bool = False


def _carried(steps: Sequence[_Step], now: Mapping[int, int]) -> list[_Step]:
    """Return steps about the rows that their elements have `now`; what speaks of elements that are gone goes."""
    carried = []
    for step in steps:
        there = np.array([int(row) in now for row in step.rows], np.bool_)
        rows: Rows = np.array([now[int(row)] for row in step.rows[there]], np.intp)
        before, after = (
            _Layer(each.edited[:, there], each.wanted[:, there], each.based_on[:, there])
            for each in (step.before, step.after)
        )
        if len(rows):
            carried.append(msgspec.structs.replace(step, rows=rows, before=before, after=after))
    return carried


def against_siblings(known: Floats, siblings: Rows) -> Floats:
    """Return how many times as large as the median of its siblings each is, shape `(n,)` as all of these.

    Those are siblings whose number is the same; of those that are 0 there is no median.
    """
    rows = np.lexsort((known, siblings))
    rows = rows[known[rows] > 0]
    counts = np.bincount(siblings[rows], minlength=int(siblings.max(initial=-1)) + 1)
    begin, moving = np.cumsum(counts) - counts, np.append(known[rows], np.nan)
    median = np.where(counts, (moving[begin + (counts - 1) // 2] + moving[begin + counts // 2]) / 2, 1.0)
    found: Floats = known / median[siblings]
    return found


class TableState:
    """The table, its pending edits and their history. Row i is element i of the logger's own order."""

    def __init__(self) -> None:
        self.elements: list[ElementInfo] = []
        self.names: list[str] = []
        self.searched: list[list[str]] = []  # what each row is found by, in small letters: its name, its components
        self.described: list[str] = []  # what the program says of each, in small letters
        self.said_too = False  # whether words of a filter are looked for in that and names alike
        self._levels: tuple[list[str], str, frozenset[str]] = ([], "", frozenset())  # of which names and prefix
        self.prefix = ""  # that all names share, without a slash at its end; not shown
        self.facts = NOTHING  # the newest survey
        self.limits: Mapping[str, LimitStatus] = {}  # by names of scalars
        self._beyond: dict[str, str] = {}  # the worst word of each element that is beyond its limits
        self._beyond_bits: NDArray[np.int64] = np.zeros(0, np.int64)
        self.revision = -1
        self.version = 0  # grows with every change, so that caches can tell
        self.mixed: Mask = np.zeros(0, np.bool_)  # of which rows there is no norm: their entries have several units
        self.labelled: Mask = np.zeros(0, np.bool_)  # which rows have words for numbers
        self.siblings: Rows = np.zeros(0, np.intp)  # the same of those that are called alike, with the same unit
        self._noise: tuple[Facts, Floats] = (NOTHING, np.zeros(0))  # of which survey
        self.own = 0  # how many of the elements are the logger's own: the rows after them are derived
        self._row_of: dict[str, int] = {}
        self._scalars: dict[str, tuple[ElementInfo, Entry]] = {}  # once one is asked for
        self.server: Ints = np.zeros((FIELDS, 0), np.int64)  # what the logger has; not to be written to
        self.given: Ints = self.server  # what its program began with
        self._edited = np.zeros((FIELDS, 0), np.bool_)
        self._wanted = np.zeros((FIELDS, 0), np.int64)
        self._based_on = np.zeros((FIELDS, 0), np.int64)
        self._undo: list[_Step] = []
        self._redo: list[_Step] = []

    def __len__(self) -> int:
        return len(self.elements)

    # ------------------------------------------------------------------------------------------------ reading

    @property
    def values(self) -> Ints:
        """What the screen shows, shape `(5, n)`: the wanted value where there is an edit, else the logger's."""
        return np.where(self._edited, self._wanted, self.server)

    def value(self, field: int, row: int) -> int:
        """Return what the screen shows of one cell: to paint one looks at no other."""
        layer = self._wanted if self._edited[field, row] else self.server
        return int(layer[field, row])

    @property
    def pending(self) -> Mask:
        """Shape `(5, n)`: edits that would change something."""
        return np.asarray(self._edited & (self._wanted != self.server), np.bool_)

    @property
    def conflicts(self) -> Mask:
        """Shape `(5, n)`: pending edits whose ground was changed by somebody else since."""
        return np.asarray(self.pending & (self.server != self._based_on), np.bool_)

    @property
    def edited(self) -> Mask:
        """Shape `(n,)`: rows that the logger has with other options than its program began with, whoever changed it."""
        return np.asarray((self.given != self.server).any(axis=0), np.bool_)

    @property
    def pending_count(self) -> tuple[int, int]:
        """(fields, rows) with pending edits."""
        pending = self.pending
        return int(pending.sum()), int(pending.any(axis=0).sum())

    @property
    def derived(self) -> Mask:
        """Shape `(n,)`: rows that are computed from others, and have no options of their own."""
        return np.arange(len(self.elements)) >= self.own

    def row(self, name: str) -> int | None:
        """Return the row of an element, None when there is none of that name."""
        return self._row_of.get(name)

    def scalar(self, name: str) -> tuple[ElementInfo, Entry] | None:
        """Return the element and the entry of it that a scalar is, None when there is none of that name."""
        if not self._scalars:
            self._scalars = {info.name + one.suffix: (info, one) for info in self.elements for one in info.entries}
        return self._scalars.get(name)

    def shown(self, words: str) -> str:
        """Return words of the logger with the names of signals as they are shown: without what all names share."""
        names, prefix = self.names, self.prefix
        if self._levels[0] is not names or self._levels[1] != prefix:
            entries = (element.name + entry.suffix for element in self.elements for entry in element.entries)
            self._levels = names, prefix, first_levels([*names, *entries], prefix)
        return without_prefix(words, prefix, self._levels[2])

    def entry_names(self, row: int) -> list[str]:
        """Return full names of the entries of an element."""
        element = self.elements[row]
        return [element.name + entry.suffix for entry in element.entries]

    def drawn_name(self, row: int) -> str:
        """Return the entry of an element that its trend is of; empty for words, of which there is no curve."""
        element = self.elements[row]
        numeric = bool(element.entries) and element.entries[0].dtype[1:2] not in "SU"
        return element.name + element.entries[0].suffix if numeric else ""

    @property
    def live(self) -> Mask:
        """Shape `(n,)`: what can be watched: all that is enabled (pending edits don't count)."""
        return np.asarray(self.server[Field.ENABLED] != 0, np.bool_)

    def is_live(self, row: int) -> bool:
        """Return whether the element can be watched now: whether it is enabled."""
        return bool(self.server[Field.ENABLED, row])

    @property
    def shares_left(self) -> Floats:
        """Shape `(n,)`: how far each row is from its limits, as a share of their range, as these were judged last; NaN
        where it has none. Of a vector its entry that is the nearest.
        """
        found = np.full(len(self), np.nan)
        for name, one in self.limits.items():
            if one.value is not None and (scalar := self.scalar(name)) is not None:
                row = self.row(scalar[0].name)
                found[row] = np.fmin(found[row], one.share_left(one.value))
        return found

    @property
    def signs(self) -> NDArray[np.int64]:
        """Shape `(n,)`: bits of what is the matter with each row, as the survey and the limits say."""
        return self.facts.signs(len(self)) | self._beyond_bits

    @property
    def signs_known(self) -> bool:
        """Whether anything was told of signs yet."""
        return self.facts.of("signs", len(self)) is not None or bool(self._beyond)

    @property
    def noise(self) -> Floats:
        """Shape `(n,)`: how many times the noise of the median of its siblings each row has; NaN where it has none."""
        if self._noise[0] is not self.facts or len(self._noise[1]) != len(self):
            known = self.facts.of("noise", len(self))
            none = self.mixed | self.labelled  # of metres and radians, and between labels, is none
            known = np.where(none, np.nan, np.nan if known is None else known)
            self._noise = self.facts, against_siblings(known, self.siblings)
        return self._noise[1]

    def take_beyond(self, words: Mapping[str, str]) -> None:
        """Take over which elements are beyond their limits, with the worst word of each."""
        self._beyond = dict(words)
        self._beyond_bits = np.zeros(len(self), np.int64)
        for name, word in self._beyond.items():
            row = self.row(name)
            if row is not None:
                self._beyond_bits[row] |= LIMIT_BITS.get(word, 0)

    def changes(self) -> list[PendingChange]:
        """Return all pending edits in words, in table order."""
        conflicts = self.conflicts
        found = []
        for row, field_number in np.argwhere(self.pending.T):
            field = Field(int(field_number))
            old, new = (phrase_for(field, int(layer[field, row])) for layer in (self._based_on, self._wanted))
            theirs = phrase_for(field, int(self.server[field, row])) if conflicts[field, row] else None
            found.append(PendingChange(self.names[row], field.label, old, new, theirs))
        return found

    def edits(self) -> list[Edit]:
        """Return the pending edits as one transaction for the logger."""
        values = self.values
        rows = np.flatnonzero(self.pending.any(axis=0))
        return [Edit(self.names[row], options_of(values[:, row])) for row in rows]

    # ------------------------------------------------------------------------------------------------ editing

    def edit(self, which: Sequence[int] | Rows, field: Field, new: Ints | int) -> int:
        """Want `new` (one, or one per row) in `field` of those rows; one undo step. Returns how many cells changed."""
        rows: Rows = np.asarray(which, np.intp)
        wanted = self.values[:, rows]
        wanted[field] = new
        return self.edit_all(rows, wanted)

    def edit_all(self, which: Sequence[int] | Rows, wanted: Ints) -> int:
        """Wants `wanted`, shape `(5, len(which))`, in those rows; one undo step. Returns how many cells changed.

        Rows that are derived stay as they are.
        """
        rows: Rows = np.asarray(which, np.intp)
        rows, wanted = rows[rows < self.own], wanted[:, rows < self.own]
        changed = self.values[:, rows] != wanted
        some = changed.any(axis=0)
        if not some.any():
            return 0
        rows, wanted, changed = rows[some], wanted[:, some], changed[:, some]
        before = self._layer(rows)
        server, edited = self.server[:, rows], self._edited[:, rows]
        self._based_on[:, rows] = np.where(changed & ~edited, server, self._based_on[:, rows])
        self._wanted[:, rows] = np.where(changed, wanted, self._wanted[:, rows])
        self._edited[:, rows] = np.where(changed, wanted != server, edited)
        fields = ", ".join(Field(int(number)).label for number in np.flatnonzero(changed.any(axis=1)))
        self._remember(f"{fields} of {many(len(rows), 'element')}", rows, before)
        return int(changed.sum())

    def begin_again(self) -> int:
        """Want what the program began with, in all rows; one undo step. Returns how many cells changed."""
        return self.edit_all(np.flatnonzero(self.edited), self.given[:, self.edited])

    def discard(self, which: Sequence[int] | Rows) -> int:
        """Take back every pending edit of `rows`; one undo step. Returns how many fields that were."""
        rows: Rows = np.asarray(which, np.intp)
        rows = rows[self._edited[:, rows].any(axis=0)]
        if not len(rows):
            return 0
        count = int(self.pending[:, rows].sum())
        before = self._layer(rows)
        self._edited[:, rows] = False
        self._remember(f"discard of {many(count, 'edit')}", rows, before)
        return count

    def resolve(self, which: Sequence[int] | Rows, *, keep_mine: bool) -> int:
        """Settle the conflicts of `rows`: keep the edits, now on the new ground, or take theirs. Returns how many."""
        rows: Rows = np.asarray(which, np.intp)
        conflicts = self.conflicts[:, rows]
        rows, conflicts = rows[conflicts.any(axis=0)], conflicts[:, conflicts.any(axis=0)]
        if not len(rows):
            return 0
        before = self._layer(rows)
        if keep_mine:
            self._based_on[:, rows] = np.where(conflicts, self.server[:, rows], self._based_on[:, rows])
        else:
            self._edited[:, rows] &= ~conflicts
        self._remember("keep mine" if keep_mine else "take theirs", rows, before)
        return int(conflicts.sum())

    @property
    def undoes(self) -> str:
        """The label of the step that is taken back next; empty where there is none."""
        return self._undo[-1].label if self._undo else ""

    def undo(self) -> str | None:
        """Take the last step back and return its label; None when there is none."""
        return self._move(self._undo, self._redo, back=True)

    def redo(self) -> str | None:
        """Do the last undone step again and return its label; None when there is none."""
        return self._move(self._redo, self._undo, back=False)

    def kept(self) -> list[KeptEdit]:
        """Return the pending edits as they may be taken up again later."""
        return self._as_edits(self._based_on, self._wanted, self.pending)

    def applied(self) -> list[KeptEdit]:
        """Return what the logger has otherwise than its program began with, as edits of that."""
        return self._as_edits(self.given, self.server, self.given != self.server)

    def _as_edits(self, old: Ints, new: Ints, which: Mask) -> list[KeptEdit]:
        return [
            KeptEdit(self.names[row], int(field), int(old[field, row]), int(new[field, row]))
            for row, field in np.argwhere(which.T)
        ]

    def take_up(self, edits: Sequence[KeptEdit]) -> int:
        """Want kept edits again, in one undo step, and return how many; what was changed meanwhile is a conflict."""
        known = [(edit, row) for edit in edits if (row := self.row(edit.name)) is not None and 0 <= edit.field < FIELDS]
        known = [(edit, row) for edit, row in known if self.server[edit.field, row] != edit.new]
        if not known:
            return 0
        rows: Rows = np.unique([row for _, row in known])
        before = self._layer(rows)
        for edit, row in known:
            self._edited[edit.field, row] = True
            self._wanted[edit.field, row], self._based_on[edit.field, row] = edit.new, edit.old
        self._remember(many(len(known), "kept edit"), rows, before)
        return len(known)

    # ------------------------------------------------------------------------------------------- the logger's side

    def load(self, table: Table) -> None:
        """Take over the logger's table and rebases the pending edits on it, by name.

        Edits that the new table already fulfils are done; edits of elements that are gone are dropped.
        """
        elements = [*table.elements, *table.derived]
        names = [element.name for element in elements]
        server = rows_of([element.options for element in elements])
        if names != self.names:
            self._carry_over(names, server)
        self.elements, self.own, self._scalars = elements, len(table.elements), {}
        self.described = [each.description.casefold() for each in elements]
        self.searched = [
            [
                each.name.casefold(),
                *((each.name + one.suffix).casefold() for one in each.entries if is_word(component_name(one.suffix))),
            ]
            for each in elements
        ]
        self.labelled = np.array([any(one.labels for one in each.entries) for each in elements], np.bool_)
        # a torque of each joint: what is called so of a leg, or of all, is a sum of them
        called = [f"{one.name.count('/')}\n{one.name.rpartition('/')[2]}\n{one.unit}" for one in elements]
        self.siblings = np.unique(called, return_inverse=True)[1]
        self.mixed = np.array([len(each.entries) > 1 and not has_norm(each) for each in elements], np.bool_)
        self.revision, self.server = table.revision, server
        given = table.given
        self.given = rows_of([given.get(one.name, one.options) for one in elements]) if given else server
        self._edited &= self._wanted != server
        self.take_beyond(self._beyond)
        self.version += 1

    def note_applied(self, applied: Sequence[KeptEdit]) -> None:
        """Have one undo step in the place of the edits: to want back what the logger had before; earlier ones stay."""
        self._undo[:] = [step for step in self._undo if step.applied]
        self._redo.clear()
        known = [(edit, row) for edit in applied if (row := self.row(edit.name)) is not None]
        known = [(edit, row) for edit, row in known if self.server[edit.field, row] == edit.new]
        if not known:
            return
        rows: Rows = np.unique([row for _, row in known])
        now, before = self._layer(rows), self._layer(rows)
        for edit, row in known:
            at = int(edit.field), int(np.searchsorted(rows, row))
            before.edited[at], before.wanted[at], before.based_on[at] = True, edit.old, edit.new
        self._undo.append(_Step(f"{APPLIED} to {many(len(rows), 'element')}", rows, before, now, applied=True))

    def note_changed(self, names: list[str], before: Ints) -> None:
        """Have one undo step of all that the logger has now otherwise than `before`, when elements were called so."""
        if names == self.names:
            self.note_applied(self._as_edits(before, self.server, before != self.server))

    # ------------------------------------------------------------------------------------------------ inside

    def _carry_over(self, names: list[str], server: Ints) -> None:
        new_rows = [row for row, name in enumerate(names) if name in self._row_of]
        old_rows = [self._row_of[names[row]] for row in new_rows]
        edited: Mask = np.zeros(server.shape, np.bool_)
        wanted, based_on = server.copy(), server.copy()
        edited[:, new_rows] = self._edited[:, old_rows]
        wanted[:, new_rows] = self._wanted[:, old_rows]
        based_on[:, new_rows] = self._based_on[:, old_rows]
        self._edited, self._wanted, self._based_on = edited, wanted, based_on
        self.names = names
        self._row_of = {name: row for row, name in enumerate(names)}
        now = dict(zip(old_rows, new_rows, strict=True))
        self._undo, self._redo = _carried(self._undo, now), _carried(self._redo, now)

    def _layer(self, rows: Rows) -> _Layer:
        return _Layer(self._edited[:, rows].copy(), self._wanted[:, rows].copy(), self._based_on[:, rows].copy())

    def _remember(self, label: str, rows: Rows, before: _Layer) -> None:
        self._undo.append(_Step(label, rows, before, self._layer(rows)))
        self._redo.clear()
        self.version += 1

    def _move(self, source: list[_Step], target: list[_Step], *, back: bool) -> str | None:
        if not source:
            return None
        step = source.pop()
        layer = step.before if back else step.after
        if step.applied and back:
            now, mine = self._layer(step.rows), step.before.edited
            layer = _Layer(
                now.edited | mine,
                np.where(mine, step.before.wanted, now.wanted),
                np.where(mine & ~now.edited, step.before.based_on, now.based_on),
            )
            step = msgspec.structs.replace(step, after=now)
        self._edited[:, step.rows] = layer.edited
        self._wanted[:, step.rows] = layer.wanted
        self._based_on[:, step.rows] = layer.based_on
        target.append(step)
        self.version += 1
        return step.label
