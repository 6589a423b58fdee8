"""The list of recordings as rows of text: what a cell says, which rows a filter lets pass, in which order.

Plain functions of what a robot told; nothing is asked or drawn here.
"""

import itertools
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from silo.core.elements import ROBOT_PROGRAM, LoggedEvent
from silo.core.names import grouped
from silo.core.quantities.writing import EPOCH_FROM_NS, size_text
from silo.files.formats import FORMATS, SAVED
from silo.recordings.requests import RecordingFile, Recordings, SavedRecording
from silo_tui.model.lists.happened import RECORDED, is_within
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words import text
from silo_tui.model.words.names import fitting_names

TYPES_FROM, WHY = 110, 20  # cells from which the types have a column; cells of `why` below that, at most
SHORT = 14  # cells of a trigger that is named twice in a line
_PLACE = re.compile(r"(\d{5,})(?:_part(\d+))?")  # the number of a save, and which part it is of a run that was cut
_DATED = re.compile(r"(?P<logger>.+?)_\d{8}_\d\d-\d\d-\d\d_(?P<rest>\d{5,}.*)")


def begun_ns(one: SavedRecording) -> int:
    """Return when a recording began, by the clock on the wall; of one that doesn't say, when its file was changed."""
    return one.begun_ns if one.begun_ns >= EPOCH_FROM_NS else min(file.changed_ns for file in one.files)


ORDERS: tuple[Order[SavedRecording], ...] = (
    Order("begun", "b", "begun, the newest first", lambda one: (begun_ns(one), one.stem), True),
    Order("name", "n", "name", lambda one: one.stem.casefold()),
    Order("why", "w", "why", lambda one: (one.why.casefold(), -begun_ns(one))),
    Order("span", "s", "span, the longest first", lambda one: one.span_s, True),
    Order("size", "z", "size, the largest first", lambda one: one.size_bytes, True),
)


def told(one: SavedRecording) -> str:
    """Return what a filter looks in: name, why, types, logger."""
    types = " ".join(file.type.name for file in one.files)
    return f"{one.stem} {one.why} {types} {one.logger}{' part' if one.unfinished else ''}"


def best_file(one: SavedRecording) -> RecordingFile:
    """Return the file of a save that is opened: as `FORMATS` prefers them."""
    return min(one.files, key=lambda file: FORMATS.index(SAVED[file.type]))


def name_room(width: int, why: int = WHY) -> int:
    """Return the cells that a name has in the list of recordings, and `why` one was saved."""
    return _widths(width, why)[0]


def why_room(found: Sequence[SavedRecording], saves: Mapping[str, "PartSave"], width: int) -> int:
    """Return the cells that all of them need for why they were saved, as far as these may have them."""
    return min(WHY, max([len("why"), *(len(_why(one, saves.get(one.stem), width)) for one in found)]))


def fitting_stems(stems: Sequence[str], own: str, room: int) -> dict[str, str]:
    """Return names of recordings as they fit into so many cells, by their own: different ones never look alike."""
    short = [short_stem(stem, own, room) for stem in stems]
    often = Counter(short)
    told = [each if often[each] == 1 else stem for each, stem in zip(short, stems, strict=True)]
    return dict(zip(stems, fitting_names(told, room), strict=True))


def short_stem(stem: str, own: str, width: int) -> str:
    """Return a name without logger and date where it is long: `…00007_fall_3`; of another logger, `arm…00007`."""
    found = _DATED.fullmatch(stem)
    if len(stem) <= width or found is None:
        return stem
    whose = "" if found["logger"] == own else found["logger"]
    return f"{whose}…{found['rest']}"


class PartSave(NamedTuple):
    """One of several saves of the same part of a run, from 1."""

    part: int
    number: int
    of: int

    @property
    def words(self) -> str:
        """What to tell of it."""
        which = f"save {self.number} of {self.of} of part {self.part} of one run"
        return f"{which}, which went on in between: each has what the buffers held then"


