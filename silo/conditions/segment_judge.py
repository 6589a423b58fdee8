"""Judging the rows of one run: every trigger and limit over every row, and the captures that begin.

Belongs to the judge thread. It reads rings behind their heads and never holds up anybody; rows that were overwritten
before it came are what it was blind for, and it says so.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np

from silo.conditions.captures.buffer import CaptureBuffer, bytes_per_tick
from silo.conditions.limit_judge import LimitJudge, LimitNews
from silo.conditions.requests import TriggerTried
from silo.conditions.rows import JudgedRows
from silo.conditions.standing import CapturedSpan, TriggerStatus
from silo.conditions.state_file import JudgeState, KeptCapture, KeptTrigger, Untold
from silo.core.conditions import Conditions, Derived, TriggerOptions, TriggerWord
from silo.core.elements import ElementInfo
from silo.core.quantities.writing import many
from silo.errors import ElementError
from silo.expressions.binding import BoundExpression, means_else
from silo.expressions.evaluation import TRUE, UNOBSERVABLE, Evaluator
from silo.judging.checks import trigger_rule
from silo.judging.switched_off import trigger_conditions
from silo.judging.triggers import MOST_CAPTURE_BYTES, Capture, Fire, Trigger, TriggerMode, longest_capture
from silo.segment.held_runs import program_of
from silo.segment.layout import TIME_RING
from silo.segment.reader import SegmentReader

BATCH_TICKS = 2_048  # between which is looked whether there is time for more
MOST_SPOOL_BYTES = 512 * 2**20  # of all captures that are under way, or wait to be written
LONGEST_WAIT_S = 0.05
RELEASE_STEPS = 20
TRIED_TICKS = 16_384  # at once, of a trigger that is tried
MOST_FIRES = 1000  # that are told of one
MOST_TOLD = 20  # fires of a trigger in a second that are told one by one, the rest of them together


@dataclass
class _Watched:
    """One trigger of the run. Of one that can't be judged there is no evaluator."""

    options: TriggerOptions
    trigger: Trigger
    expressions: tuple[BoundExpression, ...] = ()
    evaluator: Evaluator | None = None
    why: str = ""
    note: str = ""  # what it is judged without
    silent: str = ""  # why nothing of its signals is recorded any more
    second: int = -1  # of the newest fire that was told, and how many of it were
    told: int = 0


@dataclass
class JudgedStep:
    """What one look at the rings brought: words for clients, and captures that are whole.

    `fired` has for each thing to tell the trigger and its fires, of what chatters several; `left_out` the trigger of a
    capture that there was no room for, and the words.
    """

    fired: list[tuple[str, list[Fire]]] = field(default_factory=list)
    blind: list[str] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    whole: list[CaptureBuffer] = field(default_factory=list)
    limits: list[LimitNews] = field(default_factory=list)
    limit_fired: str = ""  # by which one, also where clients are told of it a second later

    def __bool__(self) -> bool:
        return bool(self.fired or self.blind or self.left_out or self.whole or self.limits)


