"""Starting, stopping and editing, as the robot program does it for its clients."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

from silo.core.conditions import Conditions
from silo.core.elements import Edit, ElementInfo, ElementOptions, Problem
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.segment.retention import kept_how, large_text, new_end_text
from silo.state import requests
from silo.state.requests import ApplyEdits, EditsApplied, Unsaved, check_none, check_revision, refused_running

UnsavedWord = Literal["clear", "save", "refuse"]

# what `Logger.start` calls it; for the program itself a start clears without asking
_UNSAVED: dict[Unsaved, UnsavedWord] = {Unsaved.REFUSE: "refuse", Unsaved.SAVE: "save", Unsaved.DISCARD: "clear"}


class TableOfLogger(Protocol):
    """The table of a logger, seen from here."""

    @property
    def cutting(self) -> threading.RLock: ...
    @property
    def lock(self) -> threading.RLock: ...
    @property
    def revision(self) -> int: ...
    @property
    def elements(self) -> list[ElementInfo]: ...
    @property
    def given(self) -> dict[str, ElementOptions]: ...

    def problems(self, edits: list[Edit], /) -> list[Problem]: ...
    def apply(
        self,
        edits: list[Edit],
        conditions: Conditions | None = ...,
        /,
        *,
        cut: bool = ...,
        who: str = ...,
        check: Callable[[], None] = ...,
    ) -> int: ...


class StateOfLogger(Protocol):
    """A logger, seen from here."""

    @property
    def is_running(self) -> bool: ...

    def start(self, *, unsaved: UnsavedWord = "clear") -> None: ...
    def stop(self) -> None: ...
    def restart(self, *, unsaved: UnsavedWord = "clear") -> None: ...
    def _begun_by(self, client: str, /) -> None: ...


@dataclass(frozen=True)
class StateRobot(Server, does=[requests], robot=True):
    """Has the logger do it, under the lock of its table."""

    logger: StateOfLogger
    table: TableOfLogger
    saved_before_start: Callable[[], str]
    max_time_s: float
    less_captured: Callable[[], list[str]]  # of which triggers buffers hold too little
    end_at_start: Callable[[], str]  # that a run ends by itself, in words
    check_room: Callable[[], None]  # raises SaveError where what is in no file yet would fill the disk

    def apply_edits(self, request: ApplyEdits) -> EditsApplied:
        table = self.table

        def check() -> None:
            check_revision(request, table.revision)
            check_none(table.problems(request.edits))
            if self.logger.is_running:
                self.check_room()  # a cut saves what was logged before it

        if self.logger.is_running and not request.cut:
            raise refused_running()
        who, known, before = request.client or "a client", self.less_captured(), kept_how(table.elements)
        changed = table.apply(request.edits, request.conditions, cut=request.cut, who=who, check=check)
        large = large_text(table.elements) if changed else ""
        end = new_end_text(before, kept_how(table.elements), self.max_time_s)
        less = [words for words in self.less_captured() if words not in known]  # the others were told when they began
        return EditsApplied(table.revision, changed, warnings=[*filter(None, [end, large]), *less])

    def start(self, turn: Turn, unsaved: Unsaved) -> str:
        with self.table.cutting, self.table.lock:
            if self.logger.is_running:
                text = "the logger runs already: restart it, or stop it first"
                raise RequestRefusedError(RefusedWhy.RUNNING, text)
            return self._begun(self.logger.start, turn, unsaved)

    def stop(self) -> str:
        self.logger.stop()
        return ""

    def restart(self, turn: Turn, unsaved: Unsaved) -> str:
        with self.table.cutting, self.table.lock:
            return self._begun(self.logger.restart, turn, unsaved)

    def _begun(self, begin: Callable[..., None], turn: Turn, unsaved: Unsaved) -> str:
        if unsaved is Unsaved.SAVE:
            self.check_room()
        begin(unsaved=_UNSAVED[unsaved])
        self.logger._begun_by(turn.by or "a client")
        return "; ".join(filter(None, [self.saved_before_start(), self.end_at_start()]))
