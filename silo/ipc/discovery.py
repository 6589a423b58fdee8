"""Finding loggers: a scan of the folders, no daemon, no broadcast. `survey` asks all of them who they are."""

import re
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from silo.errors import SiloError, VersionError
from silo.ipc import keys
from silo.ipc.exchange import ask_once
from silo.ipc.folders import ForbiddenFolder, forbidden_folders, usable_folders
from silo.ipc.messages import Hello
from silo.ipc.session import SOCKET_SUFFIX, close, dead_mark, open_client, owner_is_gone
from silo.model import Status
from silo.runtime import DOWN_SUFFIX, down_marks, user_name
from silo.version import VERSION

_SOCKET = re.compile(r"(?P<name>.+)\.(?P<pid>[0-9]+)(?:-[0-9]+)?\.sock")
_DOWN = re.compile(rf"(?P<name>.+)\.(?P<pid>[0-9]+){re.escape(DOWN_SUFFIX)}")


@dataclass(frozen=True)
class Found:
    """A logger that listens. `pid` is the robot program's; `socket` is empty for one that is reached by `config`."""

    name: str
    pid: int
    socket: str
    user: str
    config: str = ""
    host: str = ""
    dead: bool = False  # the robot program is gone, its helper still tells what became of the data
    since: float = 0.0  # when it began to listen, or died; seconds since 1970

    @property
    def label(self) -> str:
        """The name with the process id, which tells loggers of one name apart: `anymal.4711`."""
        return f"{self.name}.{self.pid}" if self.pid else self.name


@dataclass(frozen=True)
class Discovery:
    """What was found, by name, and which folders are closed to us. `down` log, but nobody can reach them now."""

    loggers: list[Found]
    forbidden: list[ForbiddenFolder]
    down: list[Found] = field(default_factory=list)

    def named(self, wanted: str) -> list[Found]:
        """Return who can be meant by a name or a label, all by an empty one; the dead only where none of them lives."""
        named = [found for found in self.loggers if wanted in ("", found.name, found.label)]
        return [found for found in named if not found.dead] or named


@dataclass(frozen=True)
class Answer:
    """What a logger said of itself: its status, or why there is none, with a word for it in `state`."""

    found: Found
    status: Status | None
    error: str = ""
    state: str = ""


def discover(timeout_s: float = 1.0, config: str = "") -> Discovery:
    """Return loggers of this host that this user may talk to; with `config` those that this Zenoh configuration
    reaches.

    A logger whose robot program died is left out once the program was started again.

    A scan of folders takes about a millisecond; only `config` can take up to `timeout_s`. Raises ConnectionLostError
    where `config` reaches nobody.
    """
    if config:
        return Discovery(_remote(config, timeout_s), [])
    all_found = [found for folder in usable_folders() for found in _scan(folder)]
    loggers = [found for found in all_found if not (found.dead and _has_successor(found, all_found))]
    reached = {(found.name, found.pid) for found in loggers}
    down = [found for found in _down() if (found.name, found.pid) not in reached]
    return Discovery(sorted(loggers, key=lambda found: (found.name, found.pid)), forbidden_folders(), down)


def _down() -> list[Found]:
    """Loggers of this user whose helper process died, and whose program can't start another."""
    loggers = []
    for path in down_marks():
        match = _DOWN.fullmatch(path.name)
        try:
            found = path.lstat()
        except FileNotFoundError:
            continue  # it is there again
        if match is not None:
            owner = user_name(found.st_uid)
            loggers.append(Found(match["name"], int(match["pid"]), "", owner, since=found.st_mtime))
    return loggers


def down_text(found: Found) -> str:
    """Return what it means that a logger is down."""
    return (
        f"logger '{found.name}' (process {found.pid}): its helper process is down since "
        f"{max(0.0, time.time() - found.since):.0f} s and nobody can reach it; logging goes on, and the program starts "
        "another by itself again and again: its output says why that fails"
    )


def _has_successor(gone: Found, others: list[Found]) -> bool:
    """Return whether a logger of this name was started after this one died."""
    same = [found for found in others if not found.dead and (found.name, found.user) == (gone.name, gone.user)]
    return any(found.since >= gone.since for found in same)


def _scan(folder: Path) -> list[Found]:
    loggers = []
    for path in folder.glob(f"*{SOCKET_SUFFIX}"):
        match = _SOCKET.fullmatch(path.name)
        if match is None or owner_is_gone(path):
            continue
        mark = dead_mark(path)
        dead = mark.exists()
        try:
            owner = user_name(path.lstat().st_uid)
            since = (mark if dead else path).lstat().st_mtime
        except FileNotFoundError:
            continue
        loggers.append(Found(match["name"], int(match["pid"]), str(path), owner, dead=dead, since=since))
    return loggers


def _remote(config: str, timeout_s: float) -> list[Found]:
    session = open_client(None, config)
    try:
        replies = list(session.liveliness().get(keys.ANY_ALIVE, timeout=timeout_s))
    finally:
        close(session)
    roots = {keys.root_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None}
    return [Found(root.logger, 0, "", "", config, root.host) for root in sorted(roots)]


def survey(loggers: list[Found], timeout_s: float = 1.0) -> list[Answer]:
    """Return the status of each logger, asked in parallel; of one that is of another silo, which of both is older.

    One that is frozen costs `timeout_s`, not the sum of them.
    """
    answers: dict[int, Answer] = {}

    def ask(place: int, found: Found) -> None:
        try:
            reply = ask_once(found.socket, found.config, Hello(version=VERSION), timeout_s, found.host, found.name)
            answers[place] = Answer(found, reply.status, state=reply.status.state.value)
        except VersionError as error:
            answers[place] = Answer(found, None, str(error), "other silo")
        except SiloError as error:
            answers[place] = Answer(found, None, str(error), "no answer")

    threads = [threading.Thread(target=ask, args=item, name="silo-survey") for item in enumerate(loggers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [answers[place] for place in range(len(loggers))]


def not_found_text(name: str, discovery: Discovery) -> str:
    """Return why a logger can't be reached, and what to do."""
    down = [found for found in discovery.down if name in ("", found.name, found.label)]
    if down and (name or not discovery.loggers):
        return "\n".join(map(down_text, down))
    wanted = f"no logger '{name}'" if name else "no logger"
    if discovery.loggers:
        others = ", ".join(found.label for found in discovery.loggers)
        return f"{wanted} on this host; there are: {others}"
    text = f"{wanted} is running on this host; start your robot program (it must call serve()), or try `silo demo`"
    for folder in discovery.forbidden:
        names = ", ".join(folder.loggers)
        text += f"\nuser {folder.owner} runs {names} in {folder.path}, which is closed to you: {folder.advice}"
    return text
