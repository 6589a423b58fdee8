"""Finding loggers: a scan of the folders and a look at the remotes, no daemon, no broadcast. `survey` asks them.

A name is always resolved here, by who lives, before anything is asked: one that fits two loggers is refused with the
address of each.
"""

import functools
import math
import re
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import zenoh

from silo.errors import ConnectionLostError, SiloError, VersionError
from silo.ipc import keys
from silo.ipc.access import host_part
from silo.ipc.addresses import logger_of
from silo.ipc.asking import Asking
from silo.ipc.configuration import find_file, from_file, user_of
from silo.ipc.exchange import ask_once, checked_reply, decode_reply, root_at
from silo.ipc.folders import ForbiddenFolder, forbidden_folders, usable_folders
from silo.ipc.found import Found, is_glob, told_apart
from silo.ipc.messages import Hello, HelloReply
from silo.ipc.probing import Layer, LayerError
from silo.ipc.remotes import LOCAL, remotes
from silo.ipc.session import SOCKET_SUFFIX, dead_mark, key_file, owner_is_gone
from silo.ipc.sessions import Borrowed, borrowed
from silo.model import Status
from silo.runtime import DOWN_SUFFIX, down_marks, user_name
from silo.version import VERSION

_SOCKET = re.compile(r"(?P<name>.+)\.(?P<pid>[0-9]+)(?:-(?P<copy>[0-9]+))?\.sock")
_DOWN = re.compile(rf"(?P<name>.+)\.(?P<pid>[0-9]+){re.escape(DOWN_SUFFIX)}")


PATIENCE = 5  # who looks again and again spends a sixth of the time on a remote that is silent
# in which it is looked again where nobody is there: beside a subscription that begins Zenoh says so of everybody
NOBODY_S = 0.3
_silent: dict[str, tuple[float, float, str]] = {}  # by remote: when it failed to answer, how long that took, why


@dataclass(frozen=True)
class Discovery:
    """What was found, by name, and which folders are closed to us. `down` log, but nobody can reach them now.

    `unreachable` says of remotes that don't answer why.
    """

    loggers: list[Found]
    forbidden: list[ForbiddenFolder]
    down: list[Found] = field(default_factory=list)
    unreachable: dict[str, str] = field(default_factory=dict)

    def named(self, wanted: str) -> list[Found]:
        """Return who can be meant by a name or an address, all by an empty one; the dead only where none of them
        lives.
        """
        named = [found for found in self.loggers if found.is_meant_by(wanted)]
        return [found for found in named if not found.dead] or named

    def matching(self, pattern: str) -> list[Found]:
        """Return all that a glob means, or a name or address."""
        return [found for found in self.loggers if found.is_meant_by(pattern) or found.matches(pattern)]

    def one(self, wanted: str) -> Found:
        """Return the only one that is meant. Raises SeveralError with the address of each where several are, else
        ConnectionLostError.
        """
        wanted = logger_of(wanted)
        if is_glob(wanted):
            raise SeveralError(
                f"'{wanted}' can mean several loggers, and this is for one: name it; `silo ls '{wanted}'` lists them; "
                "nothing was asked"
            )
        named = self.named(wanted)
        if not named:
            raise ConnectionLostError(not_found_text(wanted, self))
        if len(named) > 1:
            who = (
                f"{len(named)} loggers are called '{wanted}', say which one"
                if wanted
                else "several loggers run, say which"
            )
            raise SeveralError(f"{who}: {', '.join(told_apart(named))}; nothing was asked")
        return named[0]


class SeveralError(ConnectionLostError):
    """A name fits several loggers, or can; the message says how to name one."""


