# ruff: noqa: D102 - the parts of Served are described in silo.logger.logger
"""What a logger tells its helper process, and what it does for the clients that come through it.

One function per request that the helper hands on. Called by the thread of `silo.logger.serving`, never by the loop.
"""

import logging
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import msgspec

from silo.collecting.run import Run
from silo.errors import ElementError, SiloError, StateError, UnsavedError
from silo.ipc.messages import (
    AnyReply,
    ApplyEdits,
    Done,
    EditsApplied,
    Refused,
    RefusedWhy,
    RemoveDerived,
    RemoveLimits,
    RemoveTrigger,
    Request,
    Restart,
    SetDerived,
    SetLimits,
    SetTrigger,
    Start,
    Stop,
    Unsaved,
)
from silo.ipc.refusals import refused_conflict, refused_running
from silo.link.messages import RobotState
from silo.logger.keywords import UnsavedWord
from silo.model import (
    Edit,
    ElementInfo,
    Extras,
    LoggerOptions,
    Problem,
    SignalLimits,
    State,
    Table,
    TriggerOptions,
    join_name,
)
from silo.settings.rules import refusal

log = logging.getLogger("silo")

# what `Logger.start` calls it; for the program itself a start clears without asking
_UNSAVED: dict[Unsaved, UnsavedWord] = {Unsaved.REFUSE: "refuse", Unsaved.SAVE: "save", Unsaved.DISCARD: "clear"}


class Served(Protocol):
    """A logger, seen from here: what its clients may know of it and ask of it."""

    options: LoggerOptions

    @property
    def lock(self) -> threading.RLock: ...
    @property
    def is_running(self) -> bool: ...
    @property
    def state(self) -> State: ...
    @property
    def stop_reason(self) -> str: ...
    @property
    def ticks(self) -> int: ...
    @property
    def has_unsaved(self) -> bool: ...
    @property
    def segment_path(self) -> str: ...
    @property
    def present_run(self) -> Run | None: ...
    @property
    def revision(self) -> int: ...
    @property
    def elements(self) -> list[ElementInfo]: ...
    @property
    def extras(self) -> Extras: ...

    def problems(self, edits: list[Edit], /) -> list[Problem]: ...
    def apply(self, edits: list[Edit], /) -> int: ...
    def apply_extras(self, extras: Extras, edits: list[Edit] = ..., /) -> None: ...
    def set_trigger(self, one: TriggerOptions, /) -> None: ...
    def remove_trigger(self, name: str, /) -> None: ...
    def set_limits(self, one: SignalLimits, /) -> None: ...
    def remove_limits(self, name: str, /) -> None: ...
    def derive(self, name: str, expression: str, *, unit: str = "") -> None: ...
    def remove_derived(self, name: str, /) -> None: ...
    def start(self, *, unsaved: UnsavedWord = "clear") -> None: ...
    def stop(self) -> None: ...
    def restart(self, *, unsaved: UnsavedWord = "clear") -> None: ...
    @property
    def saved_before_start(self) -> str: ...
    def look_for_unheld(self, run: Run | None = None, found: Sequence[int] | None = None) -> None: ...
    def note_saved(self, run_id: str, ticks: int, /) -> None: ...


def robot_state(logger: Served, by: str, table_sent: int) -> RobotState:
    """Return what the helper is to know now; with the table, unless that revision was sent before."""
    with logger.lock:
        revision = logger.revision
        return RobotState(
            logger=logger.options.name,
            pid=os.getpid(),
            state=logger.state,
            revision=revision,
            options_json=msgspec.json.encode(logger.options),
            folder=logger.options.folder,
            script=logger.options.script,
            segment=logger.segment_path,
            reason=logger.stop_reason,
            by=by,
            table=Table(revision, logger.elements) if revision != table_sent else None,
            extras=logger.extras,
            saved=logger.saved_before_start,
        )


