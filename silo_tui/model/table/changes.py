"""Many changes in few lines: equal ones of names alike stand together, `12 × /legs/*/*/torque`; and what they cost."""

from collections.abc import Collection, Sequence

import msgspec
import numpy as np

from silo.core.elements import Action, BufferType, ElementInfo, FieldChange
from silo.core.names import grouped, matching
from silo.recorder.requests import SAMPLE_BYTES
from silo_tui.model.table.fields import Field, Ints
from silo_tui.model.words.names import below

ROW_BYTES = 16  # tick and time stamp of each row
FEW = 3  # names that a group names rather than writes as *


class Group(msgspec.Struct, frozen=True):
    """Elements that change alike: a pattern of their names, how many they are, and field, old, new of each change."""

    pattern: str
    count: int
    fields: tuple[tuple[str, str, str], ...]

    @property
    def words(self) -> str:
        """Return `divider 1 → 5, size 4000 → 2000`."""
        return ", ".join(f"{field} {old} → {new}" for field, old, new in self.fields)


def groups_of(changes: Sequence[FieldChange], prefix: str = "") -> list[Group]:
    """Return changes in groups, the largest first; names without `prefix`, as the table shows them.

    Equal ones whose names end alike are a group; where more than `FEW` groups differ in that end alone, they are one.
    """
    of_element: dict[str, list[tuple[str, str, str]]] = {}
    for change in changes:
        of_element.setdefault(change.name, []).append((change.field, change.old, change.new))
    alike: dict[tuple[tuple[tuple[str, str, str], ...], int, str], list[list[str]]] = {}
    for name, fields in of_element.items():
        levels = below(prefix, name).split("/")
        alike.setdefault((tuple(fields), len(levels), levels[-1]), []).append(levels)
    groups = _joined([Group(_pattern(names), len(names), fields) for (fields, _, _), names in alike.items()])
    return sorted(groups, key=lambda group: (-group.count, group.pattern))


def _joined(groups: Sequence[Group]) -> list[Group]:
    """Return groups, those of one branch together: `7 × /battery/*`."""
    branches: dict[tuple[str, tuple[tuple[str, str, str], ...]], list[Group]] = {}
    for group in groups:
        branches.setdefault((group.pattern.rpartition("/")[0], group.fields), []).append(group)
    found: list[Group] = []
    for (branch, fields), members in branches.items():
        if len(members) > FEW:
            found.append(Group(f"{branch}/*", sum(group.count for group in members), fields))
        else:
            found += members
    return found


def patterns_of(names: Sequence[str], among: Sequence[str], prefix: str) -> list[str]:
    """Return patterns that mean these names and no others of `among`; the names themselves where there is none."""
    alike = grouped(((name.count("/"), name.rpartition("/")[2]), name) for name in names)
    found: list[str] = []
    for some in alike.values():
        pattern = _pattern([name.split("/") for name in some])
        is_these = {*matching(among, [pattern], prefix)} == {*some}
        found += [pattern] if is_these else some
    return found


def _pattern(names: list[list[str]]) -> str:
    return "/".join(level[0] if len(set(level)) == 1 else "*" for level in zip(*names, strict=True))


class Cost(msgspec.Struct, frozen=True):
    """What a table takes: memory of its buffers, bytes per second of a recording and of topics, seconds that are held.

    The seconds are infinite for what grows. `shortest` is the element that holds the least, empty where nothing is
    saved.
    """

    memory_bytes: float
    recorded_bytes_s: float
    topic_bytes_s: float
    shortest_s: float
    longest_s: float
    shortest: str


def kept_by(elements: Sequence[ElementInfo], values: Ints) -> dict[str, BufferType]:
    """Return how elements with the options `values` are kept, those that are logged."""
    on = np.flatnonzero(values[Field.ENABLED, : len(elements)])
    return {elements[at].name: BufferType(values[Field.BUFFER, at]) for at in map(int, on)}


def cost_of(
    elements: Sequence[ElementInfo], values: Ints, frequency_hz: float, held: Collection[str] | None = None
) -> Cost:
    """Return what elements with the options `values`, shape `(5, n)`, take; about, for rows share their time stamps.

    A recording has all of them, also what is published alone, or derived, which takes nothing else. The seconds are
    those of the elements named in `held`, else of all.
    """
    on = values[Field.ENABLED] != 0
    sizes = np.array([sum(np.dtype(entry.dtype).itemsize for entry in each.entries) for each in elements], float)
    rate = np.where(on, frequency_hz / np.maximum(1, values[Field.DIVIDER]), 0.0)
    recorded = float(((sizes + SAMPLE_BYTES) * rate).sum())
    on &= np.array([not each.expression for each in elements], np.bool_)
    saved = on & (values[Field.ACTION] != int(Action.PUBLISH))
    published = on & (values[Field.ACTION] != int(Action.SAVE))
    buffers = values[Field.SIZE].astype(float)
    rings = np.unique(values[:, on], axis=1)
    memory = float((sizes * buffers)[on].sum() + ROW_BYTES * rings[Field.SIZE].sum())
    meant = saved if held is None else saved & np.array([each.name in held for each in elements], np.bool_)
    grows = values[Field.BUFFER] == int(BufferType.GROWING)  # which holds all there is
    held_s = np.where(grows, np.inf, buffers / np.where(rate > 0, rate, np.inf))
    places = np.flatnonzero(meant)
    at = int(places[np.argmin(held_s[places])]) if len(places) else -1
    return Cost(
        memory, recorded, float((sizes * rate)[published].sum()),
        float(held_s[at]) if at >= 0 else 0.0, float(held_s[meant].max()) if at >= 0 else 0.0,
        elements[at].name if at >= 0 else "",
    )  # fmt: skip
