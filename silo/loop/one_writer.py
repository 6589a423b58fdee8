"""One writer per run: the lines of a generated `collect()` that keep a second thread, or tick, out of a row."""

import sys
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field

from silo.errors import StateError

_ENDED = ["if retired:", "    forget(globals())", "    return after_end()"]


@dataclass(frozen=True)
class Guard:
    """`enter` opens a tick, `begin` and `end` are its first and last step, `leave` ends it however it went.

    `state` opens `make`, `changed` are its names that ticks change.
    """

    enter: list[str]
    leave: list[str]
    begin: list[str] = field(default_factory=list)
    end: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)
    state: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    objects: dict[str, object] = field(default_factory=dict)


def guard_lines(*, serialized: bool) -> Guard:
    """How a tick makes sure that it is the only one, in the thread that has the run, and that the run goes on.

    To ask for the thread costs 30 ns a tick. Under the GIL a plain flag keeps ticks apart, 60 ns cheaper than a lock:
    between its test and its store the interpreter never switches threads (it does so at calls and at taken jumps).

    Linux gives the id of a thread that ended to the next one. So the end of the owner takes its id out of `owner`: that
    costs a tick nothing.
    """
    state, changed = ["busy = False", "retired = False"], ["busy"]
    objects: dict[str, object] = {"overlap": _overlap}
    other, claim = "", []
    if not serialized:
        state += ["owner = None", "def disown():", "    nonlocal owner", "    owner = None"]
        changed.append("owner")
        objects |= {"ident": threading.get_ident, "claim": _Owner().claim}
        other, claim = "ident() != owner", ["owner = claim(disown)"]
    if getattr(sys, "_is_gil_enabled", lambda: True)():
        condition = f"if busy or {other}:" if other else "if busy:"
        check = [*_ENDED, "if busy: overlap()", *claim]
        enter = [condition, *(f"    {line}" for line in check)]
        idle = ["busy = retired"]
        return Guard(enter, idle, begin=["busy = True"], end=idle, state=state, changed=changed, objects=objects)
    lock = threading.Lock()
    objects |= {"acquire": lock.acquire, "release": lock.release}
    check = [f"if {other}: {claim[0]}"] if claim else []
    enter = [*_ENDED, *check, "if not acquire(False): overlap()"]
    # a lock is released once, and a step is done whole or not at all only if it calls nothing
    return Guard(enter, [], after=["finally:", "    release()"], state=state, changed=changed, objects=objects)


def _overlap() -> None:
    raise StateError(
        "collect() was called by a second thread (or from within itself) while it ran; a logger has one writer: "
        "call collect() from the control loop only, and give other threads a logger of their own"
    )


class _Owner:
    """The thread that a run belongs to: that of its first tick."""

    def __init__(self) -> None:
        self._owners: dict[str, tuple[int, str]] = {}
        self._disown: weakref.ref[Callable[[], None]] | None = None  # what `collect` keeps, and its buffers with it
        self._ended = False

    def claim(self, disown: Callable[[], None]) -> int:
        """Take the run for the calling thread, if nobody has it; raise StateError otherwise.

        `disown` is called when that thread ends.
        """
        thread = threading.current_thread()
        mine = threading.get_ident(), thread.name
        owner = self._owners.setdefault("owner", mine)  # one step: of two first ticks one wins
        if owner[0] != mine[0] or self._ended:
            raise StateError(
                f"collect() belongs to the thread that called it first after start(), '{owner[1]}'"
                f"{', which has ended' if self._ended else ''}, and was called by "
                f"'{mine[1]}': give each thread a logger of its own, or make this one with threads='serialized' "
                "if the calls never overlap (executors that change threads)"
            )
        # what Python knows of a thread that C code began ends with each call from there, not with the thread
        if self._disown is None and not isinstance(thread, threading._DummyThread):
            if not hasattr(_present, "end"):
                _present.end = _ThreadEnd()
            _present.end.owners.add(self)
            self._disown = weakref.ref(disown)  # last: a claim that was interrupted is made once more
        return owner[0]

    def thread_ended(self) -> None:
        """Let no thread go on with the run: the next one may have the id of the one that ended."""
        self._ended = True
        if self._disown is not None and (disown := self._disown()) is not None:
            disown()


class _ThreadEnd:
    """Stands in the memory of a thread, and goes with it: before its id is free."""

    def __init__(self) -> None:
        self.owners: weakref.WeakSet[_Owner] = weakref.WeakSet()

    def __del__(self) -> None:
        for owner in self.owners:
            owner.thread_ended()


_present = threading.local()
