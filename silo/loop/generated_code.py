"""Writes `collect()`: a closure made for one plan, with everything that can be known at start folded in.

Measured against a class that walks lists: 8 - 45 % faster, and attributes cost 20 ns instead of 270.

Facts that decide its form, beside those in `silo.loop.pieces`:
- rows first, then each ring's head, the time ring last: a reader that sees tick k finds row k in every ring.
- to test one divider costs 30 ns a tick. With many of them, each row stands in a table under the tick at which it is
  due next: a tick at which nothing is due costs one look, and 500 dividers no more than the rows that they write.
"""

import functools
import itertools
import marshal
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import CodeType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType
from silo.core.tuning.parameters import ParameterInfo
from silo.errors import StateError
from silo.loop.clocks import NOTHING, clock_failed
from silo.loop.one_writer import guard_lines
from silo.loop.pieces import memory_window, row_pieces
from silo.loop.plan import Plan, RingPlan
from silo.loop.scratch import Slot, packer
from silo.loop.sources import Reference, ValuePath
from silo.segment.failures import record_failure
from silo.segment.layout import ORDERED_STORES, STAMP_WORDS, TIME_RING, RingControl, RingSchema
from silo.segment.parameter_changes import ChangeRecord
from silo.segment.reasons import StopReason
from silo.segment.writer import Chunks, Segment

INLINE_DIVIDERS = 4  # with more distinct ones, rows wait in a table for the tick at which they are due

# the store is the check of what the clock returned; a block that nothing fails in costs nothing. Beside its `try`: on a
# line of its own that is a step of the interpreter, and one of no block
CLOCK = """\
try: t = clock()
except StateError:
    raise
except Exception as error:
    raise clock_failed(NOTHING, error) from error
try: stamp[1] = t
except Exception as error:
    raise clock_failed(t, error) from error""".splitlines()

Collect = Callable[[], None]

# what a retired `collect` still needs
_ALWAYS = ("after_end", "forget", "overlap", "ident", "claim", "__builtins__")


