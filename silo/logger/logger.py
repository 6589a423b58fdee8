"""The logger: registers variables, runs, saves. What a control program imports.

`collect()` runs the closure that `start()` generated and nothing else. Everything that changes the table or the state
takes one lock, which `collect()` never touches.
"""

import functools
import logging
import os
import threading
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from silo.core.arguments import whole, word
from silo.core.calls import told_class
from silo.core.elements import DEFAULT_MAX_TIME_S, BufferType, ControlMode, GroupRole, Storage, Threads
from silo.errors import SiloError, StateError
from silo.logger.calls.keywords import AnyStorage, AnyThreads, ControlWord, GroupRoleWord
from silo.logger.calls.options import (
    logger_options,
    serving_config,
    serving_group,
    warn_if_not_durable,
)
from silo.logger.current_run import CurrentRun
from silo.logger.helper.consumers import is_wanted
from silo.logger.logged import Logged
from silo.logger.new_values import NewValuesReader
from silo.logger.unclosed import (
    drop_journals,
    end_namesakes,
    forked_collect,
    save_at_end,
    say_dropped,
    say_saved,
    say_what_is_held,
    say_where_it_is,
    watch,
)
from silo.loop.clocks import nanosecond_clock
from silo.loop.run import Run
from silo.recovery.runs import look_back
from silo.segment.marks import NO_WORDS, Mark, no_mark
from silo.segment.reasons import STOP_TEXTS, StopReason
from silo.state.robot import UnsavedWord

if TYPE_CHECKING:
    from silo.logger.helper.serving import Serving

log = logging.getLogger("silo")