class SegmentJudge:
    """Judges one run."""

    def __init__(
        self,
        reader: SegmentReader,
        table: Sequence[ElementInfo],
        conditions: Conditions | None = None,
        since: int = 0,
        unwritten: Callable[[], int] = int,
    ) -> None:
        """Judge `conditions` (those that stand in the segment, if not given) from tick `since` on.

        `unwritten` tells the bytes of whole captures that wait to be written: they are memory too.
        `table` names the elements that are off too. `problems` has what can't be judged at all, in words.
        """
        self.reader = reader
        self.problems: list[str] = []
        self.conditions = Conditions()
        self._rows = JudgedRows(reader, table)
        self._watched: dict[str, _Watched] = {}
        self.limits = LimitJudge(self._rows)
        self.judged, self._steps = since, 0  # ticks; looks
        self._buffers: list[CaptureBuffer] = []
        self._numbers: dict[str, int] = {}  # captures of each name so far: they stand in names of files
        self._off: set[str] = set()  # elements in conditions that are off
        self._found = JudgedStep()
        self._unwritten = unwritten
        self.adopt(reader.schema.conditions if conditions is None else conditions)

    def adopt(self, conditions: Conditions) -> None:
        """Judge these triggers and limits from now on; those that stay the same go on as they are."""
        self.problems = []
        before, self.conditions = self._watched, conditions
        anew = self._rows.derive(conditions.derived)  # what stands on one may mean something else now
        self._numbers.update((name, one.trigger.captures) for name, one in before.items())
        self._watched = {}
        for one in conditions.triggers:
            self._watched[one.name] = self._taken(one, before.get(one.name), anew=anew)
        self.limits.adopt(conditions.limits, self.problems, self.judged, anew=anew)
        columns = [column for one in self._watched.values() for bound in one.expressions for column in bound.columns]
        self._rows.want([*columns, *self.limits.columns], self.judged)

    def _taken(self, options: TriggerOptions, before: _Watched | None, *, anew: bool) -> _Watched:
        """A trigger with these options: the same one, the same with other words about it, or one that begins now."""
        if (
            before is not None
            and before.options == options
            and not (
                anew
                and means_else(before.expressions, lambda: trigger_conditions(options, self._rows.catalogue).bounds)
            )
        ):
            return before
        rule = trigger_rule(options, self.reader.schema.frequency_hz)
        if options.save:
            rule = replace(rule, longest=min(rule.longest, longest_capture(bytes_per_tick(self.reader.schema))))
        trigger = Trigger(rule, armed=options.armed, captures=self._numbers.get(options.name, 0))
        made = _Watched(options, trigger)
        if before is not None:
            trigger.captures, trigger.fires, trigger.capture, trigger.before = (
                before.trigger.captures, before.trigger.fires, before.trigger.capture, before.trigger.before
            )  # fmt: skip
            but_armed = msgspec.structs.replace(before.options, armed=options.armed)
            if before.options != options and but_armed == options:
                before.options = options
                self._arm(before, armed=options.armed)
                return before
        try:
            found = trigger_conditions(options, self._rows.catalogue)
        except ElementError as error:
            made.why = str(error)
            self.problems.append(f"trigger '{options.name}' is not judged: {error}")
            return made
        self._off.update(found.off, found.without)
        if found.problem:
            self.problems.append(f"trigger '{options.name}' {found.problem}")
        if (not found.can_fire and rule.mode is not TriggerMode.AUTO) or not any(
            bound.sources for bound in found.bounds
        ):
            made.why = f"{', '.join(found.off[:3])} is off"
            return made
        others = (bound for one in self._watched.values() for bound in one.expressions)
        if no_room := self._rows.no_room(found.bounds, others):
            made.why = no_room
            self.problems.append(f"trigger '{options.name}' is not judged: {no_room}")
            return made
        made.note = found.problem.removeprefix("is ")
        made.expressions = found.bounds
        made.evaluator = self._rows.begin(found.bounds, Evaluator(*found.bounds), self.judged)
        return made

    @property
    def wait_s(self) -> float:
        """How long may pass until the next look: a quarter of what the shortest ring holds, 50 ms at most."""
        return max(0.005, min(LONGEST_WAIT_S, self._rows.shortest_s / 4))

    @property
    def active(self) -> bool:
        """Whether there is anything to judge."""
        return bool(self._watched or self._buffers) or self.limits.active

    # -------------------------------------------------------------------------------------------- what clients ask

    def arm(self, name: str, *, armed: bool) -> None:
        """Watch again, also after the one capture of mode single; or no more. Nothing for a name that isn't there."""
        if name in self._watched:
            self._arm(self._watched[name], armed=armed)

    def _arm(self, watched: _Watched, *, armed: bool) -> None:
        if armed:
            watched.trigger.arm(self.judged)
        else:
            watched.trigger.disarm()

    def force(self, name: str) -> tuple[JudgedStep, int]:
        """Fire at the newest tick that is judged; returns what that brought, and the tick. Raises ElementError."""
        if name not in self._watched:
            raise ElementError(f"no trigger is called '{name}'; nothing was changed")
        if not self.reader.ticks:
            raise ElementError(f"trigger '{name}' can't fire: nothing was logged yet; nothing was changed")
        found = self.step()
        tick, watched = self.judged - 1, self._watched[name]
        rows = self.reader.rows(TIME_RING, tick, 1)
        time_ns = int(rows.time_ns[0]) if len(rows) else self.reader.last_time_ns
        for capture in watched.trigger.force(tick, time_ns):
            self._capture(watched.options, capture, found)
        self._note_fires(watched, found)
        return found, tick

    def triggers(self) -> list[TriggerStatus]:
        """Return how each trigger stands."""
        return [self._status(one) for one in self._watched.values()]

    def _status(self, one: _Watched) -> TriggerStatus:
        trigger, tick = one.trigger, self.judged
        state, why = trigger.state(tick), one.why or one.note
        if state is TriggerWord.OFF:
            over = one.options.mode == TriggerMode.SINGLE.value and one.options.armed
            state = TriggerWord.FIRED if over else TriggerWord.OFF
        elif one.evaluator is None:
            state = TriggerWord.BLIND
        elif state is TriggerWord.BLIND:
            off = self._rows.off_names(one.expressions)
            silent = self._rows.silent_why(one.expressions)
            why = f"{', '.join(off[:3])} is off" if off else silent or "its signals have no value now"
        last = trigger.capture.fires[-1] if trigger.capture else None
        hz = self.reader.schema.frequency_hz
        left_s = trigger.holdoff_left(tick) / hz if state is TriggerWord.HOLDOFF else 0.0
        capturing_s = 0.0
        if trigger.capture and state is TriggerWord.FIRING:  # by its stamps: a loop may be slower than it should be
            begun_ns = self.reader.stamp_of(trigger.capture.first) or trigger.capture.fires[0].time_ns
            capturing_s = max(0, self.reader.stamp_of(tick - 1) - begun_ns) / 1e9 + 1 / hz
        return TriggerStatus(
            one.options, state, trigger.fires, trigger.captures, last.tick if last else -1, last.time_ns if last else 0,
            left_s, why, whole=_whole(trigger, tick), capturing_s=capturing_s,
        )  # fmt: skip

    # ------------------------------------------------------------------------------------------------------ judging

    def step(self, is_late: Callable[[], bool] = bool) -> JudgedStep:
        """Judge what is new, up to the tick that stands in all rings; what is left when `is_late` is told."""
        self._found = found = JudgedStep()
        # the time ring's head is written last: rows of all ticks before it stand in every ring
        ticks = self.reader.ticks
        while self.judged < ticks and self.active:
            if is_late():
                found.blind.append(
                    f"triggers and limits did not judge the last {ticks - self.judged} ticks: there was no time before "
                    "the end, as something fires too often; give it a holdoff"
                )
                break
            until = min(ticks, self.judged + BATCH_TICKS)
            self._judge(until, found)
            self.judged = until
            self._copy(until, found)
        self.judged = ticks
        if self.limits.active:
            found.blind += self.limits.check_silent()
            self.limits.check_stale(self.reader.stamp_of(ticks - 1))  # more may have come than was judged
            found.limits += self.limits.news()
            found.limit_fired = self.limits.take_fired() or next((one.text for one in found.limits if one.over), "")
        self._steps += 1
        if self._steps % RELEASE_STEPS == 0:
            self.reader.release_pages()  # else this process would count all buffers as its own memory
        return found

    def _judge(self, until: int, found: JudgedStep) -> None:
        rows, lost = self._rows.read(until)
        if lost:
            what = " and ".join(word for word, there in (("triggers", self._watched), ("limits", self.limits.active))
                                if there)  # fmt: skip
            found.blind.append(f"{what} were blind for {lost} ticks: they were overwritten before they were judged")
        self.limits.feed(rows)
        for one in self._watched.values():
            if one.evaluator is None:
                continue
            if not self._rows.overwritten.isdisjoint(one.evaluator.sources):
                one.trigger.blind(one.trigger.tick)
            judged = one.evaluator.feed({ring: rows[ring] for ring in one.evaluator.sources})
            rearm = judged.codes(1) if one.options.rearm else None
            for capture in one.trigger.feed(judged.ticks, judged.time_ns, judged.codes(0), rearm):
                self._capture(one.options, capture, found)
            self._note_fires(one, found)
            self._check_silent(one, one.evaluator, until - 1, found)

    def _note_fires(self, one: _Watched, found: JudgedStep) -> None:
        """Have each fire told, also one that makes a capture longer; of what chatters the first of each second."""
        if not one.options.save:
            return  # it is for looking
        name, rest = one.options.name, list[Fire]()
        for fire in one.trigger.fired:
            second = int(fire.tick // self.reader.schema.frequency_hz)
            if second != one.second:
                one.second, one.told = second, 0
            one.told += 1
            if one.told <= MOST_TOLD:
                found.fired.append((name, [fire]))
            else:
                rest.append(fire)
        if rest:
            found.fired.append((name, rest))

    def _check_silent(self, one: _Watched, evaluator: Evaluator, tick: int, found: JudgedStep) -> None:
        """Take in that none of the signals of a trigger is recorded any more."""
        why = self._rows.silent_why(one.expressions) if self._rows.silent.issuperset(evaluator.sources) else ""
        if why:
            one.trigger.blind(tick)
        if why and not one.silent:
            found.blind.append(f"trigger '{one.options.name}' is blind from here on: {why}")
        one.silent = why

    # ------------------------------------------------------------------------------------------------- captures

    def _capture(self, options: TriggerOptions, capture: Capture, found: JudgedStep) -> None:
        for buffer in self._buffers:
            if buffer.trigger == options.name and buffer.capture.number == capture.number:
                buffer.extend(capture)
                return
        if not options.save:
            return  # it is for looking: what it captured is still in the rings
        if self._taken_bytes() > MOST_SPOOL_BYTES:
            text = (
                f"capture {capture.number} of '{options.name}' was left out: those before it, which are not yet "
                f"written, take more than {MOST_SPOOL_BYTES // 2**20} MB; make pre and post shorter, or give a holdoff"
            )
            found.left_out.append((options.name, text))
            return
        buffer = CaptureBuffer(options, capture, self.reader, self.conditions)
        # at once, whatever was judged: the oldest rows are overwritten next
        buffer.append(self.reader.ticks)
        self._buffers.append(buffer)

    def _copy(self, until: int, found: JudgedStep) -> None:
        under_way: list[CaptureBuffer] = []
        for buffer in self._buffers:
            is_whole = buffer.append(until)
            if buffer.is_closed_early:
                self._cut(buffer, f"closed at {MOST_CAPTURE_BYTES // 2**20} MB")
            (found.whole if is_whole or buffer.ended else under_way).append(buffer)
        self._buffers = under_way
        if under_way and self._taken_bytes() + sum(buffer.size_bytes for buffer in found.whole) > MOST_SPOOL_BYTES:
            for buffer in under_way:
                self._cut(buffer, f"closed as all captures in memory take {MOST_SPOOL_BYTES // 2**20} MB")
            found.whole += under_way
            self._buffers = []

    def _taken_bytes(self) -> int:
        return self._unwritten() + sum(buffer.size_bytes for buffer in self._buffers)

    def _cut(self, buffer: CaptureBuffer, why: str) -> None:
        """Close a capture before its end; what fires next begins another one."""
        self._end_spool(buffer, why)
        one = self._watched.get(buffer.trigger)
        if one is not None and one.trigger.capture is not None and one.trigger.capture.number == buffer.capture.number:
            one.trigger.capture = replace(one.trigger.capture, last=buffer.ticks - 1)

    def end(self, why: str, is_late: Callable[[], bool] = bool) -> JudgedStep:
        """Judge the rest, and close the captures that are under way, with the reason."""
        self.step(is_late)
        return self.close(why)

    def close(self, why: str) -> JudgedStep:
        """Close the captures that are under way and judge no more; with what the last step found until it failed."""
        found, self._found = self._found, JudgedStep()
        found.limits += self.limits.news(last=True)  # what would have been told a little later
        for buffer in self._buffers:
            self._end_spool(buffer, why)
        found.whole += self._buffers
        self._buffers = []
        return found

    def _end_spool(self, buffer: CaptureBuffer, why: str) -> None:
        missing = max(0, buffer.capture.last + 1 - buffer.ticks)
        buffer.ended = f"{why}, {many(missing, 'tick')} before its end"

    def hand_over(self, why: str) -> JudgedStep:
        """Judge the rest, and close the captures that a successor would not find whole in the rings any more."""
        found = self.step()
        gone = [buffer for buffer in self._buffers if not buffer.is_held()]
        for buffer in gone:
            self._cut(buffer, why)
        found.whole += gone
        self._buffers = [buffer for buffer in self._buffers if buffer not in gone]
        return found

    # ------------------------------------------------------------------------------------------------- going on

    def state(self, waiting: Sequence[KeptCapture], untold: Sequence[Untold], *, closed: bool) -> JudgeState:
        """Return what a successor needs to go on, with the captures that wait to be written."""
        schema = self.reader.schema
        triggers = [
            KeptTrigger(one.options, one.trigger, one.evaluator.memory() if one.evaluator else None)
            for one in self._watched.values()
        ]
        under_way = [KeptCapture(buffer.options, buffer.capture, buffer.ended) for buffer in self._buffers]
        return JudgeState(
            schema.run, schema.pid, schema.pid_start, self.judged, self.conditions, dict(self._rows.cursors), triggers,
            self.limits.memory(), self._numbers, [*under_way, *waiting], list(untold), closed,
            off=self._rows.infos_of(self._off), program=program_of(schema), folder=schema.folder,
        )  # fmt: skip

    def count_from(self, numbers: Mapping[str, int]) -> None:
        """Number captures from these on."""
        self._numbers.update(numbers)
        for name, one in self._watched.items():
            one.trigger.captures = max(one.trigger.captures, numbers.get(name, 0))

    def follow(self, before: "SegmentJudge") -> None:
        """Go on after a cut of the run that `before` judged to its end: nothing fires, or is to be seen, twice."""
        for name, one in self._watched.items():
            known = before._watched.get(name)
            if known is None:
                continue
            trigger = known.trigger.shifted(before.judged)
            if known.options == one.options:
                one.trigger = replace(trigger, rule=one.trigger.rule)
                self._rows.go_on(one.expressions, one.evaluator, before._rows, known.expressions, known.evaluator)
                if one.evaluator is None:
                    one.trigger.blind(-1)  # what lasted until now may end unseen
            else:
                one.trigger.captures, one.trigger.fires = trigger.captures, trigger.fires
                one.trigger.capture = trigger.capture
        self.limits.follow(before.limits)
        self._numbers.update(before._numbers)

    def recall(self, state: JudgeState) -> list[CaptureBuffer]:
        """Go on where another one stood, of the same conditions; returns the captures that only have to be written.

        Those under way are copied anew, as far as the rings still hold them. Raises ValueError, KeyError.
        """
        for kept in state.triggers:
            one = self._watched.get(kept.options.name)
            if one is not None and one.options == kept.options:
                one.trigger = kept.trigger
                if one.evaluator is not None and kept.evaluator is not None:
                    one.evaluator.recall(kept.evaluator)
        self.limits.recall(state.limits)
        self._rows.recall(state.cursors)
        self._numbers.update(state.numbers)
        whole: list[CaptureBuffer] = []
        for capture in state.captures:
            buffer = CaptureBuffer(capture.options, capture.capture, self.reader, self.conditions)
            buffer.ended = capture.ended
            (whole if buffer.append(self.judged) or capture.ended else self._buffers).append(buffer)
        return whole


def _whole(trigger: Trigger, until: int) -> CapturedSpan | None:
    """The newest capture all of whose ticks are before `until`."""
    found = next((one for one in (trigger.capture, trigger.before) if one is not None and 0 <= one.last < until), None)
    if found is None:
        return None
    fire = found.fires[0]
    return CapturedSpan(found.number, found.first, found.last, fire.tick, fire.time_ns, fire.forced)


def try_trigger(
    options: TriggerOptions,
    reader: SegmentReader | None,
    table: Sequence[ElementInfo],
    derived: Sequence[Derived] | None = None,
) -> TriggerTried:
    """Return when a trigger would have fired in all that the buffers hold; nothing is set or captured.

    Raises ElementError, for an expression with the place of its mistake.
    """
    if reader is None or not reader.ticks:
        raise ElementError("nothing was logged yet, so that there is nothing to try a trigger on: start the logger")
    rows = JudgedRows(reader, table)
    if derived is not None:
        rows.derive(derived)
    rule = trigger_rule(options, reader.schema.frequency_hz)
    conditions = trigger_conditions(options, rows.catalogue)
    expressions = conditions.bounds
    rows.want([column for bound in expressions for column in bound.columns], 0)
    size = _capture_bytes(reader, rule.pre + rule.post + 1)
    if not conditions.can_fire:
        off = ", ".join(conditions.off[:3])
        return TriggerTried(0, [], [], 0, -1, 0, 0, capture_bytes=size, why=f"{off} is off")
    evaluator, trigger = Evaluator(*expressions), Trigger(rule)
    begin, end = rows.oldest_tick(), reader.ticks
    fires: list[Fire] = []
    judged = blind = held = 0
    for until in [*range(begin + TRIED_TICKS, end, TRIED_TICKS), end]:
        found = evaluator.feed({ring: each for ring, each in rows.read(until)[0].items() if ring in evaluator.sources})
        codes = found.codes(0)
        judged += len(codes)
        blind += int(np.count_nonzero(codes == UNOBSERVABLE))
        held += int(np.count_nonzero(codes == TRUE))
        rearm = found.codes(1) if options.rearm else None
        captures = trigger.feed(found.ticks, found.time_ns, codes, rearm)
        new = [fire for capture in captures for fire in capture.fires if not fires or fire.tick > fires[-1].tick]
        fires = [*fires, *new][-MOST_FIRES:]
    first, last = reader.rows(TIME_RING, begin, 1), reader.rows(TIME_RING, end - 1, 1)
    return TriggerTried(
        trigger.fires, [fire.tick for fire in fires], [fire.time_ns for fire in fires], begin, end - 1,
        int(first.time_ns[0]) if len(first) else 0, int(last.time_ns[0]) if len(last) else 0, judged, blind, size,
        held=held,
    )  # fmt: skip


def _capture_bytes(reader: SegmentReader, ticks: int) -> int:
    """About how large a capture of so many ticks is: what stands in its rows."""
    schema = reader.schema
    rings = {TIME_RING, *(one.ring for one in schema.elements if one.info.options.action.saves)}
    return sum(8 * schema.rings[ring].row_words * (ticks // schema.rings[ring].divider) for ring in rings)
