"""One thing asked of many loggers: one answer from each, none holds up the others.

So many at a time, each by a client of its own over the session that its configuration has; what is refused, silent or
of another silo is an answer, too.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass

from silo.client.client import LONGEST_S, Client
from silo.core.elements import FileType, SavedFile, Status
from silo.core.quantities.writing import many, size_text
from silo.errors import SiloError
from silo.net.found import LoggerAddress
from silo.state.requests import Unsaved

AT_ONCE = 32


@dataclass(frozen=True)
class Outcome:
    """What became of it at the logger at `place`: `text` fits behind its name."""

    place: int
    done: bool
    text: str
    files: tuple[SavedFile, ...] = ()


Answer = tuple[str, tuple[SavedFile, ...]]
Job = Callable[[Client], Answer]


def outcomes(targets: Sequence[LoggerAddress], job: Job, *, read_only: bool) -> Iterator[Outcome]:
    """Yield one outcome for each logger as it comes. Who stops iterating has no further ones asked."""
    pool = ThreadPoolExecutor(max(1, min(AT_ONCE, len(targets))), "silo-bulk")
    try:
        asked = [pool.submit(_ask, place, found, job, read_only=read_only) for place, found in enumerate(targets)]
        for done in as_completed(asked):
            yield done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


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


def stopping(client: Client) -> Answer:
    """Stop."""
    return _state(client.stop()), ()


def stopping_and_saving(client: Client) -> Answer:
    """Stop, and then save, so that the last tick is in the file too."""
    client.stop()
    told, files = saving(client, [FileType.SILO])
    return f"stopped, {told}", files


def starting(client: Client, unsaved: Unsaved | str = Unsaved.REFUSE) -> Answer:
    """Start; one that runs goes on."""
    if client.status().state.value == "running":
        return "runs already, left alone", ()
    return _begun(client.start, unsaved)


def restarting(client: Client, unsaved: Unsaved | str = Unsaved.REFUSE) -> Answer:
    """Start anew."""
    return _begun(client.restart, unsaved)


def _begun(start: Callable[[Unsaved | str, Callable[[str], None]], Status], unsaved: Unsaved | str) -> Answer:
    said: list[str] = []
    return "; ".join([_state(start(unsaved, said.append)), *said]), ()


def saving(client: Client, types: Sequence[FileType], name: str = "", timeout_s: float = LONGEST_S) -> Answer:
    """Save, and wait for the files."""
    files = client.wait_saved(client.save(types, name), timeout_s)
    told = ", ".join(f"{file.path} {size_text(file.size_bytes)}" for file in files)
    return f"saved {told}", tuple(files)


def loading(client: Client, path: str, *, cut: bool = False) -> Answer:
    """Load a script of the robot's own folder."""
    applied = client.load_script(path, cut=cut)
    unknown = f", {many(len(applied.unknown), 'name')} of it unknown" if applied.unknown else ""
    return f"loaded {path or 'its script'}: {many(applied.changed, 'element')} changed{unknown}", ()


def _state(status: Status) -> str:
    unsaved = ", not saved" if status.state.value == "stopped" and status.run_ticks and not status.saved else ""
    return f"{status.state.value}, {many(status.run_ticks, 'tick')}{unsaved}"
