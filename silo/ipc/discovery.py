"""Finding loggers: a scan of the folders, no daemon, no broadcast. `survey` asks all of them for their status."""

import re
import threading
from dataclasses import dataclass
from pathlib import Path

from silo.errors import SiloError
from silo.ipc import keys
from silo.ipc.exchange import ask_once
from silo.ipc.folders import ForbiddenFolder, forbidden_folders, usable_folders
from silo.ipc.messages import GetStatus
from silo.ipc.session import SOCKET_SUFFIX, close, dead_mark, open_client, owner_is_gone
from silo.model import Status
from silo.runtime import user_name

_SOCKET = re.compile(r"(?P<name>.+)\.(?P<pid>[0-9]+)(?:-[0-9]+)?\.sock")


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
    """What was found, by name, and which folders are closed to us."""

    loggers: list[Found]
    forbidden: list[ForbiddenFolder]


@dataclass(frozen=True)
class Answer:
    """What a logger said of itself: its status, or why there is none."""

    found: Found
    status: Status | None
    error: str = ""


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
    return Discovery(sorted(loggers, key=lambda found: (found.name, found.pid)), forbidden_folders())


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
    """Return the status of each logger, asked in parallel.

    One that is frozen costs `timeout_s`, not the sum of them.
    """
    answers: dict[int, Answer] = {}

    def ask(place: int, found: Found) -> None:
        try:
            reply = ask_once(found.socket, found.config, GetStatus(), timeout_s, found.host, found.name)
            answers[place] = Answer(found, reply.status)
        except SiloError as error:
            answers[place] = Answer(found, None, str(error))

    threads = [threading.Thread(target=ask, args=item, name="silo-survey") for item in enumerate(loggers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [answers[place] for place in range(len(loggers))]


def not_found_text(name: str, discovery: Discovery) -> str:
    """Return why a logger can't be reached, and what to do."""
    wanted = f"no logger '{name}'" if name else "no logger"
    if discovery.loggers:
        others = ", ".join(found.label for found in discovery.loggers)
        return f"{wanted} on this host; there are: {others}"
    text = f"{wanted} is running on this host; start your robot program (it must call serve()), or try `silo demo`"
    for folder in discovery.forbidden:
        names = ", ".join(folder.loggers)
        text += f"\nuser {folder.owner} runs {names} in {folder.path}, which is closed to you: {folder.advice}"
    return text
