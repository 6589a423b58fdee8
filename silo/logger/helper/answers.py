"""What a logger tells its helper process, and what it does for the clients that come through it.

One function per request that the helper hands on. Called by the thread of `silo.logger.helper.serving`, never by the
loop.
"""

import os
import threading
from collections.abc import Sequence
from typing import Any, Protocol

import msgspec

from silo.conditions import requests as conditions
from silo.core.elements import (
    Conditions,
    Derived,
    Edit,
    ElementInfo,
    LoggerOptions,
    Problem,
    SignalLimits,
    State,
    Table,
    TriggerOptions,
    join_name,
)
from silo.errors import SaveError, ScriptError, StateError
from silo.logger.calls.keywords import UnsavedWord
from silo.loop.run import Run
from silo.rpc.declaring import Reply, Request
from silo.rpc.refusals import WHYS, RefusedWhy, RequestRefusedError, answered
from silo.rpc.serving import Dispatch, Server, Turn
from silo.scripts import requests
from silo.scripts.early_refusals import check_revision, refused_running
from silo.scripts.requests import ApplyEdits, EditsApplied
from silo.segment.retention import large_text
from silo.settings.options import refusal
from silo.state import requests as state
from silo.state.requests import Unsaved
from silo.state.robot_state import RobotState

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
    def extras(self) -> Conditions: ...

    def problems(self, edits: list[Edit], /) -> list[Problem]: ...
    def apply(self, edits: list[Edit], /) -> int: ...
    def apply_extras(self, extras: Conditions, edits: list[Edit] = ..., /) -> None: ...
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


def answer(logger: Served, request: Request[Any]) -> Reply:
    """Do what a client asks; whatever goes wrong becomes words."""
    dispatch = Dispatch([RobotServer(logger)], _not_ours)
    running = RefusedWhy.RUNNING if logger.is_running else RefusedWhy.INVALID
    whys = {**WHYS, StateError: running, SaveError: RefusedWhy.FAILED, ScriptError: RefusedWhy.FAILED}
    reply = answered(lambda: dispatch(request, Turn()), whys)
    assert isinstance(reply, Reply)
    return reply


def _not_ours(request: Request[Any], _: Turn) -> Reply:
    text = f"a robot process doesn't do {type(request).__name__} for its helper"
    raise RequestRefusedError(RefusedWhy.INVALID, text)


class RobotServer(Server[Served], does=[requests, conditions, state], robot=True):
    """Does what the helper process hands on."""

    def apply_edits(self, request: ApplyEdits) -> EditsApplied:
        logger = self.state
        with logger.lock:
            if logger.is_running:
                raise refused_running()
            check_revision(request, logger.revision)
            problems = logger.problems(request.edits)
            if problems:
                raise RequestRefusedError(RefusedWhy.INVALID, refusal(problems), problems)
            if request.extras is not None:
                logger.apply_extras(request.extras, request.edits)  # first, as it may be refused
            changed = logger.apply(request.edits)
            large = large_text(logger.elements) if changed else ""
            return EditsApplied(logger.revision, changed, warnings=[large] if large else [])

    def start(self, unsaved: Unsaved) -> str:
        logger = self.state
        with logger.lock:
            if logger.is_running:
                text = "the logger runs already: restart it, or stop it first"
                raise RequestRefusedError(RefusedWhy.RUNNING, text)
            logger.start(unsaved=_UNSAVED[unsaved])
            return logger.saved_before_start

    def stop(self) -> str:
        self.state.stop()
        return ""

    def restart(self, unsaved: Unsaved) -> str:
        with self.state.lock:
            self.state.restart(unsaved=_UNSAVED[unsaved])
            return self.state.saved_before_start

    def set_trigger(self, trigger: TriggerOptions, lease_s: float) -> str:
        from silo.judging.definitions import fixed_text
        from silo.judging.switched_off import off_problem

        logger = self.state
        known = trigger.name in {one.name for one in logger.extras.triggers}
        logger.set_trigger(trigger)
        running = "" if logger.is_running else "; it is judged when the logger is started"
        off = off_problem(trigger, logger.elements, logger.options.prefix, logger.extras.derived)
        notes = "".join(f"; {note}" for note in (off and f"it {off}", fixed_text(logger.elements)) if note)
        return f"trigger '{trigger.name}' is {'replaced' if known else 'set'}{running}{notes}"

    def remove_trigger(self, name: str) -> str:
        self.state.remove_trigger(name)
        return f"trigger '{name}' is removed"

    def set_limits(self, limits: SignalLimits) -> str:
        self.state.set_limits(limits)
        return f"limits of '{limits.name}' are set"

    def remove_limits(self, name: str) -> str:
        self.state.remove_limits(name)
        return f"limits of '{name}' are removed"

    def set_derived(self, derived: Derived) -> str:
        logger = self.state
        before = {known.name for known in logger.extras.derived}
        logger.derive(derived.name, derived.expression, unit=derived.unit)
        whole = join_name("", "", derived.name), join_name(logger.options.prefix, "", derived.name)
        (made,) = [known.name for known in logger.extras.derived if known.name in whole]
        return f"'{made}' is {'derived anew' if made in before else 'derived'}: {derived.expression}"

    def remove_derived(self, name: str) -> str:
        self.state.remove_derived(name)
        return f"'{name}' is derived no more"
