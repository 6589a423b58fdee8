"""The judge thread: triggers and limits of the present run.

It judges and copies rows before they are overwritten; another thread writes the files of what is captured. What it
knows is stored before anything is told: a helper process that takes the place of this one goes on from there.
"""

import concurrent.futures
import contextlib
import logging
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec

from silo.conditions.captures.writer import CaptureWriter
from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.arguments import real
from silo.core.conditions import Conditions, TriggerOptions, TriggerWord
from silo.core.elements import ElementInfo, LoggerOptions
from silo.core.runtime import JUDGE_SUFFIX, runtime_dir
from silo.errors import ElementError, SegmentError, SiloError, lacks_descriptors
from silo.rpc.leases import Leases
from silo.rpc.published import EventKind
from silo.segment.held_runs import all_runs, number_of
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica

if TYPE_CHECKING:
    # 1.4 MB that a helper without triggers doesn't need
    from silo.conditions.memory import JudgeMemory
    from silo.conditions.segment_judge import JudgedStep, SegmentJudge

IDLE_S = 0.1  # how often is looked whether there is a run with triggers

WORST_PERIOD_S = 0.5  # how soon others see in the status what is violated
ORDER_S = 1.5  # how long a client waits for the judge thread; it asks for 2 s

SHORTEST_LEASE_S, LONGEST_LEASE_S = 0.5, 600.0
MOST_LEASED = 16
_CUT = "the run was cut"
log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class Standing:
    """How triggers and limits stood at a tick of a run."""

    run: str = ""
    tick: int = 0
    triggers: tuple[TriggerStatus, ...] = ()
    limits: tuple[LimitStatus, ...] = ()


