"""`silo ls`: the loggers that run, once, or followed (`silo.cli.loggers.follow`)."""

import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.common import (
    complete_logger,
    configuration,
    json_option,
    logged_for,
    show_json,
    show_rows,
    tell_unreachable,
)
from silo.core.quantities.writing import and_more, count, duration_text, many, size_text
from silo.errors import ConnectionLostError
from silo.net.configuration import LOCAL
from silo.printing import printable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from silo.core.elements import Status
    from silo.fleet.fleet import FleetNow
    from silo.fleet.member import Member
    from silo.net.found import LoggerAddress


MOST_LOST = 20  # lines of those that are gone
MOST_NAMED = 3  # loggers that stopped for the same reason


@click.command()
@click.argument("pattern", required=False, default="", metavar="[HOST/NAME]", shell_complete=complete_logger)
@click.option("-f", "--follow", is_flag=True, help="Go on: lines change in place; in a pipe one line per change.")
@json_option
def ls(pattern: str, follow: bool, as_json: bool) -> None:
    """List the loggers that run on this host and on remotes, and remove what dead ones left that holds no data.

    A glob means many: of hosts, of names, of both. HOST/NAME is what all commands take; where two are alike, ADDRESS
    tells them apart.

    \b
    Examples:
      silo ls
      silo ls 'robot*/*'
      silo ls --json | jq '.[].logger'
      silo ls --follow                       (state, rate, losses, disk, alarms, who is there, until Ctrl-C)
    """
    from silo.net.found import logger_of

    pattern = logger_of(pattern)
    if follow:
        from silo.cli.loggers.follow import follow_fleet

        follow_fleet(pattern, as_json=as_json)
        return
    from silo.fleet.fleet import asked_all
    from silo.fleet.resolving import Discovery, by_name, not_found_text

    if configuration() in ("", LOCAL):
        _sweep()
    seen = asked_all(configuration(), pattern)
    meant = sorted(seen.meant(pattern), key=lambda one: (one.lost, one.down, by_name(one.found)))
    answers, lost = [one for one in meant if not one.lost], [one for one in meant if one.lost]
    if configuration() in ("", LOCAL):
        _sweep_parts(_log_folders(answers))
    if as_json:
        show_json(_facts(meant))
        return
    if not answers:
        _tell_gone(seen, lost)
        _tell_orphans(answers)
        why = seen.unreachable.get(configuration()) or not_found_text(pattern, Discovery.of(seen))
        raise ConnectionLostError(why)
    answers.sort(key=lambda one: one.stalled, reverse=True)  # a program that is frozen wants to be looked at first
    _show_table(answers)
    tell_unreachable(seen.unreachable)
    _tell_gone(seen, lost)
    for one in answers:
        if one.problem:
            click.echo(f"{one.found.label}: {one.problem}", err=True)
    for line in _reasons(answers):
        click.echo(printable(line), err=True)
    for folder in seen.near.forbidden:
        names = ", ".join(folder.loggers) or "unknown loggers"
        click.echo(f"user {folder.owner} runs {names} in {folder.path}, closed to you: {folder.advice}", err=True)
    _tell_orphans(answers)
    if all(one.status is None and not one.down for one in answers):
        raise ConnectionLostError("none of them can be asked, see above")


def _tell_gone(seen: "FleetNow", lost: "list[Member]") -> None:
    """What routers refused, and who was there and isn't any more, without having been closed while somebody looked."""
    from silo.fleet.member import lost_lines

    lines = lost_lines(lost, time.monotonic(), time.time_ns())
    more = [f"and {many(len(lines) - MOST_LOST, 'host')} more"] if len(lines) > MOST_LOST else []
    for line in [*(router.words for router in seen.routers), *lines[:MOST_LOST], *more]:
        click.echo(printable(line), err=True)


def _reasons(answers: "list[Member]") -> list[str]:
    """Why loggers don't run: a line each of those that died, one for all that were stopped for the same reason."""
    names: dict[str, list[str]] = {}
    for answer in answers:
        status = answer.status
        if status and status.reason and status.state.value != "running":
            of_its_own = status.state.value == "dead"
            names.setdefault(f"{answer.found.label}\0" * of_its_own + status.reason, []).append(answer.found.label)
    return [f"{and_more(labels, MOST_NAMED)}: {reason.rpartition(chr(0))[2]}" for reason, labels in names.items()]


# columns that are shown where one of the loggers has something in them, of the others a word for nothing
_MORE: "tuple[tuple[str, Callable[[Status], str], str], ...]" = (
    ("DURABLE TO TICK", lambda one: count(one.durable_ticks) if one.durable_ticks >= 0 else "", "-"),
    ("REC", lambda one: str(one.recorders or ""), "0"),
    ("FREE", lambda one: size_text(one.disk_free_bytes) if one.disk_bytes else "", "-"),
    ("ALARM", lambda one: f"{one.alarm} {one.alarms}" if one.alarms else "", "-"),
    ("DENIED", lambda one: str(one.denied or ""), "-"),  # logins and changes; `silo events` tells whose
    ("WHO", lambda one: " ".join(dict.fromkeys(each.who.split(" ", 1)[0] for each in one.clients)), "-"),
)