class SlowReads:
    """Reads the slots of one run one by one where an attribute or function fails. Costs nothing until it is needed.

    The fast way stores all expressions of a divider at once and leaves zeros when one of them fails. Here the others
    are stored again; NaN or NaT stands in the place of the one that failed, or the value of its last committed row
    where a type has none; and the failure is counted in the segment.
    """

    def __init__(self, plan: Plan, segment: Segment, chunks: Mapping[int, Chunks]) -> None:
        """`chunks` are those of the growing rings, by ring; they may come later."""
        self._plan, self._segment, self._chunks = plan, segment, chunks
        self._blocks = {element.info.name: element.failures for element in segment.schema.elements}
        for slot in itertools.chain(*plan.scratch.by_divider().values()):
            if isinstance(slot.source, ValuePath) and slot.source.cuts is not None:
                slot.source.cuts.begin_run(functools.partial(segment.note_cut, self._blocks[slot.name]))
        self._columns: dict[int, tuple[RingPlan | None, list[tuple[int, int]]]] = {}

    def read(self, slots: Sequence[Slot], tick: int) -> None:
        """Store every slot's value or what stands for it, and count the elements that failed at this tick."""
        failed = {}
        for slot in slots:
            if not slot.try_store():
                slot.store_missing(self._last(slot) if slot.needs_last else b"")
                failed[slot.name] = slot.divider
        for name, divider in failed.items():
            record_failure(self._segment.words, self._blocks[name], tick, divider)

    def _last(self, slot: Slot) -> bytes:
        """The bytes of a slot in the newest row that holds it; before the first row what it began with."""
        found = self._columns.get(id(slot))
        if found is None:  # looked for once in a run: it goes through all words of the rings
            found = self._columns[id(slot)] = self._columns_of(slot)
        ring, columns = found
        words = np.zeros(-(-len(slot.first) // 8), np.int64)
        words.view(np.uint8)[: len(slot.first)] = np.frombuffer(slot.first, np.uint8)
        row = None if ring is None else self._newest_row(ring)
        if row is not None:
            memory, begin = row
            for word, column in columns:
                words[word] = memory[begin + column]
        return words.tobytes()[: len(slot.first)]

    def _columns_of(self, slot: Slot) -> tuple[RingPlan | None, list[tuple[int, int]]]:
        """The ring to ask, and which of the slot's words stands in which column of its rows.

        The last ring that has it: an element's live ring, which never ends, comes after its own.
        """
        first = (self._plan.scratch.address + slot.offset) // 8
        count = max(1, -(-len(slot.first) // 8))
        for ring in reversed(self._plan.rings):
            columns = np.flatnonzero((ring.words >= first) & (ring.words < first + count))
            if len(columns):
                words = (ring.words[columns] - first).tolist()
                return ring, list(zip(words, (STAMP_WORDS + columns).tolist(), strict=True))
        return None, []

    def _newest_row(self, ring: RingPlan) -> tuple[memoryview, int] | None:
        schema = self._segment.schema.rings[ring.schema.ring]
        head = self._segment.words[self._segment.ring_control(schema.ring) + RingControl.HEAD]
        if not head:
            return None
        if schema.buffer_type is BufferType.GROWING:
            return self._chunks[schema.ring].newest(head - 1)
        return self._segment.words, schema.offset // 8 + (head - 1) % schema.capacity * schema.row_words


class _Names:
    """Objects that the generated code refers to, each under a name of its own."""

    def __init__(self) -> None:
        self.objects: dict[str, object] = {}

    def give(self, prefix: str, value: object) -> str:
        name = f"{prefix}{len(self.objects)}"
        self.objects[name] = value
        return name


class LandsChanges(Protocol):
    """Where changes wait, until `land(n, t)` at the end of a tick stores them; `n` is the index of the next row."""

    waiting: list[Any]
    record: ChangeRecord | None

    def land(self, n: int, t: int, /) -> None:
        """Store or refuse what waits."""

    def described(self) -> Sequence[ParameterInfo]:
        """What each parameter is, with its present value."""

    def begin_run(self, record: ChangeRecord | None, next_row: Callable[[], int], /, *, first: bool = ...) -> None:
        """Record changes there from now on; `first`: with what landed since it was made."""

    def end_run(self, record: ChangeRecord | None, /) -> None:
        """Record there no more, unless another run began."""


def generate(
    plan: Plan,
    segment: Segment,
    clock: Callable[[], int],
    on_stop: Callable[[StopReason], None],
    after_end: Collect,
    *,
    serialized: bool = False,
    landing: LandsChanges | None = None,
) -> tuple[Collect, Callable[[], None]]:
    """`collect()` for one run, and what retires it: then it logs no tick more, also where somebody kept it.

    `on_stop` is called, once, by the tick with which the logger stops by itself. `after_end` is what a `collect` that
    somebody kept calls once the run was retired. The run belongs to the thread of its first tick; `serialized` lets
    threads take turns. `landing` is where changes of parameters wait; without it the text is what it was before there
    were any.
    """
    addresses = np.concatenate([ring.words for ring in plan.rings])
    memory, base = memory_window(addresses, plan.scratch.words)
    names = _Names()
    stamp = plan.scratch.words[:STAMP_WORDS].data
    names.objects |= {"m": memory, "w": segment.words, "stamp": stamp, "scratch": plan.scratch.words.data.cast("B")}
    names.objects |= {"clock": clock, "clock_failed": clock_failed, "NOTHING": NOTHING, "StateError": StateError}
    names.objects |= {"on_stop": on_stop, "copyto": np.copyto, "shape": np.shape}
    names.objects |= {
        "forget": _forget,
        "after_end": after_end,
        "FULL": StopReason.TIME_FULL,
        "growth_ended": segment.growth_ended,
        "rows_due": _rows_due,
    }
    if landing is not None:
        names.objects |= {"waiting": landing.waiting, "land": landing.land}
    writer = _Writer(plan, segment, names, memory, base, serialized=serialized, lands=landing is not None)
    source = writer.source()
    namespace: dict[str, Any] = dict(names.objects)
    exec(_code(source), namespace)  # of names made here and checked identifiers
    # without its maker in its own namespace, `collect` is no cycle: old buffers are freed at once, not some day
    collect, retire = namespace.pop("make")()
    collect.__qualname__ = "log.collect"  # as it stands in what Python says of a wrong call
    return collect, retire


def _code(source: str) -> CodeType:
    """The code of a text, an object of its own: what the interpreter learns of one run slows another one down."""
    code = marshal.loads(_compiled(source))
    assert isinstance(code, CodeType)
    return code


@functools.lru_cache(maxsize=8)
def _compiled(source: str) -> bytes:
    """A restart of an unchanged table has the text of the run before: 10,000 attributes take 0.3 s to compile."""
    return marshal.dumps(compile(source, "<silo collect>", "exec"))


def _rows_due(rows: "tuple[tuple[int, Callable[[int], int]], ...]", tick: int) -> "dict[int, list[object]]":
    """Which rows are due at which tick, each only under its next one from `tick` on; `rows` with their dividers."""
    due: dict[int, list[object]] = defaultdict(list)
    for divider, row in rows:
        due[-(-tick // divider) * divider].append(row)
    return due


def _forget(namespace: dict[str, Any]) -> None:
    """A retired `collect` that somebody kept must not keep the buffers of its run as well."""
    for name in [name for name in namespace if name not in _ALWAYS]:
        del namespace[name]


class _Writer:
    """Writes the source text, ring by ring."""

    def __init__(
        self,
        plan: Plan,
        segment: Segment,
        names: _Names,
        memory: NDArray[np.int64],
        base: int,
        *,
        serialized: bool,
        lands: bool,
    ) -> None:
        self._serialized, self._lands = serialized, lands
        self._plan, self._segment, self._names = plan, segment, names
        self._memory, self._base = memory, base
        self._state: list[str] = []  # assignments that open `make`, of the names that collect() changes
        self._functions: list[str] = []  # of `make`, each writes the rows of a divider
        self._chunks: dict[int, Chunks] = {}
        self._slow = SlowReads(plan, segment, self._chunks)
        self._undo: list[str] = []  # what takes back a tick that was interrupted
        self._changed: list[str] = ["tick"]
        self._stamp_gathered = False

    def source(self) -> str:
        guard = guard_lines(serialized=self._serialized)
        self._names.objects |= guard.objects
        self._end = guard.end
        body = self._groups()
        body += [*self._ring(self._plan.rings[TIME_RING], "n"), "tick = n"]
        if self._plan.time.buffer_type is BufferType.FIXED:
            body += [f"if n >= {self._plan.time.size}:", "    on_stop(FULL)"]
        if self._lands:  # at the end: at its start row k would show values that law k, before it, didn't have
            body += ["if waiting:", "    land(n, t)"]
        changed = ", ".join(self._changed + guard.changed)
        stamp = ["stamp[0] = tick"] if self._stamp_gathered else []
        lines = ["def make():", "    tick = 0", *_indent([*self._state, *guard.state, *self._functions], 1)]
        lines += ["    def collect():", f"        nonlocal {changed}", *_indent(guard.enter, 2)]
        # Ctrl-C may come within a tick: all of it is logged, or nothing. Between any two steps: so `n` is there before
        # the `try`, the first and the last step are within it, and what follows the last one changes nothing
        undo = ["if tick != n:", *_indent(self._undo, 1)]
        if guard.leave:
            undo = ["try:", *_indent(undo, 1), "finally:", *_indent(guard.leave, 1)]
        taken_back = ["except BaseException:", *_indent([*undo, "raise"], 1)]
        steps = ["try:", *_indent([*guard.begin, *CLOCK, *stamp, *body, *guard.end], 1), *taken_back]
        if sys.version_info < (3, 11):  # a second signal may come before the first one's is taken back
            steps = ["try:", *_indent(steps, 1), *taken_back]
        lines += _indent(["n = tick + 1", *steps, *guard.after], 2)
        lines += ["    def retire():", "        nonlocal busy, retired", "        busy = retired = True"]
        lines += ["    return collect, retire"]
        return "\n".join(lines)

    def _groups(self) -> list[str]:
        """The rows of all rings but the time ring's, divider by divider."""
        groups: dict[int, list[RingPlan]] = defaultdict(list)
        for ring in self._plan.rings[1:]:
            groups[ring.schema.divider].append(ring)
        slots = self._plan.scratch.by_divider()
        dividers = sorted(set(groups) | set(slots))
        body = []
        for divider in [divider for divider in dividers if divider == 1]:
            body += [*self._reads(slots.get(divider, [])), *self._rings(groups[divider], "n")]
        slow = [divider for divider in dividers if divider > 1]
        if len(slow) > INLINE_DIVIDERS:
            return body + self._scheduled(slow, groups, slots)
        for divider in slow:
            lines = [*self._reads(slots.get(divider, [])), f"k = tick // {divider} + 1"]
            lines += self._rings(groups[divider], "k")
            body += [self._due(divider, lines), *_indent(lines, 1)]
        return body

    def _due(self, divider: int, lines: list[str]) -> str:
        """The test whether rows are due. One more divider, that of parameters, takes 10 ns a tick: to compare, not to
        divide.
        """
        if not self._lands:
            return f"if not tick % {divider}:"
        due = f"due{divider}"
        lines.append(f"{due} += {divider}")
        self._state.append(f"{due} = 0")
        self._changed.append(due)
        self._undo.append(f"{due} = -(-tick // {divider}) * {divider}")
        return f"if tick == {due}:"

    def _rings(self, rings: list[RingPlan], count: str) -> list[str]:
        return [line for ring in rings for line in self._ring(ring, count)]

    def _scheduled(
        self, dividers: list[int], groups: dict[int, list[RingPlan]], slots: dict[int, list[Slot]]
    ) -> list[str]:
        """One function per divider that writes its rows and returns when they are due again.

        They don't refer to the table in which they stand: old buffers are freed at once, not when cycles are found.
        They remember no places either, which `collect()` would have to carry for the case that it is interrupted.
        """
        for divider in dividers:
            rings = [self._placed_ring(ring) for ring in groups[divider]]
            kept = [name for names, _ in rings for name in names]
            lines = [f"nonlocal {', '.join(kept)}"] if kept else []
            lines += [*self._reads(slots.get(divider, [])), f"k = tick // {divider} + 1"]
            lines += [line for _, stores in rings for line in stores]
            self._functions += [f"def row{divider}(t):", *_indent([*lines, f"return tick + {divider}"], 1)]
        rows = ", ".join(f"({divider}, row{divider})" for divider in dividers)
        self._functions += [f"rows = ({rows})", "due = {}", "astray = True"]
        self._changed += ["due", "astray"]
        self._undo.append("astray = True")
        return [
            "if astray:",
            "    due = rows_due(rows, tick)",
            "    astray = False",
            "if tick in due:",
            "    for row in due.pop(tick):",
            "        due[row(t)].append(row)",
        ]

    # ------------------------------------------------------------------------------------------- expressions

    def _reads(self, slots: list[Slot]) -> Iterator[str]:
        if not slots:
            return
        packed = [slot for slot in slots if slot.pack_format is not None]
        failed = self._names.give("slow", functools.partial(self._slow.read, slots))
        called = self._shared_calls(slots)
        reads = [f"{local} = {self._names.give('o', root)}()" for local, root in called.values()]
        if packed:
            pack = self._names.give("pack", packer(packed).pack_into)
            values = ", ".join(self._expression(slot, called) for slot in packed)
            reads.append(f"{pack}(scratch, {packed[0].offset}, {values})")
        copies = [line for slot in slots if slot.pack_format is None for line in self._copy(slot, called)]
        if copies:
            yield from ["try:", *_indent([*reads, *copies], 1)]
        else:
            yield f"try: {'; '.join(reads)}"
        yield "except Exception:"
        yield f"    {failed}(tick)"

    def _copy(self, slot: Slot, called: Mapping[int, tuple[str, object]]) -> list[str]:
        """Store one array. A plain store would cut floats to integers, 300 to 44, and write None as text.

        What comes in a wider type is checked value by value, this one alone: 5 us, where the whole divider costs 35.
        """
        alone = f"{self._names.give('slow', functools.partial(self._slow.read, [slot]))}(tick)"
        kind, size_bytes = slot.view.dtype.kind, slot.view.dtype.itemsize
        if kind in "SU":
            return [alone]
        value, shape = self._expression(slot, called), slot.view.shape
        is_narrow = size_bytes < {"f": 8, "c": 16}.get(kind, 0)
        # NumPy takes a `float` of Python for any kind of float, and makes it infinite
        what = f"{self._names.give('asarray', np.asarray)}(x)" if is_narrow and not shape else "x"
        store = f"copyto({self._names.give('v', slot.view)}, {what}"
        lines = [f"x = {value}"]
        if kind in "iub" or is_narrow:
            lines += [f"try: {store}, 'safe')", f"except TypeError: {alone}"]
        else:
            lines += [f"{store})"]
        if not shape or isinstance(slot.source, Reference):
            return lines
        # a value of another shape is spread over the whole by NumPy, if it can be: [7.0] to three of them
        if len(shape) == 1:
            return [lines[0], f"if len(x) != {shape[0]}: {alone}", "else:", *_indent(lines[1:], 1)]
        known = ["try: other = x.shape", "except AttributeError: other = shape(x)"]  # a list has none
        return [lines[0], *known, f"if other != {shape}: {alone}", "else:", *_indent(lines[1:], 1)]

    @staticmethod
    def _shared_calls(slots: list[Slot]) -> dict[int, tuple[str, object]]:
        """Functions whose result has several parts: called once per tick, so that the parts belong together."""
        sources = [slot.source for slot in slots if isinstance(slot.source, ValuePath)]
        roots = [source.root for source in sources if source.steps and source.steps[0].call]
        counts = Counter(map(id, roots))
        shared = {id(root): root for root in roots if counts[id(root)] > 1}
        return {key: (f"result{place}", root) for place, (key, root) in enumerate(shared.items())}

    def _expression(self, slot: Slot, called: Mapping[int, tuple[str, object]]) -> str:
        source = slot.source
        if not isinstance(source, ValuePath):
            return self._names.give("a", source.view)
        if source.steps and source.steps[0].call and id(source.root) in called:
            text, steps = called[id(source.root)][0], source.steps[1:]
        else:
            text, steps = self._names.give("o", source.root), source.steps
        for step in steps:
            if step.call:
                text += "()"
            elif step.attr:
                text += f".{step.attr}"
            else:
                text += f"[{self._names.give('key', step.key)}]"
        return text if source.convert is None else f"{self._names.give('c', source.convert)}({text})"

    # ------------------------------------------------------------------------------------------------- rings

    def _ring(self, ring: RingPlan, count: str) -> list[str]:
        """One row of one ring. `count` is the name of the number of rows with this one."""
        schema = self._segment.schema.rings[ring.schema.ring]
        offset = f"at{schema.ring}"
        self._changed.append(offset)
        if schema.buffer_type is BufferType.GROWING:
            return self._growing_ring(ring, schema, count, offset)
        begin = schema.offset // 8
        end = begin + schema.capacity * schema.row_words
        self._state.append(f"{offset} = {begin}")
        wrap = [f"if {offset} == {end}: {offset} = {begin}"] if schema.buffer_type is BufferType.LOOPING else []
        store = self._store(ring, schema, count, offset, "w", [f"{offset} += {schema.row_words}", *wrap])
        head = f"w[{self._segment.ring_control(schema.ring) + RingControl.HEAD}]"
        before = f"-(-tick // {schema.divider})"
        if schema.buffer_type is BufferType.LOOPING:
            self._undo += [
                f"{head} = {before}",
                f"{offset} = {begin} + {head} % {schema.capacity} * {schema.row_words}",
            ]
        else:
            self._undo += [
                f"{head} = min({before}, {schema.capacity})",
                f"{offset} = {begin} + {head} * {schema.row_words}",
            ]
        return store if wrap else [f"if {offset} != {end}:", *_indent(store, 1)]

    def _growing_ring(self, ring: RingPlan, schema: RingSchema, count: str, offset: str) -> list[str]:
        number = schema.ring
        memory, end, more = self._first_chunk(schema, offset)
        self._changed += [memory, end]
        control = self._segment.ring_control(number)
        head, lost = f"w[{control + RingControl.HEAD}]", control + RingControl.LOST
        self._undo += [
            f"if {end} > 0:",
            f"    {head} = -(-tick // {schema.divider})",
            f"    {memory}, {offset}, {end} = {more}({head} // {schema.capacity})",
            f"    {offset} = {head} % {schema.capacity} * {schema.row_words}",
        ]
        gone = [f"w[{lost}] += 1"]
        if number == TIME_RING:
            gone += ["on_stop(growth_ended())", *self._end, "return"]
        store = self._store(ring, schema, count, offset, memory, [f"{offset} += {schema.row_words}"])
        return [
            f"if {offset} == {end}: {memory}, {offset}, {end} = {more}(({count} - 1) // {schema.capacity})",
            f"if {end} > 0:",
            *_indent(store, 1),
            "else:",
            *_indent(gone, 1),
        ]

    def _first_chunk(self, schema: RingSchema, offset: str) -> tuple[str, str, str]:
        """The names of a growing ring: its present chunk, where that ends, and what gives the next one."""
        memory, end = f"mem{schema.ring}", f"end{schema.ring}"
        chunks = self._chunks[schema.ring] = Chunks(self._segment, schema)
        more = self._names.give("more", chunks.more)
        self._state.append(f"{memory}, {offset}, {end} = {more}(0)")
        return memory, end, more

    def _placed_ring(self, ring: RingPlan) -> tuple[list[str], list[str]]:
        """The same for a row whose place follows from its number `k` alone; first the names that it keeps.

        A tick that is done again writes the same row: its chunk is still the right one.
        """
        schema = self._segment.schema.rings[ring.schema.ring]
        head = f"w[{self._segment.ring_control(schema.ring) + RingControl.HEAD}]"
        before = f"-(-tick // {schema.divider})"
        self._undo.append(f"if {head} > {before}: {head} = {before}")
        if schema.buffer_type is not BufferType.GROWING:
            store = self._store(ring, schema, "k", "at", "w")
            place = [f"at = {schema.offset // 8} + (k - 1) % {schema.capacity} * {schema.row_words}", *store]
            fixed = schema.buffer_type is BufferType.FIXED
            return [], [f"if k <= {schema.capacity}:", *_indent(place, 1)] if fixed else place
        memory, end, more = self._first_chunk(schema, "_")
        lost = self._segment.ring_control(schema.ring) + RingControl.LOST
        return [memory, end], [
            f"at = (k - 1) % {schema.capacity} * {schema.row_words}",
            f"if not at and {end} > 0: {memory}, _, {end} = {more}((k - 1) // {schema.capacity})",
            f"if {end} > 0:",
            *_indent(self._store(ring, schema, "k", "at", memory), 1),
            "else:",
            f"    w[{lost}] += 1",
        ]

    def _store(
        self, ring: RingPlan, schema: RingSchema, count: str, offset: str, memory: str, advance: Sequence[str] = ()
    ) -> list[str]:
        """The steps that store a row, and `advance` its place.

        The head is the last: Python 3.10 takes Ctrl-C at jumps, and one behind the time ring's head would take a tick
        back that readers have seen.
        """
        control = self._segment.ring_control(schema.ring)
        live = schema.ring == TIME_RING and not ORDERED_STORES
        lines = [f"w[{control + RingControl.LIVE}] = {count} - 1"] if live else []
        for piece in row_pieces(ring.words, self._plan.scratch.address // 8, self._memory, self._base):
            begin = f"{offset} + {piece.begin}" if piece.begin else offset
            if piece.run is not None:
                value = self._names.give("run", piece.run)
            elif piece.indices is not None:
                value = f"m[{self._names.give('i', piece.indices)}]"
                self._stamp_gathered |= not piece.begin
            else:  # nothing to gather with the stamp: two stores are cheaper than a slice
                lines += [f"{memory}[{offset}] = tick", f"{memory}[{offset} + 1] = t"]
                continue
            lines.append(f"{memory}[{begin}:{offset} + {piece.end}] = {value}")
        return [*lines, *advance, f"w[{control + RingControl.HEAD}] = {count}"]


def _indent(lines: list[str], levels: int) -> list[str]:
    return ["    " * levels + line for line in lines]
