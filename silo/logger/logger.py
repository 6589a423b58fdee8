"""The logger: registers variables, runs, saves. What a control program imports.

It is made of parts, each usable by itself: the table and its script, conditions, the present run, the life cycle that
they share. `collect()` runs the closure that `start()` generated and nothing else; everything that changes the table
or the state takes one lock, which `collect()` never touches.
"""

import functools
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, NoReturn

from silo.core.arguments import switch, whole, word
from silo.core.calls import of, told_class
from silo.core.elements import DEFAULT_MAX_TIME_S, ControlMode, GroupRole, Storage, Threads
from silo.core.episodes.block import EpisodeBlock
from silo.core.quantities.writing import and_more, many
from silo.errors import ArgumentError, StateError
from silo.logger.arguments.keywords import AnyStorage, AnyThreads, ControlWord, GroupRoleWord
from silo.logger.arguments.options import (
    end_at_start,
    logger_options,
    serving_config,
    serving_group,
    warn_if_not_durable,
    warn_of_end,
    warn_of_folder,
)
from silo.logger.arguments.other_names import LoggerNames, no_attribute_of
from silo.logger.conditions import LoggerConditions
from silo.logger.current_run import CurrentRun, check_cut
from silo.logger.life_cycle import LifeCycle, WantedStretch
from silo.logger.registrations import Registrations
from silo.logger.results import Elements, LoggedElement, as_html
from silo.logger.run_data import RunData, types_in_one_list
from silo.logger.scripted_table import ScriptedTable
from silo.logger.tunables import Tunables
from silo.logger.unclosed import (
    LoggerEnd,
    drop_journals,
    end_namesakes,
    ends_after_calls,
    forked_collect,
    say_dropped,
    say_what_is_held,
    watch,
)
from silo.loop.clocks import TIMES, nanosecond_clock, timed
from silo.loop.plan import Element
from silo.loop.run import Run
from silo.loop.sources import reads
from silo.parameters.parameter import Parameter
from silo.parameters.parameters import Parameters
from silo.recovery.runs import look_back
from silo.segment.held_runs import is_due
from silo.segment.layout import Cut
from silo.segment.marks import NO_WORDS, marker
from silo.segment.reasons import STOP_TEXTS, StopReason
from silo.segment.retention import ending_by_time, kept_how
from silo.state.robot import UnsavedWord

if TYPE_CHECKING:
    from silo.logger.serving.serving import Serving

log = logging.getLogger("silo")


