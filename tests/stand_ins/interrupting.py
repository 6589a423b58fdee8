"""Ctrl-C at any instruction: what runs is traced, and interrupted before the one that was chosen."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from types import CodeType, FrameType
from typing import Any

Place = tuple[CodeType, int]  # an instruction: whose, and where in it


class Interrupts:
    """Watches the code of some files, which `watched` knows by their names."""

    def __init__(self, watched: Callable[[CodeType], bool]) -> None:
        self._watched = watched
        self._seen: dict[Place, None] = {}
        self._at: Place | None = None
        self._number = -1

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
        before = sys.gettrace()
        sys.settrace(self._call)
        try:
            yield
        finally:
            sys.settrace(before)

    def _call(self, frame: FrameType, event: str, _: object) -> Any:
        # each instruction that is stepped through costs a call: of the others' code none is looked at
        if not self._watched(frame.f_code) if self._at is None else frame.f_code != self._at[0]:
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return self._step

    def _step(self, frame: FrameType, event: str, _: object) -> Any:
        if event == "opcode":
            place = frame.f_code, frame.f_lasti
            if self._at is None:
                self._seen.setdefault(place)
                if len(self._seen) == self._number + 1:
                    sys.settrace(None)
                    raise KeyboardInterrupt
            elif place == self._at:
                sys.settrace(None)
                raise KeyboardInterrupt
        return self._step