@told_class("log", make="silo.Logger", leave=("collect", "mark"))
class Logger(Logged):
    """Logs variables of a control program, by reference, once per control tick.

    Args:
        name: of the logger, and the start of its file names: letters, digits, `_`, `.` and `-`.
        frequency: control ticks per second (Hz).
        max_time: how long fixed and growing logs may become (s), 0 for no limit; a run that has other buffers as well
            ends then too, which its start says.
        script: YAML file with the configuration; read by `update()` if it exists.
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

    Raises:
        ElementError: an argument is out of range.
    """

    def __init__(
        self,
        name: str = "silo",
        *,
        frequency: float = 100.0,
        max_time: float = DEFAULT_MAX_TIME_S,
        script: str | os.PathLike[str] = "logger.yaml",
        prefix: str = "/log",
        clock: Callable[[], int | float] | None = None,
        folder: str | os.PathLike[str] = ".",
        storage: AnyStorage = Storage.MEMORY,
        size_tiers: int = 3,
        memory_limit_mb: int = 1024,
        checked: bool = False,
        threads: AnyThreads = Threads.SINGLE,
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
        )
        self._clock = nanosecond_clock(clock)
        end_namesakes(options.name)
        super().__init__(options)
        self._collect: Callable[[], None] | None = None
        self._ignored = 0
        self._mark: Mark = no_mark
        self._freeing = False  # it was closed, and what it has is let go of
        watch(self)  # its data outlives a process that ends without close()

    # ------------------------------------------------------------------------------------------------ the loop

    def collect(self) -> None:
        """Log one tick. While the logger stands still nothing is logged: told once, and counted as `ignored`.

        Raises StateError in every thread but the first that called it since the last start (see `threads`).
        """
        # while the logger runs, the generated closure stands in the instance in place of this method: 40 ns less a tick
        self._collect_now()

    def _collect_now(self) -> None:
        if self._collect is not None:
            self._collect()
            return
        self._ignored += 1
        if self._ignored == 1:
            log.warning("%s: %s", self.options.name, self._why_ignored())

    def _why_ignored(self) -> str:
        if self._closed:
            return "collect() logs nothing any more, the logger is closed: make a new one"
        if not self._present.number:
            return "collect() logs nothing before the first start: call start()"
        if not self._reason:
            return "collect() logs nothing while start() prepares a new run"
        return f"collect() logs nothing while it stands still ({self._reason}): start() begins a new run"

    @property
    def ignored(self) -> int:
        """How often `collect()` was called since the last start while the logger didn't run, and logged nothing."""
        return self._ignored

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
        memory when this returns, and survives what a collected tick survives. Text beyond 224 bytes of UTF-8 is cut.
        The newest 1024 marks of a run are in its files; with `serve()`, which takes them over five times a second, all.

        Args:
            text: the words.
            *more: what follows them, a space between: `log.mark("push", 3)`.
        """
        self._mark(text, *more)

    def _set_mark(self, mark: Mark) -> None:
        self._mark = vars(self)["mark"] = mark  # in the instance in place of the method, as `collect`: 40 ns less
        if mark is no_mark:
            del vars(self)["mark"]

    def start(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Clear all buffers and begin to log; calls `update()` first if that was never done.

        The first start looks for what earlier processes of this logger (same name, same folder) left unsaved. The
        helper process of a served logger saves that, beside its work, and says where, on the console and as an event;
        without one, a warning names the `silo recover` command that does.

        Args:
            unsaved: what becomes of data of the last run that is in no file: `"clear"` drops it, `"save"` saves it
                first, `"refuse"` raises a StateError that tells how much it is. Where two runs don't fit into the
                memory it is saved in any case.

        Raises:
            StateError: the logger runs already, or holds unsaved data that is not to be cleared.
            SegmentError: there is no room for the buffers.
            SaveError: what had to be saved could not be: the last run is then kept as it was.
        """
        with self._lock:
            self._check_open()
            self._check_stopped("start")
            if not self._updated:
                self.update()
            self.look_for_unheld()  # a run that stopped by itself may be saved now
            self._present.settle(unsaved, self.options, self.extras)
            self._adopt_late()
            self._warn_of_triggers(served=self._serving is not None)
            warn_if_not_durable(self.options, served=self._serving is not None)
            if self._present.number == 0:
                look_back(self.options, served=self._serving is not None and self._serving.is_up)
            self._present.number += 1
            stopped = functools.partial(self._stop_by_itself, self._present.number)
            make = functools.partial(
                Run,
                self.options,
                self._table.elements,
                self._clock,
                stopped,
                self._collect_now,
                self.extras,
                self._present.run,
                number=self._present.runs + 1,
                served=self._serving is not None,
            )
            run = self._present.replace(make, self.options, self.extras, self._let_go, self._hand_over, self._is_wanted)
            self._new_values = NewValuesReader()
            self._reason = ""
            self._ignored, self._said_late = 0, False
            self._running = True
            self._warn_of_end()
            self._set_mark(run.mark)
            self._set_collect(run.collect)
            self._tell()

    def _warn_of_end(self) -> None:
        """Say when a run ends by itself that would go on, were all its buffers looping and `max_time` not there."""
        infos = [info for info in self._table.infos if info.options.enabled]
        kinds = {info.options.buffer_type for info in infos}
        limit_s = self.options.max_time_s
        if limit_s != DEFAULT_MAX_TIME_S or BufferType.LOOPING not in kinds or len(kinds) == 1:
            return
        ending = [info.name for info in infos if info.options.buffer_type is not BufferType.LOOPING]
        log.warning(
            "%s: logging stops by itself after %g s (max_time), as not all buffers are looping (%s): for a run without "
            "end give max_time=0, or make them looping",
            self.options.name,
            limit_s,
            ", ".join(ending[:3]) + (", ..." if len(ending) > 3 else ""),
        )

    def _hand_over(self) -> None:
        if self._serving is not None:
            self._serving.hand_over()  # before its first tick: whatever happens next, the helper process knows it

    def _is_wanted(self, run: Run) -> bool:
        return is_wanted(run, self._serving, self.extras)

    def _let_go(self, held_alone: bool) -> None:
        if not held_alone:
            self._set_mark(no_mark)  # it holds the last run's memory
        if self._serving is not None:
            self._serving.let_go(held_alone=held_alone)

    @property
    def saved_before_start(self) -> str:
        """Where a start saved the run before it, in words; empty where it hadn't to."""
        return self._present.saved_before

    def stop(self) -> None:
        """End logging; the data stays and can be saved. Stopping a stopped logger succeeds."""
        with self._lock:
            if self._running and self._present.run is not None:
                self._running = False
                self._set_collect(None)
                self.look_for_unheld()
                self._present.run.end(StopReason.ASKED)
                self._reason = STOP_TEXTS[StopReason.ASKED]
                self._tell()

    def restart(self, *, unsaved: UnsavedWord = "clear") -> None:
        """Stop and start: the buffers are cleared. After an error the logger is stopped.

        Args:
            unsaved: as for `start`.

        Raises:
            StateError: as `start`.
            SegmentError: as `start`.
            SaveError: as `start`.
        """
        with self._lock:
            self._check_open()
            if unsaved != "save":  # a save waits until the loop stands still
                self._present.settle(unsaved, self.options, self.extras)
            self.stop()
            self.start(unsaved="save" if unsaved == "save" else "clear")

    def _stop_by_itself(self, run_number: int, reason: StopReason) -> None:
        """Called by the tick with which the logger stops: time buffer, memory limit or folder full. Takes no lock."""
        if run_number != self._present.number:
            return  # a tick that was under way while another thread restarted
        self._set_collect(None)
        self._running = False
        self._reason = STOP_TEXTS[reason]
        if self._present.run is not None:
            self._present.run.end(reason)
        self._tell()

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
            ArgumentError: `foxglove` is no port, or a word is none of those that there are.
            ConnectionLostError: the helper process didn't start; it says why.
            SiloError: the port of Foxglove is taken, or `websockets` is missing.
        """
        from silo.logger.helper.serving import Serving

        group, config = serving_group(group), serving_config(config)
        role, mode = word("group_role", group_role, GroupRole), word("control", control, ControlMode)
        port = None if foxglove is None else whole("foxglove (a port)", foxglove, 0, 65535)
        with self._lock:
            self._check_open()
            if self._serving is not None and self._serving.alive:
                raise StateError(f"logger '{self.options.name}' is served already")
            if not self._updated:
                self.update()
            self._serving = Serving(
                self, group=group, config=config, foxglove=port, group_role=role.value, control=mode.value
            )
            return self._serving

    def close(self, *, discard: bool = False) -> None:
        """Stop, end the helper process and free the buffers. What was not saved is gone, which is said; closing twice
        is fine.

        Args:
            discard: what was not saved is to go: nothing is said of it.
        """
        with self._lock:
            if self._closed:
                if self._freeing:
                    self._free()  # it was interrupted
                return
            self.stop()
            self.look_for_unheld()
            self._freeing = self._closed = True  # in this order: an interrupt may come between
            dropped = 0 if discard else self._present.unsaved_ticks
        if dropped:
            say_dropped(self.options.name, dropped)
        self._free()

    def _free(self) -> None:
        if self._serving is not None:
            self._serving.close()
        self._set_mark(no_mark)
        self._drop()
        drop_journals(self.options)
        self._table.release()

    def _drop(self) -> None:
        """Free the buffers, or leave them to those who come after a helper process that did not come to its end."""
        if self._present.drop(self._is_wanted):
            say_what_is_held(self.options)

    cleanup = close

    def __enter__(self) -> "Logger":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Save what was not saved yet, also after Ctrl-C or an error, say where, and close.

        `log.close()` before the end drops it.
        """
        if kind is not None or self._closed or not self.has_unsaved or not self._saved_at_end():
            self.abandon()

    def _saved_at_end(self) -> bool:
        """Save what is in no file at a clean end, and close; False where that failed: nothing was changed then."""
        self.stop()
        try:
            saved = self.save()
        except SiloError as error:
            log.warning("%s: saving at the end failed: %s", self.options.name, error)
            return False
        say_saved(self.present_run, self.options.name, saved)
        self.close()
        return True

    def abandon(self) -> None:
        """End without `close()`, as at the end of a process: unsaved data is saved as `.silo`, and it is said where.

        A served logger leaves that to its helper process. Where saving fails, `silo recover` can do it later.
        """
        run = self._present.run
        if self._closed or not self.has_unsaved or run is None:
            self.close()
            return
        self.stop()
        self.look_for_unheld()
        self._closed = True
        if self._serving is not None:
            if self._serving.is_up:
                self._serving.abandon(self.segment_path, self.ticks)
            else:
                self._serving.close()
            if self._serving.left == (self.segment_path, self.ticks):
                return  # the helper process saves them and deletes the segment
        self._set_mark(no_mark)
        if save_at_end(run, self.options, self.extras):
            self._drop()
            drop_journals(self.options)

    def __del__(self) -> None:
        """A logger that the program forgot: its thread and memory end, unsaved data is kept for `silo recover`."""
        if getattr(self, "_closed", True):
            return
        run = self._present.run
        if run is not None and self.has_unsaved and (self._serving is None or not self._serving.is_up):
            self.stop()
            self._closed = True
            say_where_it_is(run, self.options)  # the collector may run in any thread: no place to write files
        else:
            self.abandon()

    def _tell(self) -> None:
        """Let the helper process know of a new state or table. Never waits."""
        if self._serving is not None:
            self._serving.state_changed()

    def after_fork_in_child(self) -> None:
        """A forked child must not write into its parent's buffers, nor delete them."""
        self._lock = threading.RLock()  # the parent may hold it
        if self._present.run is not None:
            self._present.run.forget()
        self._set_collect(forked_collect(self.options.name) if self._running else None)
        self._set_mark(no_mark)
        self._running = False
        self._closed = True
        self._serving = None
        self._present = CurrentRun()
