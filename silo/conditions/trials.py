"""What a trigger would have done in all that the buffers hold: tried on the rows, nothing is set or captured."""

from collections.abc import Sequence

import numpy as np

from silo.conditions.requests import TriggerTried
from silo.conditions.rows import JudgedRows
from silo.core.elements import Derived, ElementInfo, TriggerOptions
from silo.errors import ElementError
from silo.expressions.evaluation import UNOBSERVABLE, Evaluator
from silo.judging.definitions import trigger_rule
from silo.judging.switched_off import trigger_conditions
from silo.judging.triggers import Fire, Trigger
from silo.segment.layout import TIME_RING
from silo.segment.reader import SegmentReader

BATCH_TICKS = 16_384
MOST_FIRES = 1000


def try_trigger(
    options: TriggerOptions,
    reader: SegmentReader | None,
    table: Sequence[ElementInfo],
    derived: Sequence[Derived] | None = None,
) -> TriggerTried:
    """Return when a trigger would have fired. Raises ElementError, for an expression with the place of its mistake."""
    if reader is None or not reader.ticks:
        raise ElementError("nothing was logged yet, so that there is nothing to try a trigger on: start the logger")
    rows = JudgedRows(reader, table)
    if derived is not None:
        rows.derive(derived)
    rule = trigger_rule(options, reader.schema.frequency_hz)
    conditions = trigger_conditions(options, rows.catalogue)
    expressions = conditions.bounds
    columns = [column for bound in expressions for column in bound.columns]
    rows.want(columns, 0)
    size = _capture_bytes(reader, rule.pre + rule.post + 1)
    if not conditions.can_fire:
        off = ", ".join(conditions.off[:3])
        return TriggerTried(0, [], [], 0, -1, 0, 0, capture_bytes=size, why=f"{off} is off")
    evaluator, trigger = Evaluator(*expressions), Trigger(rule)
    begin, end = rows.oldest_tick(), reader.ticks
    fires: list[Fire] = []
    judged = blind = 0
    for until in [*range(begin + BATCH_TICKS, end, BATCH_TICKS), end]:
        found = evaluator.feed({ring: each for ring, each in rows.read(until)[0].items() if ring in evaluator.sources})
        codes = found.codes(0)
        judged += len(codes)
        blind += int(np.count_nonzero(codes == UNOBSERVABLE))
        rearm = found.codes(1) if options.rearm else None
        captures = trigger.feed(found.ticks, found.time_ns, codes, rearm)
        new = [fire for capture in captures for fire in capture.fires if not fires or fire.tick > fires[-1].tick]
        fires = [*fires, *new][-MOST_FIRES:]
    first, last = reader.rows(TIME_RING, begin, 1), reader.rows(TIME_RING, end - 1, 1)
    return TriggerTried(
        trigger.fires, [fire.tick for fire in fires], [fire.time_ns for fire in fires], begin, end - 1,
        int(first.time_ns[0]) if len(first) else 0, int(last.time_ns[0]) if len(last) else 0, judged, blind, size,
    )  # fmt: skip


def _capture_bytes(reader: SegmentReader, ticks: int) -> int:
    """About how large a capture of so many ticks is: what stands in its rows."""
    schema = reader.schema
    rings = {TIME_RING, *(one.ring for one in schema.elements if one.info.options.action.saves)}
    return sum(8 * schema.rings[ring].row_words * (ticks // schema.rings[ring].divider) for ring in rings)
