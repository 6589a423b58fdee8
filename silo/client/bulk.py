"""One thing asked of many loggers: one answer from each, none holds up the others.

So many at a time, each by a client of its own over the session that its configuration has; what is refused, silent or
of another silo is an answer, too.
"""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from silo.client.client import LONGEST_S, Client
from silo.core.elements import FileType, SavedFile, Status
from silo.core.quantities.writing import size_text
from silo.errors import SiloError
from silo.net.found import LoggerAddress
from silo.state.requests import Unsaved

AT_ONCE = 32

__all__ = ["Outcome", "loading", "outcomes", "restarting", "saving", "starting", "stopping", "stopping_and_saving"]


@dataclass(frozen=True)
class Outcome:
    """What became of it at the logger at `place`: `text` fits behind its name."""

    place: int
    done: bool
    text: str
    files: tuple[SavedFile, ...] = ()


Job = Callable[[Client], tuple[str, tuple[SavedFile, ...]]]


def outcomes(
    targets: Sequence[LoggerAddress], job: Job, *, read_only: bool = False, at_once: int = AT_ONCE
) -> Iterator[Outcome]:
    """Yield one outcome for each logger as it comes. Who stops iterating has no further ones asked."""
    waiting: queue.SimpleQueue[tuple[int, LoggerAddress]] = queue.SimpleQueue()
    for item in enumerate(targets):
        waiting.put(item)
    answers: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
    stop = threading.Event()

    def work() -> None:
        while not stop.is_set():
            try:
                place, found = waiting.get_nowait()
            except queue.Empty:
                return
            answers.put(_ask(place, found, job, read_only=read_only))

    threads = [threading.Thread(target=work, name="silo-bulk") for _ in range(min(at_once, len(targets)))]
    for thread in threads:
        thread.start()
    try:
        for _ in targets:
            yield answers.get()
    finally:
        stop.set()


def _ask(place: int, found: LoggerAddress, job: Job, *, read_only: bool) -> Outcome:
    try:
        with Client.connect(found, read_only=read_only) as client:
            text, files = job(client)
        return Outcome(place, True, text, files)
    except SiloError as error:
        return Outcome(place, False, " ".join(str(error).split()))
    except Exception as error:  # noqa: BLE001  # whatever it is, the others get their answers
        return Outcome(place, False, f"{type(error).__name__}: {error}")


# ------------------------------------------------------------------------------------------------- what can be asked


def stopping() -> Job:
    """Return a job that stops."""
    return lambda client: (_state(client.stop()), ())


def stopping_and_saving() -> Job:
    """Return a job that stops, and then saves, so that the last tick is in the file too."""

    def job(client: Client) -> tuple[str, tuple[SavedFile, ...]]:
        client.stop()
        told, files = saving([FileType.SILO])(client)
        return f"stopped, {told}", files

    return job


def starting(unsaved: Unsaved | str = Unsaved.REFUSE) -> Job:
    """Return a job that starts; one that runs goes on."""

    def job(client: Client) -> tuple[str, tuple[SavedFile, ...]]:
        if client.status().state.value == "running":
            return "runs already, left alone", ()
        return _begun(client.start, unsaved)

    return job


def restarting(unsaved: Unsaved | str = Unsaved.REFUSE) -> Job:
    """Return a job that starts anew."""
    return lambda client: _begun(client.restart, unsaved)


def _begun(
    start: Callable[[Unsaved | str, Callable[[str], None]], Status], unsaved: Unsaved | str
) -> tuple[str, tuple[()]]:
    said: list[str] = []
    return "; ".join([_state(start(unsaved, said.append)), *said]), ()


def saving(types: Sequence[FileType], name: str = "", timeout_s: float = LONGEST_S) -> Job:
    """Return a job that saves, and waits for the files."""

    def job(client: Client) -> tuple[str, tuple[SavedFile, ...]]:
        files = client.wait_saved(client.save(types, name), timeout_s)
        told = ", ".join(f"{file.path} {size_text(file.size_bytes)}" for file in files)
        return f"saved {told}", tuple(files)

    return job


def loading(path: str) -> Job:
    """Return a job that loads a script of the robot's own folder."""

    def job(client: Client) -> tuple[str, tuple[SavedFile, ...]]:
        applied = client.load_script(path)
        unknown = f", {len(applied.unknown)} names of it unknown" if applied.unknown else ""
        return f"loaded {path or 'its script'}: {applied.changed} elements changed{unknown}", ()

    return job


def _state(status: Status) -> str:
    unsaved = ", not saved" if status.state.value == "stopped" and status.run_ticks and not status.saved else ""
    return f"{status.state.value}, {status.run_ticks} ticks{unsaved}"
