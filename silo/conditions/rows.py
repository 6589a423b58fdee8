"""Rows of a run as expressions want them: columns of float64 by element and entry, from one tick on."""

from collections.abc import Collection, Iterable, Mapping, Sequence

from silo.core.conditions import Derived
from silo.core.elements import BufferType, ElementInfo
from silo.core.quantities.writing import size_text
from silo.expressions.binding import OFF, BoundExpression, Catalogue, Known, ScalarPlace, meaning
from silo.expressions.derived_signals import Lookback, lookback, remembers
from silo.expressions.evaluation import Evaluator, SourceRows
from silo.journal.derived_rows import BATCH_TICKS, pickers_of, reading_start, rows_between, sources_of
from silo.segment.layout import ElementSchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader

MOST_REMEMBERED_BYTES = 256 * 2**20  # in the windows of all triggers, and of all limits


class JudgedRows:
    """Reads behind the heads of the rings; a source is a ring."""

    def __init__(self, reader: SegmentReader, table: Sequence[ElementInfo]) -> None:
        """`table` names the elements that are off too."""
        self._reader = reader
        schema = reader.schema
        sources = sources_of(schema, table, self._ring_of)
        self._infos = [info for info, _ in sources]
        self.catalogue = Catalogue([Known.of(*one) for one in sources], schema.prefix, schema.conditions.derived)
        self._wanted: dict[int, RowPicker[tuple[int, int]]] = {}
        self.cursors: dict[int, int] = {}  # the next row of each ring that is read
        # rings that record no more, as their buffers are full: what is in them can't be told from here on
        self.silent: set[int] = set()
        self.overwritten: set[int] = set()  # rings of which rows were, before they came with the newest

    def _ring_of(self, element: ElementSchema) -> int:
        # of what keeps its first samples only, the ring for live views has the rest
        fixed = self._reader.schema.rings[element.ring].buffer_type is BufferType.FIXED
        return element.live_ring if fixed and element.live_ring >= 0 else element.ring

    def recall(self, cursors: Mapping[int, int]) -> None:
        """Go on with these rows."""
        self.cursors.update((ring, row) for ring, row in cursors.items() if ring in self.cursors)

    def begin(self, expressions: Sequence[BoundExpression], evaluator: Evaluator, tick: int) -> Evaluator:
        """Return an evaluator of what is judged from a tick on, with what it looks back at as far as rings hold it."""
        looks = [lookback(one) for one in expressions if remembers(one)]
        if tick and looks:
            back = Lookback(max(one.window_ns for one in looks), max(one.ticks for one in looks))
            dividers = {ring: divider for one in expressions for ring, divider in one.sources.items()}
            pickers = pickers_of(self._reader.schema, [column for one in expressions for column in one.columns])
            for low in range(reading_start(self._reader, back, tick), tick, BATCH_TICKS):
                until = min(low + BATCH_TICKS, tick)
                evaluator.feed(rows_between(self._reader.rows, dividers, pickers, low, until))
        return evaluator

    def go_on(self, mine: Sequence[BoundExpression], evaluator: Evaluator | None, before: "JudgedRows",
              theirs: Sequence[BoundExpression], known: Evaluator | None) -> None:  # fmt: skip
        """Have an evaluator go on over a cut where the one of the run `before` stands, if it computes the same."""
        if evaluator is None or known is None:
            return
        if [meaning(one, self._named) for one in mine] == [meaning(one, before._named) for one in theirs]:
            evaluator.follow(known, before._reader.ticks)

    def _named(self, place: ScalarPlace) -> tuple[str, int]:
        return self._infos[place.element].name, place.entry

    def derive(self, derived: Sequence[Derived]) -> bool:
        """Bind expressions to these derived signals from now on; whether they are others than before."""
        if tuple(derived) == tuple(self.catalogue.derived):
            return False
        self.catalogue = Catalogue(self.catalogue.elements, self.catalogue.prefix, derived)
        return True

    def want(self, columns: Iterable[ScalarPlace], since: int) -> None:
        """Read these and no others from now on: what was not read before from tick `since` on."""
        self._wanted = pickers_of(self._reader.schema, columns)
        self.cursors = {
            ring: self.cursors.get(ring, -(-since // self._reader.schema.rings[ring].divider)) for ring in self._wanted
        }

    def no_room(self, expressions: Iterable[BoundExpression], others: Iterable[BoundExpression]) -> str:
        """Return why there is no memory for the windows of expressions beside those of others; empty where there is."""
        wanted = sum(bound.kept_s for bound in expressions)
        bytes_s = 8 * self._reader.schema.frequency_hz
        if not wanted or (wanted + sum(bound.kept_s for bound in others)) * bytes_s <= MOST_REMEMBERED_BYTES:
            return ""
        return (
            f"its windows remember {size_text(wanted * bytes_s)}, and with those before it that is more than "
            f"{size_text(MOST_REMEMBERED_BYTES)}: make windows shorter, or take fewer values"
        )

    @property
    def shortest_s(self) -> float:
        """The time that the shortest of the rings holds."""
        schema = self._reader.schema
        rings = [schema.rings[ring] for ring in self._wanted if schema.rings[ring].buffer_type is BufferType.LOOPING]
        return min([ring.capacity * ring.divider / schema.frequency_hz for ring in rings], default=float("inf"))

    def oldest_tick(self) -> int:
        """Return the oldest tick of which any of the rings has a row."""
        rings = self._reader.schema.rings
        return min([self._reader.rows(ring, 0, 1).first * rings[ring].divider for ring in self._wanted], default=0)

    def read(self, until: int) -> tuple[Mapping[int, SourceRows], int]:
        """Return the rows before tick `until` that are new, and how many ticks were overwritten before."""
        found, lost = {}, 0
        self.overwritten.clear()
        for ring in self._wanted:
            found[ring], missed = self._read(ring, until)
            lost = max(lost, missed)
            if missed:
                self.overwritten.add(ring)
        # rows of all these ticks were committed: of a ring that has fewer the buffer is full
        rings = self._reader.schema.rings
        self.silent = {ring for ring, row in self.cursors.items() if row < -(-until // rings[ring].divider)}
        return found, lost

    def silent_why(self, expressions: Iterable[BoundExpression]) -> str:
        """Return which signals of expressions record no more, in words; empty where all do."""
        full = [
            (column.element, self._reader.schema.rings[column.source])
            for bound in expressions
            for column in bound.columns
            if column.source in self.silent
        ]
        if not full:
            return ""
        element, ring = full[0]
        kept = "keeps its first samples only" if ring.buffer_type is BufferType.FIXED else "may not grow any more"
        name, buffer = self._infos[element].name, ring.buffer_type.name.lower()
        return f"'{name}' {kept} (buffer={buffer}), and its buffer is full"

    def _read(self, ring: int, until: int) -> tuple[SourceRows, int]:
        cursor, lost, picker = self.cursors[ring], 0, self._wanted[ring]
        divider = self._reader.schema.rings[ring].divider
        rows = self._reader.rows(ring, cursor, max(-(-until // divider) - cursor, 0), picker.words)
        if rows.first > cursor:
            lost = (rows.first - cursor) * divider
            rows = self._reader.rows(ring, rows.first, max(-(-until // divider) - rows.first, 0), picker.words)
        self.cursors[ring] = rows.first + len(rows)
        return SourceRows(rows.ticks, rows.time_ns, picker.numbers(rows)), lost

    def infos_of(self, names: Collection[str]) -> list[ElementInfo]:
        """Return what is known of these elements."""
        return [info for info in self._infos if info.name in names]

    def off_names(self, expressions: Iterable[BoundExpression]) -> list[str]:
        """Return the elements in expressions that are off."""
        places = {column.element for bound in expressions for column in bound.columns if column.source == OFF}
        return [self._infos[place].name for place in sorted(places)]