@dataclass(frozen=True)
class Near:
    """The loggers of this computer, the folders that are closed to us, and those that nobody can reach now."""

    loggers: tuple[Found, ...] = ()
    forbidden: tuple[ForbiddenFolder, ...] = ()
    down: tuple[Found, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What a logger said of itself: its status, or why there is none, with a word for it in `state`."""

    found: Found
    status: Status | None
    error: str = ""
    state: str = ""


def discover(timeout_s: float = 1.0, config: str = "", holding: ExitStack | None = None) -> Discovery:
    """Return loggers that this user may talk to: those of this host, and of the remotes that `silo remote add` made.

    With `config` those that this Zenoh configuration or remote reaches, and no others; `local` means this host alone.
    A logger whose robot program died is left out once the program was started again.

    A scan of folders takes about a millisecond, a remote some round trips; one that doesn't answer is told in
    `unreachable`. Sessions to remotes stay open until `holding` is closed, for what is to be asked next: over a slow
    link to open one is most of the time. Raises ConnectionLostError where `config` can't be reached.
    """
    with ExitStack() as mine:
        held = holding if holding is not None else mine
        return _discovered(timeout_s, config, held)


def _discovered(timeout_s: float, config: str, holding: ExitStack) -> Discovery:
    if config and config != LOCAL:
        return Discovery(_remote(config, timeout_s, holding), [])
    far, unreachable = ([], {}) if config == LOCAL else _all_remotes(timeout_s, holding)
    near = _near()
    known = {found.root for found in near if found.id}
    # a logger of this computer that is seen through a router too is one, and the short way is taken
    loggers = near + [found for found in far if found.root not in known]
    reached = {(found.name, found.pid) for found in near}
    down = [found for found in _down() if (found.name, found.pid) not in reached]
    loggers.sort(key=lambda found: (found.name, found.pid, found.host, found.id))
    return Discovery(loggers, forbidden_folders(), down, unreachable)


def near_loggers() -> Near:
    """Return what is seen of this computer by a scan of its folders."""
    loggers = _near()
    reached = {(found.name, found.pid) for found in loggers}
    down = (found for found in _down() if (found.name, found.pid) not in reached)
    return Near(tuple(loggers), tuple(forbidden_folders()), tuple(down))


def _near() -> list[Found]:
    """Loggers of this computer."""
    all_found = [found for folder in usable_folders() for found in _scan(folder)]
    return [found for found in all_found if not (found.dead and _has_successor(found, all_found))]


def _all_remotes(timeout_s: float, holding: ExitStack) -> tuple[list[Found], dict[str, str]]:
    """Loggers of all remotes, asked at the same time; those that two remotes reach once."""
    found: dict[str, list[Found]] = {}
    failed: dict[str, str] = {}

    def look(name: str) -> None:
        begun_s = time.monotonic()
        at_s, took_s, why = _silent.get(name, (-math.inf, 0.0, ""))
        if begun_s - at_s < PATIENCE * took_s:
            failed[name] = why
            return
        try:
            found[name] = _remote(name, timeout_s, holding)
        except SiloError as error:
            now_s = time.monotonic()
            failed[name] = str(error)
            _silent[name] = (now_s, now_s - begun_s, str(error))

    threads = [threading.Thread(target=look, args=(name,), name="silo-remote") for name in remotes()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    by_root = {one.root: one for name in sorted(found, reverse=True) for one in found[name]}
    return list(by_root.values()), dict(sorted(failed.items()))


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
        root = _root_of_socket(path)
        host, drawn = (root.host, root.id) if root is not None else ("", "")
        name, pid, copy = match["name"], int(match["pid"]), int(match["copy"] or 0)
        loggers.append(Found(name, pid, str(path), owner, "", host, dead, since, drawn, copy))
    return loggers


def seen_now(found: Found) -> Found:
    """Return a logger of this computer with the keys that it has now: it draws others when it is served again."""
    root = _root_of_socket(Path(found.socket))
    return replace(found, host=root.host, id=root.id) if root is not None else replace(found, host="", id="")


def _root_of_socket(path: Path) -> keys.Root | None:
    """Return what stands beside a socket; None where an older silo made it, or its owner is ending."""
    try:
        return keys.root_of(key_file(path).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def namesakes(found: Found, timeout_s: float) -> list[Found]:
    """Return the loggers of that name on computers of that name, itself among them while it lives. Raises SiloError."""
    if not found.config:
        return _near()
    with ExitStack() as holding:  # of a hundred loggers, one token comes and not all
        _, host, name = str(keys.Root(found.host, found.name)).split("/")
        alive = f"silo/{host_part(host)}/{name}/alive"
        return _remote(found.config, timeout_s, holding, alive)


def _remote(config: str, timeout_s: float, holding: ExitStack, alive: str = keys.ANY_ALIVE) -> list[Found]:
    mine = holding.enter_context(borrowed("", config))
    with mine.looking:
        roots = those_there(mine, alive, timeout_s)
        until_s = time.monotonic() + NOBODY_S + mine.slack_s
        while not roots and time.monotonic() < until_s:
            time.sleep(NOBODY_S / 10)
            roots = those_there(mine, alive, timeout_s)
    if not roots:
        raise LayerError(Layer.ROLE, nobody_there(config, mine.session))
    return [Found(root.logger, 0, "", "", config, root.host, id=root.id) for root in roots]


def those_there(mine: Borrowed, alive: str, timeout_s: float) -> list[keys.Root]:
    """Return whose tokens are there, sorted."""
    replies = mine.session.liveliness().get(alive, timeout=timeout_s + mine.slack_s)
    seen = {keys.robot_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None}
    return sorted(root for root in seen if root is not None)


def nobody_there(config: str, session: zenoh.Session) -> str:
    """Return what it means that a session by a configuration sees no logger."""
    user = user_of(from_file(find_file(config)))
    who = f"user '{user}' is let in" if user else "we are let in without a user name"
    nobody = "no robot is connected to this router now, or " if session.info.routers_zid() else ""
    rules = f"{nobody}the rules (access_control) on the other side give it no role"
    return f"{config}: {who}, but sees no logger: {rules}"


def survey(loggers: list[Found], timeout_s: float = 1.0) -> list[Answer]:
    """Return the status of each logger; of one that is of another silo, which of both is older.

    All are asked at the same time, those of a configuration over its one session: a hundred cost one round trip, and
    those that are frozen `timeout_s`, not the sum of them.
    """
    answers: dict[int, Answer] = {}

    def ask_near(place: int, found: Found) -> None:
        answers[place] = _answer(found, lambda: ask_once(found, Hello(version=VERSION), timeout_s))

    def ask_far(config: str, places: list[int]) -> None:
        question = Hello(version=VERSION)
        replies: dict[int, bytes | None] = {}
        lost: SiloError | None = None
        try:
            with borrowed("", config) as mine:
                asking: Asking[int] = Asking(mine, timeout_s)
                for place in places:
                    asking.add(place, root_at(mine, loggers[place], timeout_s), question)
                replies = asking.wait()
        except SiloError as error:
            lost = error
        for place in places:
            who = f"logger '{loggers[place].label}'"
            answers[place] = _answer(loggers[place], functools.partial(_hello, replies.get(place), who, lost))

    near = [(place, found) for place, found in enumerate(loggers) if not found.config]
    far = {config: [place for place, found in enumerate(loggers) if found.config == config]
           for config in dict.fromkeys(found.config for found in loggers if found.config)}  # fmt: skip
    threads = [threading.Thread(target=ask_near, args=item, name="silo-survey") for item in near]
    threads += [threading.Thread(target=ask_far, args=item, name="silo-survey") for item in far.items()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [answers[place] for place in range(len(loggers))]


def _answer(found: Found, ask: Callable[[], HelloReply]) -> Answer:
    try:
        status = ask().status
    except VersionError as error:
        return Answer(found, None, str(error), "other silo")
    except SiloError as error:
        return Answer(found, None, str(error), "no answer")
    return Answer(found, status, state=status.state.value)


def _hello(payload: bytes | None, who: str, lost: SiloError | None) -> HelloReply:
    if payload is None:
        raise lost or ConnectionLostError(
            f"{who} gave no answer: its helper process is frozen, overloaded or gone, or no role lets this user ask"
        )
    return checked_reply(Hello(), decode_reply(payload, who))


def not_found_text(name: str, discovery: Discovery) -> str:
    """Return why a logger can't be reached, and what to do."""
    down = [found for found in discovery.down if found.is_meant_by(name)]
    if down and (name or not discovery.loggers):
        return "\n".join(map(down_text, down))
    wanted = f"no logger '{name}'" if name else "no logger"
    closed = [f"remote '{remote}': {why}" for remote, why in discovery.unreachable.items()]
    where = "on this host" if not any(found.config for found in discovery.loggers) else "here"
    if discovery.loggers:
        others = ", ".join(told_apart(discovery.loggers))
        return "\n".join([f"{wanted} {where}; there are: {others}", *closed])
    text = f"{wanted} is running on this host; start your robot program (it must call serve()), or try `silo demo`"
    if not discovery.unreachable and not remotes():
        text += "; robots elsewhere are seen by `silo remote add` (`silo remote --help` shows the way)"
    for folder in discovery.forbidden:
        names = ", ".join(folder.loggers)
        text += f"\nuser {folder.owner} runs {names} in {folder.path}, which is closed to you: {folder.advice}"
    return "\n".join([text, *closed])
