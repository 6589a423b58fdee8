"""Judging the rows of one run: every trigger over every row, and the captures that begin.

Belongs to the judge thread. It reads rings behind their heads and never holds up anybody; rows that were overwritten
before it came are what it was blind for, and it says so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from silo.collecting.schema import ElementSchema
from silo.collecting.segment_reader import SegmentReader
from silo.errors import ElementError
from silo.helper.spool import Spool
from silo.judging.binding import OFF, Catalogue, Known, bind
from silo.judging.evaluation import Evaluator, SourceRows
from silo.judging.extras import trigger_rule
from silo.judging.triggers import Capture, Trigger
from silo.model import BufferType, ElementInfo, TriggerOptions
from silo.values import as_floats

BATCH_TICKS = 16_384
MOST_SPOOL_BYTES = 512 * 2**20  # of all captures that are under way
LONGEST_WAIT_S = 0.05
RELEASE_STEPS = 20


@dataclass
class _Watched:
    """One trigger of the run."""

    options: TriggerOptions
    trigger: Trigger
    evaluator: Evaluator


@dataclass
class Step:
    """What one look at the rings brought: words for clients, and captures that are whole."""

    fired: list[tuple[str, Capture]] = field(default_factory=list)
    blind: list[str] = field(default_factory=list)
    whole: list[Spool] = field(default_factory=list)


class SegmentJudge:
    """Judges one run from its first tick on."""

    def __init__(self, reader: SegmentReader, table: Sequence[ElementInfo]) -> None:
        """`table` names the elements that are off too. `problems` has what can't be judged at all, in words."""
        self.reader = reader
        self.problems: list[str] = []
        schema = reader.schema
        logged = {element.info.name: element for element in schema.elements}
        self._elements: list[ElementSchema | _Off] = [
            *schema.elements,
            *(_Off(info) for info in table if info.name not in logged),
        ]
        catalogue = Catalogue([self._known(one) for one in self._elements], schema.prefix, schema.extras.derived)
        self._watched: list[_Watched] = []
        self._wanted: dict[int, set[tuple[int, int]]] = {}
        for options in schema.extras.triggers:
            self._watch_if_it_fits(options, catalogue)
        self._cursors = dict.fromkeys(self._wanted, 0)
        self._until = self._steps = 0
        self._spools: list[Spool] = []

    def _known(self, element: "ElementSchema | _Off") -> Known:
        info = element.info
        if isinstance(element, _Off):
            return Known(info.name, info.entries, info.unit, OFF, info.options.divider)
        return Known(info.name, info.entries, info.unit, self._ring_of(element), info.options.divider)

    def _ring_of(self, element: ElementSchema) -> int:
        # of what keeps its first samples only, the ring for live views has the rest
        fixed = self.reader.schema.rings[element.ring].buffer_type is BufferType.FIXED
        return element.live_ring if fixed and element.live_ring >= 0 else element.ring

    def _watch_if_it_fits(self, options: TriggerOptions, catalogue: Catalogue) -> None:
        try:
            self._watch(options, catalogue)
        except ElementError as error:
            self.problems.append(f"trigger '{options.name}' is not judged: {error}")

    def _watch(self, options: TriggerOptions, catalogue: Catalogue) -> None:
        expressions = [bind(text, catalogue).condition() for text in (options.when, options.rearm) if text]
        trigger = Trigger(trigger_rule(options, self.reader.schema.frequency_hz))
        if not any(bound.sources for bound in expressions):
            self.problems.append(f"trigger '{options.name}' is unobservable: the elements in it are off")
            return
        self._watched.append(_Watched(options, trigger, Evaluator(*expressions)))
        for column in (column for bound in expressions for column in bound.columns):
            if column.source != OFF:
                self._wanted.setdefault(column.source, set()).add((column.element, column.entry))

    @property
    def wait_s(self) -> float:
        """How long may pass until the next look: a quarter of what the shortest ring holds, 50 ms at most."""
        schema = self.reader.schema
        rings = [schema.rings[ring] for ring in self._wanted if schema.rings[ring].buffer_type is BufferType.LOOPING]
        held_s = [ring.capacity * ring.divider / schema.frequency_hz for ring in rings]
        return max(0.005, min([LONGEST_WAIT_S, *(held / 4 for held in held_s)]))

    @property
    def active(self) -> bool:
        """Whether there is anything to judge."""
        return bool(self._watched)

    @property
    def options(self) -> dict[str, TriggerOptions]:
        """The triggers by name."""
        return {one.options.name: one.options for one in self._watched}

    def step(self) -> Step:
        """Judge what is new, up to the tick that stands in all rings."""
        found = Step()
        # the time ring's head is written last: rows of all ticks before it stand in every ring
        ticks = self.reader.ticks
        while self._until < ticks and self._watched:
            until = min(ticks, self._until + BATCH_TICKS)
            self._judge(until, found)
            self._until = until
            self._copy(until, found)
        self._steps += 1
        if self._steps % RELEASE_STEPS == 0:
            self.reader.release_pages()  # else this process would count all buffers as its own memory
        return found

    def _judge(self, until: int, found: Step) -> None:
        rows = {ring: self._rows(ring, until, found) for ring in self._wanted}
        for one in self._watched:
            judged = one.evaluator.feed({ring: rows[ring] for ring in one.evaluator.sources})
            rearm = judged.codes(1) if one.options.rearm else None
            for capture in one.trigger.feed(judged.ticks, judged.time_ns, judged.codes(0), rearm):
                self._capture(one.options.name, capture, found)

    def _rows(self, ring: int, until: int, found: Step) -> SourceRows:
        cursor = self._cursors[ring]
        divider = self.reader.schema.rings[ring].divider
        rows = self.reader.rows(ring, cursor, max(-(-until // divider) - cursor, 0))
        if rows.first > cursor:
            lost = (rows.first - cursor) * divider
            found.blind.append(f"triggers were blind for {lost} ticks: they were overwritten before they were judged")
            rows = self.reader.rows(ring, rows.first, max(-(-until // divider) - rows.first, 0))
        self._cursors[ring] = rows.first + len(rows)
        columns = {}
        for element, entry in self._wanted[ring]:
            schema = self._elements[element]
            assert isinstance(schema, ElementSchema)
            entries = schema.entries if ring == schema.ring else schema.live_entries
            columns[element, entry] = as_floats(rows.column(entries[entry]))
        return SourceRows(rows.ticks, rows.time_ns, columns)

    # ------------------------------------------------------------------------------------------------- captures

    def _capture(self, trigger: str, capture: Capture, found: Step) -> None:
        for spool in self._spools:
            if spool.trigger == trigger and spool.capture.number == capture.number:
                spool.extend(capture)
                return
        found.fired.append((trigger, capture))
        if sum(spool.size_bytes for spool in self._spools) > MOST_SPOOL_BYTES:
            found.blind.append(
                f"capture {capture.number} of '{trigger}' was left out: those under way take more than "
                f"{MOST_SPOOL_BYTES // 2**20} MB; make pre and post shorter"
            )
            return
        spool = Spool(trigger, capture, self.reader)
        # at once, whatever was judged: the oldest rows are overwritten next
        spool.append(self.reader.ticks)
        self._spools.append(spool)

    def _copy(self, until: int, found: Step) -> None:
        under_way: list[Spool] = []
        for spool in self._spools:
            (found.whole if spool.append(until) else under_way).append(spool)
        self._spools = under_way

    def end(self, why: str) -> Step:
        """Judge the rest, and close the captures that are under way, with the reason."""
        found = self.step()
        for spool in self._spools:
            missing = spool.capture.last + 1 - self._until
            spool.ended = f"{why}, {missing} ticks before its end"
            found.whole.append(spool)
        self._spools = []
        return found


@dataclass(frozen=True)
class _Off:
    """An element of the table that isn't logged in this run."""

    info: ElementInfo