class Judge:
    """Owns the judge thread and the one that writes captures."""

    def __init__(
        self,
        replica: Replica,
        events: EventNotifier,
        held: HeldRuns,
        limit_fired: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Judge what is held; `limit_fired` is called with the words of limits, as soon as they fire."""
        self._limit_fired = limit_fired
        self._replica, self._events, self._held = replica, events, held
        self.leased = LeasedTriggers()
        self._wake = threading.Event()
        self._ended = False
        # runs to be judged, and whether they ended while there was no helper process; in the order in which they came
        self._due: dict[tuple[str, bool], None] = {}
        self._judge: SegmentJudge | None = None
        self._before: SegmentJudge | None = None  # the newest that came to the end of its run
        self._judged_left: set[str] = set()  # runs of which that is done
        self._run = self._why = ""
        self._late_s = math.inf
        self._closed = False  # captures of a run that stopped are closed
        self._writer = CaptureWriter(replica, events)
        self._memory: JudgeMemory | None = None
        self._looked = self._caught_up = False  # for, and with, what a predecessor left
        self._hands_over = False
        self._orders: deque[tuple[Callable[[], Any], concurrent.futures.Future[Any]]] = deque()
        self._standing = Standing()  # at the end of the last run
        self._worst_due_s = 0.0
        self._failed = ""
        self._thread = threading.Thread(target=self._watch, name="judge")

    def start(self) -> None:
        """Start the threads."""
        self._thread.start()
        self._writer.start()

    def stop(self, why: str, *, hand_over: bool = False, within_s: float = math.inf) -> None:
        """Judge what is left, close the captures under way with the reason, write their files, end the threads.

        Captures that are not begun within `within_s` are told, and left to who comes after. With `hand_over` a
        successor goes on with those that it finds whole in the rings. May be called twice.
        """
        if not self._ended:
            self._why, self._hands_over = why, hand_over
            self._late_s = time.monotonic() + within_s / 2  # the other half is for writing
        self._ended = True
        self._wake.set()
        self._thread.join()
        self._writer.stop(within_s)
        if self._memory is not None and not self._hands_over:
            self._memory.forget_all(self._writer.left)

    def take(self, run: str, *, left: bool = False) -> None:
        """Judge a run of those that are held, however soon the next one follows.

        `left`: it ended while there was no helper process. It is judged to its end, whatever goes on meanwhile.
        """
        try:
            if not self._noted(run, left):
                return
        except (SegmentError, OSError) as error:
            if not lacks_descriptors(error):  # else it is taken up once a file can be opened
                log.exception("a run can't be judged")
                return
        self._due[run, left] = None
        self._wake.set()

    def _noted(self, run: str, left: bool) -> bool:
        """Note that a run is to be judged; False where it isn't."""
        reader = self._held.open(run)
        if reader is None:
            return False
        with contextlib.closing(reader):
            if not (left or reader.schema.conditions.judged):
                return False
            from silo.conditions.state_file import note_begun

            note_begun(reader.schema)
        return True

    def needs(self, run: str) -> bool:
        """Whether the rows of a run are still to be judged, or a capture of it is not written yet."""
        judge = self._judge
        is_judged = judge is not None and judge.reader.schema.run == run
        return is_judged or self._is_due(run) or run in self._writer.left or bool(self._writer.waiting(run))

    def _is_due(self, run: str) -> bool:
        return any(run == one for one, _ in self._due.copy())

    # --------------------------------------------------------------------------------- for threads that answer clients

    def standing(self) -> Standing:
        """Return how triggers and limits stand. Raises ElementError while the judge is too busy to say."""
        found: Standing = self._ordered(self._stands)
        return found

    def arm(self, name: str, *, armed: bool) -> None:
        """Have a trigger watch again, or no more. Raises ElementError."""

        def order() -> None:
            if self._judge is not None:
                self._judge.arm(name, armed=armed)

        self._ordered(order, changes=True)

    def force(self, name: str) -> int:
        """Fire now; returns the tick. Raises ElementError where nothing is logged."""
        tick: int = self._ordered(lambda: self._force(name), changes=True)
        return tick

    def hold(self, one: TriggerOptions, lease_s: float, owner: str) -> bool:
        """Hold a client's trigger for so long; whether it is a new one. Raises ElementError."""
        now = self._replica.now
        is_new = self.leased.hold(one, lease_s, owner, now.robot.conditions, now.table.elements, now.options)
        self._wake.set()
        return is_new

    def let_go(self, name: str) -> bool:
        """Forget a client's trigger; False where none is held of that name."""
        found = self.leased.drop(name)
        self._wake.set()
        return found is not None

    def names(self) -> list[str]:
        """Return the names of all triggers."""
        return [one.name for one in self.leased.beside(self._replica.now.robot.conditions).triggers]

    def acknowledge(self, names: list[str], who: str, time_ns: int) -> int:
        """Note that somebody has seen alarms; returns how many there were. Raises ElementError."""
        count: int = self._ordered(
            lambda: self._judge.limits.acknowledge(names, who, time_ns) if self._judge else 0, changes=True
        )
        return count

    def settle(self) -> None:
        """Return when what is logged by now is judged, and told; or a little later, where that takes long."""
        try:
            self._ordered(lambda: None)
        except ElementError as error:
            log.warning("what is saved now may lack the newest events of triggers and limits: %s", error)

    def _ordered(self, order: Callable[[], Any], *, changes: bool = False) -> Any:
        """Have the judge thread do it between two looks at the rings; what it changes is stored before the answer."""

        def done() -> Any:
            result = order()
            if changes and self._judge is not None:
                self._keep(self._judge)
            return result

        if not self._thread.is_alive():
            return done()
        future: concurrent.futures.Future[Any] = concurrent.futures.Future()
        self._orders.append((done, future))
        self._wake.set()
        try:
            return future.result(ORDER_S)
        except concurrent.futures.TimeoutError:
            raise ElementError("the helper process is busy judging rows; ask again in a moment") from None

    def _do_orders(self, count: int) -> None:
        for _ in range(count):
            order, future = self._orders.popleft()
            try:
                future.set_result(order())
            except Exception as error:  # noqa: BLE001  # it is raised where it was asked for
                future.set_exception(error)

    def _stands(self) -> Standing:
        judge, robot = self._judge, self._replica.now.robot
        if judge is None:
            known = {one.options.name: one for one in self._standing.triggers}
            why = self._failed
            triggers = [
                _waiting(
                    msgspec.structs.replace(known.get(one.name, TriggerStatus(one, TriggerWord.WAITING)), options=one),
                    why,
                )
                for one in self.leased.beside(robot.conditions).triggers
            ]
            limits = self._standing.limits or tuple(
                LimitStatus(one.name, one.name, LimitWord.BLIND, why=why or "nothing was logged yet").given(one)
                for one in robot.conditions.limits
            )
            return Standing(self._standing.run, self._standing.tick, self._owned(triggers), limits)
        run = judge.reader.schema.run
        found = [
            msgspec.structs.replace(one, files=self._writer.files(run, one.options.name)) for one in judge.triggers()
        ]
        if self._closed:
            found = [_waiting(one, "") for one in found]
        return Standing(run, judge.judged, self._owned(found), tuple(judge.limits.statuses()))

    def _owned(self, triggers: list[TriggerStatus]) -> tuple[TriggerStatus, ...]:
        return tuple(
            msgspec.structs.replace(one, owner=owner) if (owner := self.leased.owner(one.options.name)) else one
            for one in triggers
        )

    def _force(self, name: str) -> int:
        judge = self._judge
        if judge is None or self._closed:
            raise ElementError(f"trigger '{name}' can't fire: the logger doesn't run; start it; nothing was changed")
        found, tick = judge.force(name)
        self._bring(judge, found)
        return tick

    # ------------------------------------------------------------------------------------------------- judging

    def _watch(self) -> None:
        wait_s = IDLE_S
        while not self._ended:
            self._wake.wait(wait_s)
            self._wake.clear()
            known = len(self._orders)  # of later ones the next step first takes in what was set before them
            wait_s = self._guarded()
            self._do_orders(known)
        self._guarded()
        if self._hands_over:
            self._hand_over()
        self._end_run(self._why)
        self._do_orders(len(self._orders))

    def _guarded(self) -> float:
        """Do a step, whatever the rows hold; returns how long to wait for the next one."""
        try:
            return self._step()
        except Exception as error:
            if self._judge is None and lacks_descriptors(error):
                return IDLE_S  # nothing was begun: it is tried again
            told = str(error)
            if not isinstance(error, SiloError):
                log.exception("judging failed")
                told = f"{type(error).__name__}: {error}"
            self._forget(f"triggers and limits of this run are judged no more: {told}")
        return IDLE_S

    def _forget(self, text: str) -> None:
        """Judge this run no more. What was captured until now is written, and says so."""
        if self._judge is None and self._failed == text:
            return  # of a run that can't be opened, at each look
        judge, self._judge, self._failed = self._judge, None, text
        if judge is not None:
            found = judge.close("judging failed")
            try:
                self._bring(judge, found)
            except Exception:  # what it knows may be what is broken
                log.exception("what triggers and limits knew can't be stored")
                self._writer.add(*found.whole)
        self._events.publish(EventKind.BLIND, text)

    def _hand_over(self) -> None:
        """Leave what is under way to the helper process that comes next, and write what it would not find."""
        judge = self._judge
        if judge is None:
            return
        with contextlib.suppress(SiloError):
            self._bring(judge, judge.hand_over(self._why))
        self._judge = None

    def _step(self) -> float:
        if not self._looked:
            try:
                if any(name.endswith(JUDGE_SUFFIX) for name in os.listdir(runtime_dir())):  # noqa: PTH208  # nearly always there is none
                    self._remembering().look()
            except (SegmentError, OSError) as error:  # no runtime folder: then there is nothing in it either
                if lacks_descriptors(error):
                    raise
            self._looked = True
        present = self._replica.run  # first: those before it are due by then
        if not self._caught_up:
            self._caught_up = True
            try:
                self._catch_up(present)
            except Exception as error:
                self._caught_up = not lacks_descriptors(error)
                # no runtime folder: then there is nothing in it either
                if not (self._caught_up and isinstance(error, SegmentError)):
                    raise
        self._take_up(present)
        self._adopt()
        if self._memory is not None:
            there = self._held.ids()  # what was set in a run stays known as long as somebody can find its rows
            self._memory.forget_others(lambda run: run == self._run or self._is_due(run) or run in there)
        judge = self._judge
        if judge is None or not judge.active:
            self._replica.alarm = ("", 0)
            return IDLE_S
        running = judge.reader.running  # before its rows are read: a stop after them is seen at the next look
        self._bring(judge, judge.step(self._is_late))
        if not running and not self._closed:
            self._closed = True
            self._bring(judge, judge.end(_how_it_ended(judge.reader, "the logger was stopped"), self._is_late))
        if time.monotonic() >= self._worst_due_s:  # of 10,000 limits it takes a millisecond
            self._worst_due_s = time.monotonic() + WORST_PERIOD_S
            self._replica.alarm = judge.limits.worst()
        return judge.wait_s

    def _take_up(self, present: str) -> None:
        """Begin with the runs that are due, and the present one."""
        due = sorted(self._due.copy(), key=lambda one: not one[1])
        for run, left in due or [(present, False)]:  # let go of, without triggers, or not handed over
            is_done = bool(due)
            try:
                if not left:
                    self._next_run(run)
                elif (reader := self._held.open(run)) is not None:
                    self._judge_left(reader)
            except (SegmentError, OSError) as error:
                if not lacks_descriptors(error):
                    raise
                is_done = False
                return  # it is taken up once a file can be opened
            finally:
                if is_done:
                    del self._due[run, left]  # not what is said of it meanwhile: that it is over
        if not due:
            self._before = None  # its memory is needed

    def _is_late(self) -> bool:
        return time.monotonic() > self._late_s

    def _adopt(self) -> None:
        """Judge what the robot program has by now, where it differs from what the run began with."""
        robot, judge = self._replica.now.robot, self._judge
        for one in self.leased.expire():
            log.info("trigger '%s' of %s is forgotten: nobody renewed it", one.key, one.owner)
        conditions = self.leased.beside(robot.conditions)
        if robot.segment != self._replica.segment or (judge is not None and judge.conditions == conditions):
            return  # of another run, or known
        if judge is None:
            wanted = conditions.judged and not self._failed and self._run == self._replica.run
            if wanted and (reader := self._held.open(self._run)) is not None:
                self._begin(reader, conditions, since=reader.ticks)
        else:
            judge.adopt(conditions)
            self._tell_problems(judge)

    def _next_run(self, run: str) -> None:
        """Close the run before, and begin with this one, as soon as it is held; empty: there is none."""
        if run == self._run:
            return
        reader = self._held.open(run)
        if run and reader is None:
            return
        is_cut = self._judge is not None and reader is not None and reader.schema.follows(self._judge.reader.schema)
        self._end_run(_CUT if is_cut else "a new run began")
        self._run, self._closed, self._failed = run, False, ""
        if reader is not None:
            try:
                self._go_over(reader)
            except Exception as error:
                if lacks_descriptors(error):
                    self._run, self._judge = "", None  # the next look begins with it anew
                raise

    def _go_over(self, reader: SegmentReader) -> None:
        """Judge the run that has just begun."""
        run, conditions = reader.schema.run, self.leased.beside(reader.schema.conditions)
        if self._go_on(reader) or not conditions.judged:
            return
        # of a damaged state nobody knows what it had fired for: nothing fires twice
        is_damaged = self._memory is not None and run in self._memory.damaged
        self._begin(reader, conditions, since=reader.ticks if is_damaged else 0, after=self._followed(reader))

    def _followed(self, reader: SegmentReader) -> "SegmentJudge | None":
        """What judged the stretch that this run goes on, if it does."""
        before = self._before
        return before if before is not None and reader.schema.follows(before.reader.schema) else None

    def _catch_up(self, present: str) -> None:
        """Judge what a predecessor left of runs that are over, in their order: what held in one holds in the next.

        So are stretches of the present run that nobody judged, whether they were left or not: their program has them
        until they are saved.
        """
        options, reader = self._replica.now.options, self._held.open(present)
        chain, part = ("", 0) if reader is None else reader.schema.stretch
        found = sorted(all_runs(options.name, options.id), key=lambda one: number_of(one.path))
        mine = [one for one in found if one.schema.stretch[0] == chain and one.schema.stretch[1] <= part]
        known = [
            one.schema.stretch[1] for one in mine if self._memory is not None and self._memory.knows(one.schema.run)
        ]
        for one in found:
            schema = one.schema
            is_unknown = one in mine and max(known, default=0) <= schema.stretch[1] < part
            if (schema.run, True) in self._due or (is_unknown and schema.served and schema.conditions.judged):
                self._judge_left(one)
            else:
                one.close()

    def _judge_left(self, reader: SegmentReader) -> None:
        """Judge a run that is over, from where a predecessor stood; told is what nobody told before."""

        memory, run = self._remembering(), reader.schema.run
        if run in self._judged_left:
            return
        self._judged_left.add(run)
        state = memory.left(run)
        conditions, until = (reader.schema.conditions, 0) if state is None else (state.conditions, state.until)
        try:
            judge = self._made(reader, conditions, until)
            whole = judge.recall(state) if state is not None else []
            if state is None and (before := self._followed(reader)) is not None:
                judge.follow(before)
            found = judge.end(_how_it_ended(reader, "a new run began"), self._is_late)
        except (SiloError, OSError, ValueError, KeyError, IndexError) as error:
            log.exception("a run that ended while there was no helper process can't be judged")
            text = f"triggers and limits of run {run} are not judged to its end: {error}"
            self._events.publish(EventKind.BLIND, text, tick=max(0, until - 1), run=run)
        else:
            found.blind[:0] = judge.problems
            found.whole[:0] = whole
            self._before = judge
            memory.keep(judge, found, closed=True, failed="")
            memory.tell_new(found, judge)
            self._writer.add(*found.whole)

    # ------------------------------------------------------------------------------------------- before and after us

    def _remembering(self) -> "JudgeMemory":
        if self._memory is None:
            from silo.conditions.memory import JudgeMemory

            now = self._replica.now
            self._memory = JudgeMemory(now.robot.logger, now.options.id, now.robot.pid, self._events, self._writer)
        return self._memory

    def _go_on(self, reader: SegmentReader) -> bool:
        """Go on with a run that a predecessor judged; False where none did."""
        state = self._memory.left(reader.schema.run) if self._memory is not None else None
        if state is None:
            return False
        from silo.conditions.memory import lost_text

        self._closed, self._failed = state.closed, state.failed
        try:
            judge = self._made(reader, state.conditions, state.until)
            whole = judge.recall(state)
        except (SiloError, ValueError, KeyError, IndexError) as error:
            log.exception("what the helper process before this one left can't be used")
            for kept in state.captures:
                text = lost_text(kept, f"its judge left what can't be used: {error}")
                self._events.publish(EventKind.BLIND, text, about=kept.options.name)
            self._begin(reader, state.conditions, since=reader.ticks)
            return True
        self._writer.add(*whole)
        if not state.failed:
            self._judge = judge
        return True

    def _made(self, reader: SegmentReader, conditions: Conditions, since: int) -> "SegmentJudge":
        from silo.conditions.segment_judge import SegmentJudge

        return SegmentJudge(
            reader, self._replica.now.table.elements, conditions, since, lambda: self._writer.size_bytes
        )

    def _begin(
        self, reader: SegmentReader, conditions: Conditions, since: int = 0, after: "SegmentJudge | None" = None
    ) -> None:
        self._judge = judge = self._made(reader, conditions, since)
        if after is not None:
            judge.follow(after)
        if since:
            judge.count_from(self._remembering().numbers(reader.schema.run))
        else:
            self._remembering().begin(reader.schema.run)
        self._tell_problems(judge)
        self._keep(judge)  # a successor that finds nothing judges all: then nothing was told

    def _keep(self, judge: "SegmentJudge", found: "JudgedStep | None" = None) -> None:
        self._remembering().keep(judge, found, closed=self._closed, failed=self._failed)

    def _tell_problems(self, judge: "SegmentJudge") -> None:
        for problem in judge.problems:
            self._events.publish(EventKind.BLIND, problem)

    def _end_run(self, why: str) -> None:
        judge = self._judge
        if judge is None:
            return
        try:
            found = judge.end(why, self._is_late)
        except SiloError as error:
            found = judge.close(why)
            found.blind.append(f"the end of the run was not judged: {error}")
        self._closed = True
        self._bring(judge, found)
        self._standing = self._stands()
        self._judge, self._before = None, judge

    def _bring(self, judge: "SegmentJudge", found: "JudgedStep") -> None:
        """Store what is known by now, then tell what was found and have it written: never the other way round."""
        if found.limit_fired:
            self._limit_fired(found.limit_fired)
        memory = self._remembering()
        if found or memory.is_due():
            self._keep(judge, found)
        memory.tell(found, judge)
        self._writer.add(*found.whole)


def _how_it_ended(reader: SegmentReader, otherwise: str) -> str:
    """Say why a run is over, in the same words whether its end was seen or found."""
    return _CUT if reader.is_cut else reader.stop_reason or otherwise


def _waiting(one: TriggerStatus, why: str) -> TriggerStatus:
    """A trigger while nothing is logged."""
    state = one.state if one.options.armed else TriggerWord.OFF
    state = state if state in (TriggerWord.OFF, TriggerWord.FIRED) else TriggerWord.WAITING
    return msgspec.structs.replace(one, state=TriggerWord.BLIND if why else state, holdoff_s=0.0, why=why)


class LeasedTriggers(Leases[str, TriggerOptions]):
    """Triggers that clients hold under a lease, such as those of a scope: gone with a client that goes away.

    They are in no script, no saved file and no robot process; the judge takes them beside those of the logger. May be
    used by all threads.
    """

    def __init__(self) -> None:
        super().__init__(MOST_LEASED)

    def hold(
        self, one: TriggerOptions, lease_s: float, owner: str, conditions: Conditions, table: Sequence[ElementInfo],
        logger: LoggerOptions,
    ) -> bool:  # fmt: skip
        """Hold a trigger, or another one of its name; the same again only renews the lease. Whether it is a new one.

        Raises ElementError for what makes no sense beside the conditions and the table of the logger.
        """
        from silo.judging.checks import check_held, table_catalogue, with_trigger

        real("lease_s of a trigger", lease_s, SHORTEST_LEASE_S, LONGEST_LEASE_S, "s")
        with self:
            if self.get(one.name) == one:
                self.renew(one.name, lease_s, owner)
                return False
            if any(own.name == one.name for own in conditions.triggers):
                raise ElementError(
                    f"trigger '{one.name}' is one of the logger: hold yours under another name; nothing was changed"
                )
            if self.full(one.name, owner):
                held = ", ".join(sorted({each.owner for each in self.all()}))
                raise ElementError(f"{MOST_LEASED} triggers are held by clients already ({held}); nothing was changed")
            with_trigger(conditions, one, table_catalogue(table, logger.prefix))
            check_held(one, table, logger.frequency_hz)
            self.set(one.name, one, lease_s, owner)
            return True

    def owner(self, name: str) -> str:
        """Return who holds a trigger, empty where nobody does."""
        found = self.find(name)
        return found.owner if found is not None else ""

    def beside(self, conditions: Conditions) -> Conditions:
        """Return the conditions of the logger with those that are held; a name that the logger has is the logger's."""
        held = [one.value for one in self.all()]
        names = {one.name for one in conditions.triggers}
        more = tuple(one for one in held if one.name not in names)
        return msgspec.structs.replace(conditions, triggers=(*conditions.triggers, *more)) if more else conditions