def _show_table(answers: "list[Member]") -> None:
    header = ("LOGGER", "HOST", "STATE", "FOR", "HZ", "TICKS", "LOST", "ELEMENTS", "PID", "USER")
    columns = [list(column) for column in zip(header, *map(_ls_row, answers), strict=True)]
    for title, text, none in _MORE:
        texts = [text(answer.status) if answer.status else "" for answer in answers]
        if any(texts):
            columns.append([title, *(each or none for each in texts)])
    if any(apart := _addresses([answer.found for answer in answers])):
        columns.append(["ADDRESS", *apart])
    numbers = ("FOR", "HZ", "TICKS", "LOST", "ELEMENTS", "PID", "DURABLE TO TICK", "REC", "FREE")
    show_rows(list(zip(*columns, strict=True)), [place for place, one in enumerate(columns) if one[0] in numbers])


def _addresses(found: "Sequence[LoggerAddress]") -> list[str]:
    """What to type for each logger whose host and name another one has as well; empty for the others."""
    from silo.net.found import told_apart

    names = [(one.host, one.name) for one in found]
    return [word if names.count(name) > 1 else "" for word, name in zip(told_apart(found), names, strict=True)]


def _facts(answers: "list[Member]") -> list[dict[str, object]]:
    """What is told to machines of each: its status, or why there is none, and the word that means it and no other."""
    import msgspec

    from silo.net.found import told_apart

    facts = []
    for answer, address in zip(answers, told_apart(answer.found for answer in answers), strict=True):
        unknown = {"logger": answer.found.label, "state": answer.word, "error": answer.problem}
        facts.append({"address": address, **(msgspec.to_builtins(answer.status) if answer.status else unknown)})
    return facts


def _sweep() -> None:
    """Sockets of helpers that died, and segments without an unsaved tick."""
    from silo.core.runtime import orphaned_segments, runtime_dir, sweep_unfinished
    from silo.net.folders import own_folders
    from silo.net.session import sweep

    for folder in own_folders():
        sweep(folder)
    sweep_unfinished(runtime_dir())
    if orphaned_segments():
        from silo.recovery.segments import left_segments, sweep_segments  # need NumPy, without which `ls` is quicker

        _sweep_parts(one.schema.folder for one in left_segments() if one.schema)  # of programs that nobody served, too
        sweep_segments()


def _log_folders(answers: "list[Member]") -> list[str]:
    """Where loggers save, kept journals or recorded, as far as it is known; and this folder."""
    from silo.journal.folders import RECORDINGS, remembered_folders

    served = [answer.status.folder for answer in answers if answer.status]
    remembered = [*remembered_folders(), *remembered_folders(RECORDINGS)]
    return list(dict.fromkeys([str(Path.cwd()), *served, *map(str, remembered)]))


def _sweep_parts(folders: Iterable[str]) -> None:
    """What killed saves left."""
    from silo.journal.folders import UNNAMED_FILES

    for folder in dict.fromkeys(folders):
        if any(Path(folder).glob(UNNAMED_FILES)):
            from silo.files.atomic import sweep_parts  # needs NumPy, which `ls` does without as a rule

            sweep_parts(folder)


def _tell_orphans(answers: "list[Member]") -> None:
    """What programs left behind that nobody would find without being told."""
    from silo.core.runtime import orphaned_segments

    if orphans := len(orphaned_segments()):
        click.echo(
            f"{many(orphans, 'recording')} of programs that died may be in no file: `silo recover --list`", err=True
        )
    for folder in _log_folders(answers):
        if any(Path(folder).glob(".*.journal")):
            _tell_journals(folder)


def _tell_journals(folder: str) -> None:
    from silo.recovery.journals import orphaned_journals, sweep_journals  # needs NumPy, as a rule none is there

    sweep_journals(folder)
    if orphans := len(orphaned_journals(folder)):
        click.echo(
            f"{many(orphans, 'journal')} in {folder} may hold what a power cut took from memory: "
            f"`silo recover --list {folder}`",
            err=True,
        )


def _ls_row(one: "Member") -> tuple[str, ...]:
    from silo.core.quantities.writing import whole_duration

    found, status = one.found, one.status
    if status is None:
        down = duration_text(time.time() - found.since) if one.down else "-"
        who = found.label if found.pid else found.name
        return (who, found.host or "-", one.word, down, *["-"] * 4, str(found.pid or "-"), found.user or "-")
    return (
        found.name,
        found.host or status.host,
        f"{one.word} {whole_duration(status.idle_s)}" if one.stalled else one.word,
        logged_for(status),
        "0" if one.stalled else f"{status.measured_hz:.4g}" if status.measured_hz else "-",
        count(status.run_ticks),
        count(one.lost_count) if one.lost_count is not None else "-",
        f"{status.enabled}/{status.elements}",
        str(status.pid),
        status.user,
    )