def answer(logger: Served, request: Request[Any]) -> AnyReply:
    """Do what a client asks; whatever goes wrong becomes words."""
    if type(request) not in HANDLERS:
        return Refused(RefusedWhy.INVALID, f"a robot process doesn't do {type(request).__name__} for its helper")
    try:
        return HANDLERS[type(request)](logger, request)
    except UnsavedError as error:
        return Refused(RefusedWhy.UNSAVED, str(error))
    except StateError as error:
        why = RefusedWhy.RUNNING if logger.is_running else RefusedWhy.INVALID
        return Refused(why, str(error))
    except ElementError as error:
        return Refused(RefusedWhy.INVALID, str(error))
    except SiloError as error:
        return Refused(RefusedWhy.FAILED, str(error))
    except Exception as error:
        log.exception("%s failed", type(request).__name__)
        return Refused(RefusedWhy.FAILED, f"{type(error).__name__}: {error}")


def _edit(logger: Served, request: ApplyEdits) -> EditsApplied | Refused:
    with logger.lock:
        if logger.is_running:
            return refused_running()
        conflict = refused_conflict(request, logger.revision)
        if conflict is not None:
            return conflict
        problems = logger.problems(request.edits)
        if problems:
            return Refused(RefusedWhy.INVALID, refusal(problems), problems)
        if request.extras is not None:
            logger.apply_extras(request.extras, request.edits)  # first, as it may be refused
        changed = logger.apply(request.edits)
        return EditsApplied(logger.revision, changed)


def _start(logger: Served, request: Start) -> Done | Refused:
    with logger.lock:
        if logger.is_running:
            return Refused(RefusedWhy.RUNNING, "the logger runs already: restart it, or stop it first")
        logger.start(unsaved=_UNSAVED[request.unsaved])
        return Done(logger.saved_before_start)


def _stop(logger: Served, _: Stop) -> Done:
    logger.stop()
    return Done()


def _restart(logger: Served, request: Restart) -> Done:
    with logger.lock:
        logger.restart(unsaved=_UNSAVED[request.unsaved])
        return Done(logger.saved_before_start)


def _set_trigger(logger: Served, request: SetTrigger) -> Done:
    from silo.judging.extras import fixed_text
    from silo.judging.off import off_problem

    name = request.trigger.name
    known = name in {one.name for one in logger.extras.triggers}
    logger.set_trigger(request.trigger)
    running = "" if logger.is_running else "; it is judged when the logger is started"
    off = off_problem(request.trigger, logger.elements, logger.options.prefix, logger.extras.derived)
    notes = "".join(f"; {note}" for note in (off and f"it {off}", fixed_text(logger.elements)) if note)
    return Done(f"trigger '{name}' is {'replaced' if known else 'set'}{running}{notes}")


def _remove_trigger(logger: Served, request: RemoveTrigger) -> Done:
    logger.remove_trigger(request.name)
    return Done(f"trigger '{request.name}' is removed")


def _set_limits(logger: Served, request: SetLimits) -> Done:
    logger.set_limits(request.limits)
    return Done(f"limits of '{request.limits.name}' are set")


def _remove_limits(logger: Served, request: RemoveLimits) -> Done:
    logger.remove_limits(request.name)
    return Done(f"limits of '{request.name}' are removed")


def _set_derived(logger: Served, request: SetDerived) -> Done:
    one = request.derived
    before = {known.name for known in logger.extras.derived}
    logger.derive(one.name, one.expression, unit=one.unit)
    (made,) = [known.name for known in logger.extras.derived if known.name in _whole(one.name, logger)]
    return Done(f"'{made}' is {'derived anew' if made in before else 'derived'}: {one.expression}")


def _whole(name: str, logger: Served) -> tuple[str, str]:
    return join_name("", "", name), join_name(logger.options.prefix, "", name)


def _remove_derived(logger: Served, request: RemoveDerived) -> Done:
    logger.remove_derived(request.name)
    return Done(f"'{request.name}' is derived no more")


HANDLERS: dict[type[Request[Any]], Callable[[Served, Any], AnyReply]] = {
    ApplyEdits: _edit,
    Start: _start,
    Stop: _stop,
    Restart: _restart,
    SetTrigger: _set_trigger,
    RemoveTrigger: _remove_trigger,
    SetLimits: _set_limits,
    RemoveLimits: _remove_limits,
    SetDerived: _set_derived,
    RemoveDerived: _remove_derived,
}
