"""Ctrl-C, or another signal, at any instruction: what runs is traced, and interrupted before one that was chosen."""

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import CodeType, FrameType
from typing import Any

Place = tuple[CodeType, int]  # an instruction: whose, and where in it


class Interrupts:
    """Watches the code of some files, which `watched` knows by their names."""

    def __init__(
        self,
        watched: Callable[[CodeType], bool],
        handler: Callable[[int, FrameType | None], object] = signal.default_int_handler,
    ) -> None:
        self._watched, self._handler = watched, handler
        self._seen: dict[Place, None] = {}
        self._at: Place | None = None
        self._number = -1
        self._ended = False

    def places(self, action: Callable[[], object]) -> list[Place]:
        """Every instruction that an action comes to, in their order."""
        self._seen, self._at = {}, None
        with self._traced():
            action()
        return list(self._seen)

    def interrupt(self, place: Place, action: Callable[[], object]) -> bool:
        """Do it, with a KeyboardInterrupt where it comes to this instruction first; False if it never did."""
        self._at = place
        try:
            with self._traced():
                action()
        except KeyboardInterrupt:
            return True
        return False

    def interrupt_at(self, number: int, action: Callable[[], object]) -> bool:
        """The same at the so-and-so-manieth new instruction: of code that is another one each time."""
        self._number = number
        try:
            self.places(action)
        except KeyboardInterrupt:
            return True
        finally:
            self._number = -1
        return False

    @contextlib.contextmanager
    def _traced(self) -> Iterator[None]:
        self._ended = False
        with _stepped_through(self._concerns, self._come_to):
            yield

    def _concerns(self, code: CodeType) -> bool:
        # each instruction that is stepped through costs a call: of the others' code none is looked at
        return not self._ended and (self._watched(code) if self._at is None else code == self._at[0])

    def _come_to(self, place: Place) -> None:
        if self._ended:
            return
        if self._at is None:
            self._seen.setdefault(place)
        if place == self._at or len(self._seen) == self._number + 1:
            self._ended = True
            self._handler(signal.SIGINT, None)


@contextlib.contextmanager
def _by_trace(concerns: Callable[[CodeType], bool], come_to: Callable[[Place], None]) -> Iterator[None]:
    def called(frame: FrameType, event: str, _: object) -> Any:
        if not concerns(frame.f_code):
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return step

    def step(frame: FrameType, event: str, _: object) -> Any:
        if event == "opcode":
            come_to((frame.f_code, frame.f_lasti))
        return step

    before = sys.gettrace()
    sys.settrace(called)
    try:
        yield
    finally:
        sys.settrace(before)


@contextlib.contextmanager
def _by_events(concerns: Callable[[CodeType], bool], come_to: Callable[[Place], None]) -> Iterator[None]:
    """The same from Python 3.12 on; trace functions of 3.13 miss instructions of code stepped through before."""
    python: Any = sys.monitoring  # type: ignore[attr-defined,unused-ignore]
    events, tool, stepped, here = python.events, python.DEBUGGER_ID, [], threading.get_ident()

    def begun(code: CodeType, _: int) -> None:
        if concerns(code) and code not in stepped:
            stepped.append(code)
            python.set_local_events(tool, code, events.INSTRUCTION)

    def step(code: CodeType, offset: int) -> None:
        if threading.get_ident() == here:  # Ctrl-C comes to no other thread
            come_to((code, offset))

    python.use_tool_id(tool, __name__)
    python.register_callback(tool, events.PY_START, begun)
    python.register_callback(tool, events.INSTRUCTION, step)
    python.set_events(tool, events.PY_START)
    try:
        yield
    finally:
        python.set_events(tool, 0)
        for code in stepped:
            python.set_local_events(tool, code, 0)
        python.free_tool_id(tool)


_stepped_through = _by_trace if sys.version_info < (3, 12) else _by_events