def saves_of_parts(found: Sequence[SavedRecording]) -> dict[str, PartSave]:
    """Return by stem which save of a part of a run it is, where there are several: their names end in the same part.

    The saves of a logger are numbered, and a run that is cut has ever higher parts: a lower one is of another run.
    """
    dated = [(one.stem, match) for one in found if (match := _DATED.fullmatch(one.stem))]
    placed = [(match["logger"], place, stem) for stem, match in dated if (place := _PLACE.fullmatch(match["rest"]))]
    told: dict[str, PartSave] = {}
    saves_of = grouped((logger, (int(place[1]), int(place[2] or 0), stem)) for logger, place, stem in placed)
    for of_logger in saves_of.values():
        for part, saves in itertools.groupby(sorted(of_logger), key=lambda one: one[1]):
            stems = [stem for _, _, stem in saves]
            if part and len(stems) > 1:
                told |= {stem: PartSave(part, number, len(stems)) for number, stem in enumerate(stems, 1)}
    return told


def with_markers(found: Sequence[SavedRecording], events: Sequence[LoggedEvent]) -> list[SavedRecording]:
    """Return them, parts of endless recordings with those markers of `events` that lie in them."""
    markers = [one for one in events if one.kind == "marker"]
    return [
        replace(one, markers=sum(is_within(marker, one) for marker in markers))
        if one.why.startswith(RECORDED) and not one.markers
        else one
        for one in found
    ]


def marks_text(one: SavedRecording) -> str:
    """Return `T` for a capture of a trigger, and how many markers there are."""
    return " ".join(
        ["T"] * one.why.startswith("trigger ") + [f"M{one.markers if one.markers > 1 else ''}"] * (one.markers > 0)
    )


def head(width: int, why: int = WHY) -> str:
    """Return the titles of the columns."""
    return "  " + _line(("saved", "why", "types", "begun", "span", "size", "marks"), width, why)


def _why(one: SavedRecording, of: PartSave | None, width: int) -> str:
    """Return why it was saved; in few cells without what the name of the save has too, or all would say."""
    why = "not looked into yet" if one.unread else one.why or ("" if one.logger else "of another program")
    if one.unfinished:
        why = "not finished yet"
    what, _, trigger = why.partition(" ")
    if width < TYPES_FROM and what == "trigger" and len(why) > SHORT and f"_{trigger}_" in one.stem:
        why = what
    which = f"{of.number} of {of.of}, " if of is not None else ""
    return which + why.removeprefix("saved ").replace(ROBOT_PROGRAM, "the program")


def row(
    one: SavedRecording, name: str, width: int, now_s: float, of: PartSave | None = None, why: int = WHY
) -> str:  # fmt: skip
    """Return a row of `width` cells, without the gutter; `name` as it fits; `of` where other saves are of its part."""
    span = text.span(one.span_s, 3) if one.span_s else "-"
    cells = (
        name, _why(one, of, width), " ".join(file.type.name.lower() for file in one.files),
        text.day_and_time(begun_ns(one), now_s), span,
        "part" if one.unfinished else size_text(one.size_bytes), marks_text(one),
    )  # fmt: skip
    return _line(cells, width, why)


def _widths(width: int, why: int) -> tuple[int, int]:
    """Return the cells of name and why."""
    rest = width - 2 - (59 if width >= TYPES_FROM else 42)
    why = why if width < TYPES_FROM else max(WHY, rest // 3)
    return max(12, rest - why), why


def _line(cells: tuple[str, ...], width: int, why_width: int) -> str:
    name_width, why_width = _widths(width, why_width)
    name, why, types, begun, span, size, marks = cells
    why = text.cut(why, why_width)
    kinds = f" {types:<16}" if width >= TYPES_FROM else ""
    return f"{name:<{name_width}} {why:<{why_width}}{kinds} {begun:<14} {span:>8} {size:>8}  {marks:<5}"


def summary(found: Recordings) -> str:
    """Return what the message line says when nothing else is there to be said."""
    here, count = len(found.recordings), text.count(found.count)
    parts = [f"{count} saved" if here >= found.count else f"the newest {here} of {count} saved"]
    if found.disk_bytes:
        parts.append(f"{size_text(found.free_bytes)} of {size_text(found.disk_bytes)} free")
    return " │ ".join(parts)