@ends_after_calls(leave=("collect", "mark", "episode", "close"))
@told_class("log", make="silo.Logger", leave=("collect", "mark"))
class Logger(LoggerNames):
    """Logs variables of a control program, by reference, once per control tick.

    Args:
        name: of the logger, and the start of its file names: letters, digits, `_`, `.` and `-`.
        frequency: control ticks per second: a number (Hz), or words (`"500Hz"`, `"1kHz"`).
        max_time: how long fixed and growing logs may become: a number (s) or words (`"10min"`), 0 for no limit; a run
            that has other buffers as well ends then too, which its start says.
        script: YAML file with the configuration; read by `update()` if it exists. Without a word `NAME.logger.yaml` of
            the present folder, or else its `logger.yaml`, which is of all loggers there; None (or False): none is read.
        prefix: start of all element names.
        clock: returns the time stamp of a tick, as int nanoseconds or float seconds; the system clock if not given.
        folder: where saved files go.
        storage: `"memory"`: survives the end of the program and of its helper process, not a power cut; `"disk"`: the
            helper process of `serve()` also keeps a journal in `folder`, which survives a power cut but for the last
            moment; `"file"`: the buffers are a file in `folder`, which saves memory and promises nothing for a power
            cut.
        size_tiers: rings per divider and buffer type; more of them cost time in each tick, fewer cost memory.
        memory_limit_mb: what growing buffers may take together.
        checked: copy each variable by NumPy instead of by address, 10 times slower.
        threads: `"single"`: `collect()` belongs to the thread that calls it first after each start; `"serialized"`: any
            thread, one at a time.
        about: what is to be known of its runs: `{"operator": "alice"}`. Stands in every file, beside host, versions and
            the git commit of the program's folder.
        timing: log how late the loop is, too: elements `period`, `lateness` and `work` (s) in the group `timing`.

    Raises:
        ElementError: an argument is out of range.
    """

    def __init__(
        self,
        name: str = "silo",
        *,
        frequency: float | str = 100.0,
        max_time: float | str = DEFAULT_MAX_TIME_S,
        script: str | os.PathLike[str] | bool | None = True,
        prefix: str = "/log",
        clock: Callable[[], int | float] | None = None,
        folder: str | os.PathLike[str] = ".",
        storage: AnyStorage = Storage.MEMORY,
        size_tiers: int = 3,
        memory_limit_mb: int = 1024,
        checked: bool = False,
        threads: AnyThreads = Threads.SINGLE,
        about: Mapping[str, object] | None = None,
        timing: bool = False,
    ) -> None:
        options = logger_options(
            name=name,
            frequency=frequency,
            max_time=max_time,
            script=script,
            prefix=prefix,
            folder=folder,
            storage=storage,
            size_tiers=size_tiers,
            memory_limit_mb=memory_limit_mb,
            checked=checked,
            threads=threads,
            about=about,
        )
        with_times = switch("timing", timing)
        self._clock = nanosecond_clock(clock)
        end_namesakes(options.name)
        self.options = options
        self._life = LifeCycle(options.name)
        self._table = Registrations(options.prefix)
        self._conditions = LoggerConditions(options, self._table, self._life)
        self._scripted = ScriptedTable(
            options, self._table, self._conditions, self._life, type(self), has_script=script not in (None, False)
        )
        self.parameters = Parameters()
        self._tunables = Tunables(options, self._scripted.add, self._life, self.parameters)
        self._present = CurrentRun()
        self._data = RunData(options, self._table, self._conditions, self._life, self._present)
        self._collect: Callable[[], None] | None = None
        self._ignored = 0
        self._mark, self._mark_in = marker()
        vars(self)["mark"] = self._mark  # in the instance in place of the method, as `collect`: 40 ns less
        self._times = [
            self._scripted.array(name, group="timing", unit="s", description=words)
            for name, words in (TIMES.items() if with_times else ())
        ]
        watch(self)  # its data outlives a process that ends without close()

    # ------------------------------------------------------------------------------- what its parts do

    add = of("_scripted", ScriptedTable.add)
    array = of("_scripted", ScriptedTable.array)
    value = of("_scripted", ScriptedTable.value)
    update = of("_scripted", ScriptedTable.update)
    set = of("_scripted", ScriptedTable.set)
    remove = of("_scripted", ScriptedTable.remove)
    load_script = of("_scripted", ScriptedTable.load_script)
    save_script = of("_scripted", ScriptedTable.save_script)

    parameter = of("_tunables", Tunables.parameter)
    input = of("_tunables", Tunables.input)

    derive = of("_conditions", LoggerConditions.derive)
    limit = of("_conditions", LoggerConditions.limit)
    trigger = of("_conditions", LoggerConditions.trigger)

    snapshot = of("_data", RunData.snapshot)
    read_new_values = of("_data", RunData.read_new_values)
    save = types_in_one_list(of("_data", RunData.save))
    record = of("_data", RunData.record)
    stop_recording = of("_data", RunData.stop_recording)

    @property
    def elements(self) -> Elements:
        """The element table, in the order of registration; a row is found by its number or its name."""
        return Elements(self._table.infos, self._table.prefix)

    def __len__(self) -> int:
        """How many elements the table has."""
        return len(self._table.elements)

    def __iter__(self) -> Iterator[str]:
        """The names of the elements."""
        return iter([info.name for info in self._table.infos])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._table.has(name)

    # ------------------------------------------------------------------------------------------------ the loop

    def collect(self) -> None:
        """Log one tick. While the logger stands still nothing is logged, which is told once.

        Raises StateError in every thread but the first that called it since the last start (see `threads`).
        """
        # while the logger runs, the generated closure stands in the instance in place of this method: 40 ns less a tick
        self._collect_now()

    def _collect_now(self) -> None:
        if self._collect is not None:
            self._collect()
            return
        if self.parameters.landing.waiting:
            self.parameters.landing.land(-1, self._clock())
        self._ignored += 1
        if self._ignored == 1:
            log.warning("%s: %s", self.options.name, self._why_ignored())

    def _why_ignored(self) -> str:
        if self._life.closed:
            return "collect() logs nothing any more, the logger is closed: make a new one"
        if not self._present.number:
            return "collect() logs nothing before the first start: call start()"
        if not self._life.reason:
            return "collect() logs nothing while start() prepares a new run, or where it failed, which it told"
        return f"collect() logs nothing while it stands still ({self._life.reason}): start() begins a new run"

    def _set_collect(self, collect: Callable[[], None] | None) -> None:
        """Have a run's `collect` in the place of this class's, or none: it logs nothing then."""
        self._collect = collect
        if collect is None:
            vars(self).pop("collect", None)
        else:
            vars(self)["collect"] = collect

    def mark(self, text: str = NO_WORDS, *more: object) -> None:
        """Mark the newest tick with some words: `log.mark("push 3")`. Made for the control loop: 0.3 us, never waits.

        Any thread may mark, also after a stop; before the first start there is nothing to mark. The mark is in shared
        memory when this returns, and survives what a collected tick survives; a power cut (`storage="disk"`) once it is
        in the event log, 0.2 s later. Text beyond 224 bytes of UTF-8 is cut.
        The newest 1024 marks of a run are in its files; with `serve()`, which takes them over five times a second, all.

        Args:
            text: the words.
            *more: what follows them, a space between: `log.mark("push", 3)`.
        """
        self._mark(text, *more)

    def episode(self, /, name: str, success: bool | None = None, **about: object) -> EpisodeBlock:
        """Mark a stretch of the run: `with log.episode("pick", object="cup") as episode: ...; episode.success = True`.

        It is two marks and is kept as marks are: it survives `kill -9`, and is in files, parts and captures, where
        `silo.open_log(...).episodes` has it. An exception in the block makes it no success.

        Args:
            name: what is done, up to 60 bytes.
            success: whether it went well, until `episode.success` is set.
            **about: what else is to be known: `object="cup", speed=0.3`.

        Returns:
            A context manager.

        Raises:
            ElementError: the name or a fact is too long.
        """
        missing = "" if self._present.number else "call start() first"
        return EpisodeBlock(functools.partial(Logger.mark, self), name, success, about, missing)

    def start(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Clear all buffers and begin to log; calls `update()` first if that was never done.

        The first start looks for what earlier processes of this logger (same name, same folder) left unsaved. The
        helper process of a served logger saves that, beside its work, and says where, on the console and as an event;
        without one, a warning names the `silo recover` command that does.

        A run that a client began meanwhile is saved, where ticks came, and this start begins another.

        Args:
            unsaved: what becomes of data of the last run that is in no file: `"clear"` drops it, `"save"` saves it
                first, `"refuse"` raises a StateError that tells how much it is. Where two runs don't fit into the
                memory it is saved in any case.

        Raises:
            StateError: the logger runs already, or holds unsaved data that is not to be cleared.
            SegmentError: there is no room for the buffers.
            SaveError: what had to be saved could not be: the last run is then kept as it was.
        """
        with self._life.cutting, self._life.lock:
            if self._life.running and self._life.begun_by and self.ticks:
                unsaved = "save"
                log.warning(
                    "%s: %s had started it: what was logged since is saved, and this start begins anew",
                    self.options.name,
                    self._life.begun_by,
                )
                self.stop()
            self._life.check_stopped("start")
            if not self._scripted.is_updated:
                self.update()
            self._data.look_for_unheld()  # a run that stopped by itself may be saved now
            dropped = self._present.settle(unsaved, self.options, self._conditions.now)
            warn_of_folder(self.options)
            self._scripted.adopt_late()
            self._conditions.warn_at_start(served=self._life.serving is not None)
            warn_if_not_durable(self.options, served=self._life.serving is not None)
            if self._present.number == 0:
                look_back(self.options, served=self._life.helper_is_up)
            self._present.number += 1
            self._life.cut, self._life.memory_bytes = self._cut, self._present.memory_bytes
            self._life.begun_by, self._life.give_way = "", self._give_way
            self._begin(dropped)

    def _begin(self, dropped: int) -> None:
        run = self._present.replace(
            self._make_run, self.options, self._conditions.now, self._let_go, self._hand_over, self._is_wanted
        )
        self._life.reason = ""
        self._ignored = 0
        self._life.running = True
        self._present.tell_of_drop(dropped, self.options.name)
        warn_of_end(self.options, end_at_start(self.options, self._table.infos))
        self._mark_in(run.segment.marks)
        self._set_collect(self._collect_of(run))
        self._life.tell()

    def _begun_by(self, client: str) -> None:
        """Note whose start the present run has: until it has a tick, no call of the program fails for it."""
        self._life.begun_by = client

    def _give_way(self) -> None:
        if not self.ticks:
            log.warning(
                "%s: %s had started it while the program still sets it up: that run, without a tick, gives way",
                self.options.name,
                self._life.begun_by,
            )
            self.stop()

    def _make_run(self, wanted: WantedStretch | None = None, cut: Cut | None = None) -> Run:
        return Run(
            self.options,
            wanted.elements if wanted else self._table.elements,
            self._clock,
            self._stop_by_itself,
            self._collect_now,
            wanted.conditions if wanted else self._conditions.now,
            self._present.run,
            number=self._present.runs + 1,
            served=self._life.serving is not None,
            landing=self.parameters.landing if self.parameters else None,
            cut=cut,
        )

    def _collect_of(self, run: Run) -> Callable[[], None]:
        return timed(run.collect, self._times, self.options.frequency_hz) if self._times else run.collect

    def _cut(self, wanted: WantedStretch) -> None:
        """Go on with another stretch, as it is wanted: the loop's next tick is its first.

        It is prepared without the lock, which takes long where it is large: others look, save and stop meanwhile.
        Raises StateError, SegmentError: the run goes on as it was.
        """
        present, run = self._present, self._present.run
        with self._life.lock:
            self._check_cut(run, wanted)
            assert run is not None
            chain, part = run.segment.schema.stretch
            cut = Cut(chain, part + 1, wanted.what, wanted.who)
        made = present.prepare(functools.partial(self._make_run, wanted, cut))
        collect = self._collect_of(made)
        try:
            with self._life.lock:
                self._check_cut(run, wanted)
                made.take_changes()
                self._collect = collect  # who comes by the one before goes on here, from its next tick on
                if not run.end_by_cut():
                    run.take_changes()
                    self._set_collect(None)
                    raise self._ended_before_cut()  # noqa: TRY301  # what is done for others is done here, too
                self._go_on(made, wanted, collect)
        except BaseException:
            with self._life.lock:
                if self._life.running and self._collect is collect:  # Ctrl-C: who comes is on the way there already
                    run.end_by_cut()
                    self._go_on(made, wanted, collect)
                elif present.run is run:
                    run.take_changes()
            if present.run is not made:
                present.let_go(made)
            raise
        self._data.save_cut_off()

    def _go_on(self, made: Run, wanted: WantedStretch, collect: Callable[[], None]) -> None:
        """Have the stretch that was made ready be the present one; once more, where that was interrupted."""
        wanted.take()
        self._present.go_on(made)
        self._mark_in(made.segment.marks)
        self._set_collect(collect)
        self._hand_over()
        self._life.tell()

    def _check_cut(self, run: Run | None, wanted: WantedStretch) -> None:
        """Raise StateError where a run can't be cut (any more)."""
        if not self._life.running or run is not self._present.run or run is None:
            raise self._ended_before_cut()
        wanted.check()
        infos = [element.info for element in wanted.elements]
        check_cut(self._present, run, infos, exciting=self.parameters.excitations.running is not None)

    def _ended_before_cut(self) -> StateError:
        return StateError(
            f"logger '{self.options.name}' {self._life.reason or 'stopped by itself'}, just when it was to be cut: "
            "nothing was changed"
        )

    def _hand_over(self) -> None:
        if self._life.serving is not None:
            self._life.serving.hand_over()  # before its first tick: whatever happens next, the helper process knows it

    def _is_wanted(self, run: Run) -> bool:
        """Whether a run is to be held that ends now.

        While the helper process is down nobody can tell: its successor looks at it, and lets go of what nobody needs.
        """
        server, schema = self._life.serving, run.segment.schema
        if server is None or is_due(schema):
            return server is not None
        return server.alive and (not server.is_up or self._conditions.now.judged or schema.conditions.judged)

    def _let_go(self, held_alone: bool) -> None:
        if not held_alone:
            self._mark_in(None)  # it holds the last run's memory
        if self._life.serving is not None:
            self._life.serving.let_go(held_alone=held_alone)

    def stop(self) -> None:
        """End logging; the data stays and can be saved. Stopping a stopped logger succeeds."""
        self._stop(StopReason.ASKED)

    def _stop(self, reason: StopReason) -> None:
        with self._life.lock:
            if self._life.running and self._present.run is not None:
                self._life.running = False
                self._set_collect(None)
                self._data.look_for_unheld()
                self._present.run.end(reason)
                self._present.settle_cut()
                self._life.reason = STOP_TEXTS[reason]
                self._life.tell()

    def restart(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Stop and start: the buffers are cleared. After an error the logger is stopped.

        Args:
            unsaved: as for `start`.

        Raises:
            StateError: as `start`.
            SegmentError: as `start`.
            SaveError: as `start`.
        """
        with self._life.cutting, self._life.lock:
            self._life.check_open()
            if unsaved != "save":  # a save waits until the loop stands still
                self._present.settle(unsaved, self.options, self._conditions.now)
            self.stop()
            self.start(unsaved="save" if unsaved == "save" else "clear")

    def _stop_by_itself(self, reason: StopReason) -> None:
        """Called by the tick with which the logger stops: time buffer, memory limit or folder full. Takes no lock.

        Not called by one that was under way while another thread restarted, or cut.
        """
        self._set_collect(None)
        self._life.running = False
        self._life.reason = STOP_TEXTS[reason]
        ending = ending_by_time(kept_how(self._table.infos), self.options.max_time_s)
        if reason is StopReason.TIME_FULL and ending:
            self._life.reason += f", as not all buffers are looping ({and_more(ending, 3)}); max_time=0 has no end"
        if self._present.run is not None:
            self._present.run.end(reason)
        self._life.tell()

    # ----------------------------------------------------------------------------------------------- the state

    @property
    def _is_closed(self) -> bool:
        return self._life.closed

    @property
    def is_running(self) -> bool:
        """Whether `collect()` logs."""
        return self._life.running

    @property
    def ticks(self) -> int:
        """Ticks logged since the last start."""
        return self._present.ticks

    @property
    def stop_reason(self) -> str:
        """Why the logger stopped, empty while it runs or before the first start."""
        return self._life.reason

    def __getitem__(self, name: str) -> LoggedElement:
        return self._data.element(name)

    @property
    def has_unsaved(self) -> bool:
        """Whether ticks were logged that stand in no file."""
        return self._present.has_unsaved

    # ------------------------------------------------------------------------------------------- serving, ending

    def serve(
        self,
        *,
        group: str | None = None,
        config: str | os.PathLike[str] | None = None,
        foxglove: int | None = None,
        group_role: GroupRoleWord = "operator",
        control: ControlWord = "any",
    ) -> "Serving":
        """Start the helper process: from now on `silo` and `silo-tui` find this logger.

        It also saves what earlier processes of this logger left unsaved, see `start()`.

        Args:
            group: lets the members of a system group in too (off by default).
            config: a file with remote access settings of Zenoh (`silo config ls` has examples).
            foxglove: a port of this computer, 8765 usually, on which Foxglove, Lichtblick and PlotJuggler can look, as
                by `silo foxglove`; 0: one that is free, `serving.foxglove_port`. It needs `silo-logger[foxglove]`.
            group_role: what members of the group may do: `"operator"` changes things, `"viewer"` only looks.
            control: `"one"`: nothing is changed but by who has taken control (`silo control take`); `"any"`: by
                every operator, while nobody took it.

        Returns:
            A context manager; or call its `close()`.

        Raises:
            StateError: the logger is served already.
            ArgumentError: `foxglove` is no port, a word is none of those that there are, or a role has no group.
            ConnectionLostError: the helper process didn't start; it says why.
            SiloError: the port of Foxglove is taken, or `websockets` is missing.
        """
        from silo.logger.serving.serving import Serving

        group, config = serving_group(group), serving_config(config)
        role, mode = word("group_role", group_role, GroupRole), word("control", control, ControlMode)
        if group is None and role is not GroupRole.OPERATOR:
            raise ArgumentError(f'group_role="{role.value}" is what members of a group may do: name it, by group="..."')
        port = None if foxglove is None else whole("foxglove (a port)", foxglove, 0, 65535)
        with self._life.lock:
            self._life.check_open()
            if self._life.serving is not None and self._life.serving.alive:
                raise StateError(f"logger '{self.options.name}' is served already")
            if not self._scripted.is_updated:
                self.update()
            self._life.serving = Serving(
                self, group=group, config=config, foxglove=port, group_role=role.value, control=mode.value
            )
            return self._life.serving

    def close(self, *, discard: bool = False) -> None:
        """Stop, end the helper process and free the buffers. What was not saved is gone, which is said; closing twice
        is fine. After a `save()` that failed it is kept as at the end of a `with`.

        Amid another call of the logger in the same thread, as in a signal handler, this returns at once: it ends after
        that call.

        Args:
            discard: what was not saved is to go: nothing is said of it.
        """
        self._end(LoggerEnd.DISCARDED if discard else LoggerEnd.CLOSED)

    def __enter__(self) -> "Logger":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Save what was not saved yet, also after Ctrl-C or an error, say where, and close.

        `log.close()` before the end drops it.
        """
        self._end(LoggerEnd.BLOCK if kind is None else LoggerEnd.ERROR)

    def __del__(self) -> None:
        """A logger that the program forgot: its thread and memory end, unsaved data is kept for `silo recover`."""
        if "_times" in vars(self) and not self._life.freed:  # else it was never made, or is closed to its end
            self._end(LoggerEnd.FORGOTTEN)

    def _end(self, ending: LoggerEnd) -> None:
        self._life.end(functools.partial(self._end_now, ending))

    def _end_now(self, ending: LoggerEnd) -> None:
        """End it once, however that comes; what was interrupted goes on as it began, or drops where it is to."""
        life = self._life
        with life.ends:
            if ending is LoggerEnd.BLOCK:
                self.stop()
                self._data.save_unsaved(ending.value)
            with life.lock:
                first = not life.closed
                if first:
                    self._stop(StopReason.ERROR if ending is LoggerEnd.ERROR else StopReason.ASKED)
                    self._data.look_for_unheld()
                if first or (ending is LoggerEnd.DISCARDED and not life.freed):
                    life.ending = ending
        assert life.ending is not None
        if life.serving is not None:  # whose thread may come to this, too: nobody waits for it who has a lock
            life.serving.end(self._leave)
        with life.ends:
            if not life.freed:
                with (
                    self._data.saving
                ):  # what was logged before a cut, where no helper process did: it is in a file then
                    self._free(life.ending)
                life.freed = True

    def _leave(self) -> bool:
        """Have the helper process save what is in no file, unless that is to go; whether there is any."""
        return self._life.ending is not None and self._life.ending.keeps and self._present.leave()

    def _free(self, ending: LoggerEnd) -> None:
        """Free the buffers, or leave them to those who come after a helper process that did not come to its end."""
        self._mark_in(None)
        keeps = ending.keeps or (ending is LoggerEnd.CLOSED and self._data.save_failed)
        if not keeps or self._data.save_at_end(ending):
            with self._life.cutting, self._life.lock:  # another thread may be copying what was logged before a cut
                dropped, is_held = self._present.unsaved_ticks, self._present.drop()
            if ending is LoggerEnd.CLOSED and dropped:
                say_dropped(self.options.name, dropped)
            if not self._present.is_left:
                drop_journals(self.options)
            if is_held:
                say_what_is_held(self.options)
        self._table.release()

    def __reduce__(self) -> NoReturn:
        name = self.options.name
        raise TypeError(
            f"logger '{name}' can't be copied, pickled or handed to another process: it is this program's, with its "
            "thread and buffers; make one where it is needed, or pass it on as it is"
        )

    def _after_fork_in_child(self) -> None:
        """A forked child must not write into its parent's buffers, nor delete them."""
        self._set_collect(forked_collect(self.options.name) if self._life.running else None)
        self._mark_in(None)
        self._life.forget()
        self._present.forget()

    def __setattr__(self, name: str, value: object) -> None:
        # an array may be kept here, `log.q = log.array("q")`; what isn't logged may not look as if it were
        element = None if name.startswith("_") else self._named(name)
        if (
            element is not None
            and element.parts
            and not isinstance(value, Parameter)
            and not any(reads(part.source, (self, value)) for part in element.parts)
        ):
            no_attribute_of(element.info.name, name)
        super().__setattr__(name, value)

    def _named(self, name: str) -> Element | None:
        """The element whose name ends so."""
        table = vars(self).get("_table")
        return table.named(name) if table is not None else None

    def __repr__(self) -> str:
        return f"<Logger {self._about()}>"

    def _repr_html_(self) -> str:
        return as_html(f"Logger {self._about()}", list(self), self._data.element)

    def _about(self) -> str:
        state = "closed" if self._life.closed else self._life.state.value
        reason = f" ({self._life.reason})" if self._life.reason and not self._life.running else ""
        unsaved = ", not saved" if self.has_unsaved else ""
        held = f", {many(self.ticks, 'tick')}{unsaved}" if self._present.number else ""
        pending = f", {len(self._table.pending)} added since" if self._table.pending else ""
        return f"{self.name}: {len(self)} elements{pending}, {self.options.frequency_hz:g} Hz, {state}{reason}{held}"
