"""What nobody foresaw: an error that is no silo error is told and written to a log file, and the program goes on.

Textual ends the program, and shows pages of it, wherever code of a program raises: in a worker, a timer, a handler, a
completer. A typo must never cost the screen that one watches a robot on.
"""

import os
import time
import traceback
from pathlib import Path

import msgspec
from textual.message import Message
from textual.message_pump import MessagePump
from textual.worker import WorkerFailed

from silo.core.quantities.writing import wall_clock
from silo.core.runtime import state_folder
from silo.version import VERSION

MOST_BYTES = 1_000_000  # of the log file; what is older stands in one beside it
AGAIN_S = 10.0  # what comes from one place is told and written so often: a timer fails five times a second


class Guarded(MessagePump):
    """What takes messages: an error in one of them ends neither it nor the program.

    Textual breaks the loop of whatever a handler raised in: no later key would come through.
    """

    async def _dispatch_message(self, message: Message) -> None:
        try:
            await super()._dispatch_message(message)
        except Exception as error:  # noqa: BLE001  # whatever it is, it is told
            self.app._handle_exception(error)


class _Place(msgspec.Struct):
    """Where errors came from, when one was told last, and how many came since."""

    told_s: float
    since: int = 0


class Unforeseen:
    """Tells and writes down errors that nobody foresaw."""

    def __init__(self) -> None:
        self.errors: list[BaseException] = []  # the newest few
        self._places: dict[tuple[str, ...], _Place] = {}

    def words(self, error: BaseException) -> str:
        """Write an error down and return what is to be said of it; empty where its place was told of just now."""
        error = error.error if isinstance(error, WorkerFailed) else error
        self.errors = [*self.errors[-9:], error]
        frames = traceback.extract_tb(error.__traceback__)
        place = (type(error).__name__, *(f"{frame.filename}:{frame.lineno}" for frame in frames[-1:]))
        now_s, known = time.monotonic(), self._places.get(place)
        if known is not None and now_s - known.told_s < AGAIN_S:
            known.since += 1
            return ""
        again = f" ({known.since} more since)" if known is not None and known.since else ""
        self._places[place] = _Place(now_s)
        kind = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        return (
            f"a mistake in silo-tui itself, {' '.join(kind.split())[:200]}{again}: what was asked for may not be done. "
            f"All else goes on; Esc leaves what is open. {_written(error)}"
        )


def log_file() -> Path:
    """Return where such errors are written."""
    return state_folder() / "silo-tui.log"


def _written(error: BaseException) -> str:
    """Write an error with where it came from, and return where it stands, or why it doesn't."""
    path = log_file()
    told = "".join(traceback.format_exception(error))
    stamp = wall_clock(time.time_ns(), date=True)
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if path.exists() and path.stat().st_size > MOST_BYTES:
            path.replace(path.with_suffix(".log.old"))
        opened = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW, 0o600)
        with os.fdopen(opened, "a", encoding="utf-8", errors="backslashreplace") as file:
            file.write(f"{stamp} silo {VERSION}, process {os.getpid()}\n{told}\n")
    except OSError as problem:
        return f"It can't be written down: {problem}"
    return f"It stands in {path}"
