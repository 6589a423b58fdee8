"""Which logger is meant: a name is always resolved by who lives, before anything is asked; one that fits two loggers is
refused with the address of each.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import msgspec

from silo.core.names import is_glob
from silo.errors import ConnectionLostError
from silo.fleet.fleet import POLL_S, FleetNow, FleetQuestion, looked, who_is_there
from silo.fleet.near import down_text, near_loggers
from silo.net import keys
from silo.net.configuration import remotes
from silo.net.folders import ForbiddenFolder
from silo.net.found import LoggerAddress, logger_of, told_apart
from silo.net.sessions import borrowed


class Discovery(msgspec.Struct, frozen=True):
    """What was found, by name, and which folders are closed to us. `down` log, but nobody can reach them now.

    The helper process of those who are `left` died a moment ago. `unreachable` says of remotes that don't answer why.
    """

    loggers: list[LoggerAddress]
    forbidden: list[ForbiddenFolder]
    down: list[LoggerAddress] = msgspec.field(default_factory=list)
    unreachable: dict[str, str] = msgspec.field(default_factory=dict)
    left: list[LoggerAddress] = msgspec.field(default_factory=list)

    @classmethod
    def of(cls, seen: FleetNow) -> "Discovery":
        """Return who is there of what was seen."""
        loggers = sorted((one.found for one in seen.members if one.here), key=by_name)
        return cls(loggers, list(seen.near.forbidden), list(seen.near.down), seen.unreachable, list(seen.near.left))

    def named(self, wanted: str) -> list[LoggerAddress]:
        """Return who can be meant by a name or an address, all by an empty one; the dead only where none of them
        lives.
        """
        named = [found for found in self.loggers if found.is_meant_by(wanted)]
        return [found for found in named if not found.dead] or named

    def comes_back(self, wanted: str) -> bool:
        """Whether nobody can be meant now, but one whose program starts another helper process."""
        wanted = logger_of(wanted)
        return not self.named(wanted) and any(found.is_meant_by(wanted) for found in (*self.down, *self.left))

    def matching(self, pattern: str) -> list[LoggerAddress]:
        """Return all that a glob means, or a name or address."""
        return [found for found in self.loggers if found.matches(pattern)]

    def one(self, wanted: str) -> LoggerAddress:
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


def by_name(found: LoggerAddress) -> tuple[str, int, str, str]:
    """Return what loggers are ordered by in lists for people who type their names."""
    return found.name, found.pid, found.host, found.id


def discover(timeout_s: float = 1.0, config: str = "", holding: ExitStack | None = None) -> Discovery:
    """Return loggers that this user may talk to: those of this host, and of the remotes that `silo remote add` made.

    With `config` those that this Zenoh configuration or remote reaches, and no others; `local` means this host alone.
    A logger whose robot program died is left out once the program was started again.

    A scan of folders takes about a millisecond, a remote some round trips; one that doesn't answer is told in
    `unreachable`. Sessions to remotes stay open until `holding` is closed, for what is to be asked next: over a slow
    link to open one is most of the time. Raises ConnectionLostError where `config` can't be reached.
    """
    return Discovery.of(looked(config, FleetQuestion(question=None, answer_s=timeout_s, holding=holding)))


def awaited(wanted: str, look: Callable[[], Discovery], timeout_s: float) -> LoggerAddress:
    """Return the only logger that is meant; one that gets another helper process just now is waited for, so long.

    `look` looks around anew at each call. Raises as `Discovery.one`.
    """
    until_s = time.monotonic() + timeout_s
    while (discovery := look()).comes_back(wanted) and time.monotonic() < until_s:
        time.sleep(POLL_S)
    return discovery.one(wanted)


def namesakes(found: LoggerAddress, timeout_s: float) -> list[LoggerAddress]:
    """Return the loggers of that name on computers of that name, itself among them while it lives. Raises SiloError."""
    if not found.config:
        return list(near_loggers().loggers)
    _, host, name = str(keys.Root(found.host, found.name)).split("/")
    with borrowed("", found.config) as mine:  # of a hundred loggers, one token comes and not all
        roots = who_is_there(mine, f"silo/{keys.host_part(host)}/{name}/alive", timeout_s)
    return [LoggerAddress.behind(found.config, root) for root in roots]


def not_found_text(name: str, discovery: Discovery) -> str:
    """Return why a logger can't be reached, and what to do."""
    down = [found for found in discovery.down if found.is_meant_by(name)]
    if down and (name or not discovery.loggers):
        return "\n".join(map(down_text, down))
    wanted = f"no logger '{name}'" if name else "no logger"
    closed = [f"remote '{remote}': {why}" for remote, why in discovery.unreachable.items()]
    if name and Path(name).is_dir():
        lists = "`silo runs` lists the logs in one, `silo recover` tells what programs that died logged last there"
        closed.insert(0, f"'{name}' is a folder: {lists}")
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
