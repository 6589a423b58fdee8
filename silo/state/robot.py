"""Starting, stopping and editing, as the robot program does it for its clients."""

import threading
from dataclasses import dataclass
from typing import Literal, Protocol

from silo.core.elements import Conditions, Edit, ElementInfo, Problem
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server
from silo.segment.retention import large_text
from silo.state import requests
from silo.state.edit_refusals import check_none, check_revision, refused_running
from silo.state.requests import ApplyEdits, EditsApplied, Unsaved

UnsavedWord = Literal["clear", "save", "refuse"]

# what `Logger.start` calls it; for the program itself a start clears without asking
_UNSAVED: dict[Unsaved, UnsavedWord] = {Unsaved.REFUSE: "refuse", Unsaved.SAVE: "save", Unsaved.DISCARD: "clear"}


class StateOfLogger(Protocol):
    """A logger, seen from here."""

    @property
    def lock(self) -> threading.RLock: ...
    @property
    def is_running(self) -> bool: ...
    @property
    def revision(self) -> int: ...
    @property
    def elements(self) -> list[ElementInfo]: ...
    @property
    def saved_before_start(self) -> str: ...

    def problems(self, edits: list[Edit], /) -> list[Problem]: ...
    def apply(self, edits: list[Edit], /) -> int: ...
    def apply_extras(self, extras: Conditions, edits: list[Edit] = ..., /) -> None: ...
    def start(self, *, unsaved: UnsavedWord = "clear") -> None: ...
    def stop(self) -> None: ...
    def restart(self, *, unsaved: UnsavedWord = "clear") -> None: ...


@dataclass(frozen=True)
class StateRobot(Server, does=[requests], robot=True):
    """Has the logger do it, under the lock of its table."""

    logger: StateOfLogger

    def apply_edits(self, request: ApplyEdits) -> EditsApplied:
        logger = self.logger
        with logger.lock:
            if logger.is_running:
                raise refused_running()
            check_revision(request, logger.revision)
            check_none(logger.problems(request.edits))
            if request.extras is not None:
                logger.apply_extras(request.extras, request.edits)  # first, as it may be refused
            changed = logger.apply(request.edits)
            large = large_text(logger.elements) if changed else ""
            return EditsApplied(logger.revision, changed, warnings=[large] if large else [])

    def start(self, unsaved: Unsaved) -> str:
        logger = self.logger
        with logger.lock:
            if logger.is_running:
                text = "the logger runs already: restart it, or stop it first"
                raise RequestRefusedError(RefusedWhy.RUNNING, text)
            logger.start(unsaved=_UNSAVED[unsaved])
            return logger.saved_before_start

    def stop(self) -> str:
        self.logger.stop()
        return ""

    def restart(self, unsaved: Unsaved) -> str:
        with self.logger.lock:
            self.logger.restart(unsaved=_UNSAVED[unsaved])
            return self.logger.saved_before_start
