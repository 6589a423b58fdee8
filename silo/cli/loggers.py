"""`silo ls`, `info`, `start`, `stop`, `restart`, `save`."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.amounts import duration
from silo.cli.common import (
    complete_logger,
    complete_words,
    configuration,
    connect,
    discovered,
    file_types,
    json_option,
    logger_argument,
    many,
    naming_ways_out,
    say_saved,
    show_duration,
    show_json,
    show_rows,
    split_logger,
    tell_unreachable,
    type_of,
    types_option,
    unsaved,
    unsaved_options,
)
from silo.errors import ConnectionLostError
from silo.files.formats import LOG_ENDINGS, OPEN_PART_ENDING
from silo.ipc.remotes import LOCAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from silo.ipc.discovery import Answer
    from silo.ipc.found import Found
    from silo.model import ElementInfo, Status


@click.command()
@click.argument("pattern", required=False, default="", metavar="[HOST/NAME]", shell_complete=complete_logger)
@json_option
def ls(pattern: str, as_json: bool) -> None:
    """List the loggers that run on this host and on remotes, and remove what dead ones left that holds no data.

    A glob means many: of hosts, of names, of both. HOST/NAME is what all commands take; where two are alike, ADDRESS
    tells them apart.

    \b
    Examples:
      silo ls
      silo ls 'robot*/*'
      silo ls --json | jq '.[].logger'
    """
    from silo.ipc.discovery import Answer, down_text, not_found_text, survey

    if configuration() in ("", LOCAL):
        _sweep()
    discovery = discovered()
    chosen = discovery.matching(pattern)
    answers = survey(chosen)
    answers += [
        Answer(found, None, down_text(found), "helper down")
        for found in discovery.down
        if found.is_meant_by(pattern) or found.matches(pattern)
    ]
    if configuration() in ("", LOCAL):
        _sweep_parts(_log_folders(answers))
    if as_json:
        show_json([answer.status or _no_status(answer) for answer in answers])
        return
    if not answers:
        _tell_orphans(answers)
        raise ConnectionLostError(not_found_text(pattern, discovery))
    header = ("LOGGER", "HOST", "STATE", "SINCE", "HZ", "TICKS", "LOST", "ELEMENTS", "PID", "USER")
    rows = [header, *map(_ls_row, answers)]
    durable = [answer.status.durable_ticks if answer.status else -1 for answer in answers]
    if max(durable) >= 0:  # somebody asked for it
        last = ("DURABLE TO TICK", *(str(tick) if tick >= 0 else "-" for tick in durable))
        rows = [(*row, end) for row, end in zip(rows, last, strict=True)]
    recorders = [answer.status.recorders if answer.status else 0 for answer in answers]
    if any(recorders):
        rows = [(*row, end) for row, end in zip(rows, ("REC", *map(str, recorders)), strict=True)]
    right = (3, 4, 5, 6, 7, 8, *range(10, len(rows[0])))
    apart = _addresses([answer.found for answer in answers])
    if any(apart):
        rows = [(*row, end) for row, end in zip(rows, ("ADDRESS", *apart), strict=True)]
    show_rows(rows, right=right)
    tell_unreachable(discovery)
    for answer in answers:
        if answer.error:
            click.echo(f"{answer.found.label}: {answer.error}", err=True)
        elif answer.status and answer.status.reason and answer.status.state.value != "running":
            click.echo(f"{answer.found.label}: {answer.status.reason}", err=True)
    for folder in discovery.forbidden:
        names = ", ".join(folder.loggers) or "unknown loggers"
        click.echo(f"user {folder.owner} runs {names} in {folder.path}, closed to you: {folder.advice}", err=True)
    _tell_orphans(answers)
    if all(answer.state in ("no answer", "other silo") for answer in answers):
        raise ConnectionLostError("none of them can be asked, see above")


def _addresses(found: "Sequence[Found]") -> list[str]:
    """What to type for each logger whose host and name another one has as well; empty for the others."""
    from silo.ipc.found import told_apart

    names = [(one.host, one.name) for one in found]
    return [word if names.count(name) > 1 else "" for word, name in zip(told_apart(found), names, strict=True)]


def _no_status(answer: "Answer") -> dict[str, str]:
    return {"logger": answer.found.label, "state": answer.state, "error": answer.error}


def _sweep() -> None:
    """Sockets of helpers that died, and segments without an unsaved tick."""
    from silo.ipc.folders import own_folders
    from silo.ipc.session import sweep
    from silo.runtime import orphaned_segments, runtime_dir, sweep_unfinished

    for folder in own_folders():
        sweep(folder)
    sweep_unfinished(runtime_dir())
    if orphaned_segments():
        from silo.collecting.left_behind import find_stale, sweep_segments  # need NumPy, without which `ls` is quicker

        _sweep_parts(one.schema.folder for one in find_stale() if one.schema)  # of programs that nobody served, too
        sweep_segments()


def _log_folders(answers: "list[Answer]") -> list[str]:
    """Where loggers save, or kept journals, as far as it is known; and this folder."""
    from silo.collecting.journal_folders import remembered_folders

    served = [answer.status.folder for answer in answers if answer.status]
    return list(dict.fromkeys([str(Path.cwd()), *served, *map(str, remembered_folders())]))


def _sweep_parts(folders: Iterable[str]) -> None:
    """What killed saves left."""
    for folder in dict.fromkeys(folders):
        if any(Path(folder).glob(".silo-*.part")):
            from silo.files.atomic import sweep_parts  # needs NumPy, which `ls` does without as a rule

            sweep_parts(folder)


def _tell_orphans(answers: "list[Answer]") -> None:
    """What programs left behind that nobody would find without being told."""
    from silo.runtime import orphaned_segments

    count = len(orphaned_segments())
    if count:
        click.echo(
            f"{many(count, 'recording')} of programs that died may be in no file: `silo recover --list`", err=True
        )
    for folder in _log_folders(answers):
        if any(Path(folder).glob(".*.journal")):
            _tell_journals(folder)


def _tell_journals(folder: str) -> None:
    from silo.collecting.left_journals import orphaned_journals, sweep_journals  # needs NumPy, as a rule none is there

    sweep_journals(folder)
    count = len(orphaned_journals(folder))
    if count:
        click.echo(
            f"{many(count, 'journal')} in {folder} may hold what a power cut took from memory: "
            f"`silo recover --list {folder}`",
            err=True,
        )


def _ls_row(answer: "Answer") -> tuple[str, ...]:
    found, status = answer.found, answer.status
    if status is None:
        since = show_duration(time.time() - found.since) if answer.state == "helper down" else "-"
        who = found.label if found.pid else found.name
        return (who, found.host or "-", answer.state, since, *["-"] * 4, str(found.pid or "-"), found.user or "-")
    return (
        found.name,
        found.host or status.host,
        status.state.value,
        _since(status),
        f"{status.measured_hz or status.frequency_hz:.4g}" if status.state.value == "running" else "-",
        str(status.ticks),
        str(status.lost),
        f"{status.enabled}/{status.elements}",
        str(status.pid),
        status.user,
    )


def _since(status: "Status") -> str:
    return show_duration((time.time_ns() - status.started_ns) / 1e9) if status.state.value == "running" else "-"


@click.command()
@click.argument("words", nargs=-1, metavar="[LOGGER] [PATTERN]...", shell_complete=complete_words)
@click.option("-e", "--elements", "all_elements", is_flag=True, help="List all elements.")
@json_option
def info(words: tuple[str, ...], all_elements: bool, as_json: bool) -> None:
    """Show a logger, the elements that match, or what is in a saved file.

    \b
    Examples:
      silo info                              (the only logger)
      silo info demo '*/torque' /log/base    (elements: glob or namespace)
      silo info demo_20260102_10-00-00_00001.silo
    """
    if len(words) == 1 and (words[0].lower().endswith((*LOG_ENDINGS, OPEN_PART_ENDING)) or words[0].isdecimal()):
        from silo.cli.files import print_file_info

        print_file_info(Path(words[0]), as_json)
        return
    logger, patterns = split_logger(words)
    with _telling_what_was_left(logger), connect(logger) as client:
        status = client.status()
        table = client.table() if patterns or all_elements or as_json else None
        elements = [*table.elements, *table.derived] if table is not None else []
    if patterns:
        from silo.cli.edits import select

        elements = [elements[place] for place in select([e.name for e in elements], patterns)]
    if as_json:
        show_json({"status": status, "elements": elements})
        return
    if not patterns:
        _show_status(status)
    if elements:
        _show_elements(elements)


@contextmanager
def _telling_what_was_left(logger: str | None) -> Iterator[None]:
    """Where no logger is found, say which recordings dead ones left in memory, and how they are saved."""
    try:
        yield
    except ConnectionLostError as error:
        from silo.runtime import orphaned_segments

        if configuration() or not orphaned_segments():
            raise
        from silo.collecting.left_behind import find_stale

        left = [
            f"logger '{one.schema.logger}' died: {one.reason}; it held {one.holdings.text}: `silo recover` saves it"
            for one in find_stale()
            if one.schema and one.holdings and logger in (None, one.schema.logger)
        ]
        raise ConnectionLostError("\n".join([str(error), *left])) from error


def _show_status(status: "Status") -> None:
    limit = f"{status.max_time_s:g} s" if status.max_time_s else "none"
    unsaved = "" if status.saved or not status.ticks else f", not saved ({_held(status)})"
    rows = [
        ("logger", f"{status.logger} on {status.host}, user {status.user}"),
        ("state", f"{status.state.value}{f' ({status.reason})' if status.reason else ''}"),
        *_recording(status),
        ("frequency", f"{status.frequency_hz:g} Hz, measured {status.measured_hz:.4g} Hz"),
        ("logged", f"{status.ticks} ticks{f' in {_since(status)}' if _since(status) != '-' else ''}{unsaved}"),
        ("lost", f"{status.lost} samples"),
        *_failed(status),
        *_durable(status),
        ("elements", f"{status.enabled} of {status.elements} are logged, {status.entries} values per tick at most"),
        *([("derived", f"{many(status.derived, 'signal')}: `silo derive ls`")] if status.derived else []),
        *_endless(status),
        ("time limit", limit),
        ("memory", f"{status.segment_bytes / 1e6:.1f} MB"),
        ("folder", status.folder),
        ("script", status.script),
        ("process", f"{status.pid}, helper {status.helper_pid}"),
        ("revision", str(status.revision)),
    ]
    show_rows(rows)


def _recording(status: "Status") -> list[tuple[str, str]]:
    """A line of a dead logger: where its recording is."""
    if status.state.value != "dead":
        return []
    if not status.ticks:
        return [("recording", "none: it had logged nothing, or what it logged can't be read")]
    if status.saved:
        return [("recording", f"all {many(status.ticks, 'tick')} stand in files in {status.folder}")]
    return [("recording", f"{_held(status)}, and not all of it is in a file: `silo recover` saves it")]


def _held(status: "Status") -> str:
    return f"the buffers hold {many(status.held_samples, 'sample')} over {duration(status.held_s)}"


def _failed(status: "Status") -> list[tuple[str, str]]:
    """A line where attributes or functions could not be read."""
    if not status.failed:
        return []
    names = ", ".join(f"{name} at {many(count, 'tick')}" for name, count in status.failed_most.items())
    return [("failed", f"{many(status.failed, 'sample')} could not be read: {names}")]


def _endless(status: "Status") -> list[tuple[str, str]]:
    """A line where something is recorded without end."""
    if not status.recorders:
        return []
    return [("recorded", f"{many(status.recorders, 'recording')} under way: `silo record {status.logger} --ls`")]


def _durable(status: "Status") -> list[tuple[str, str]]:
    """A line where there is a journal."""
    if status.durable_ticks < 0:
        return []
    later = max(0, status.ticks - status.durable_ticks)
    return [("durable", f"to tick {status.durable_ticks}; a power cut now would lose {many(later, 'tick')} after it")]


def _show_elements(elements: "list[ElementInfo]") -> None:
    header = ("ELEMENT", "UNIT", "TYPE", "LOG", "DIV", "ACTION", "BUFFER", "SIZE", "DESCRIPTION")
    rows = [
        (
            one.name,
            one.unit,
            type_of(one),
            "on" if one.options.enabled else "off",
            str(one.options.divider),
            one.options.action.name.lower() if not one.expression else "derived",
            one.options.buffer_type.name.lower() if not one.expression else "-",
            str(one.options.buffer_size) if not one.expression else "-",
            one.description,
        )
        for one in elements
    ]
    show_rows([header, *rows], right=(4, 7))


@click.command()
@logger_argument
@unsaved_options
def start(logger: str | None, save_first: bool, discard: bool) -> None:
    """Start logging; the buffers are cleared, which is refused while they hold what is in no file.

    \b
    Examples:
      silo start demo
      silo start demo --save
    """
    chosen = unsaved(save_first=save_first, discard=discard)
    with connect(logger) as client, naming_ways_out("start", client):
        _say_state(client.start(chosen, say_saved))


@click.command()
@logger_argument
def stop(logger: str | None) -> None:
    """Stop logging; the data stays and can be saved. Stopping a stopped logger succeeds.

    \b
    Example:
      silo stop demo
    """
    with connect(logger) as client:
        _say_state(client.stop())


@click.command()
@logger_argument
@unsaved_options
def restart(logger: str | None, save_first: bool, discard: bool) -> None:
    """Stop, and start with empty buffers, which is refused while they hold what is in no file.

    \b
    Examples:
      silo restart demo
      silo restart demo --discard
    """
    chosen = unsaved(save_first=save_first, discard=discard)
    with connect(logger) as client, naming_ways_out("restart", client):
        _say_state(client.restart(chosen, say_saved))


def _say_state(status: "Status") -> None:
    unsaved = status.state.value == "stopped" and status.ticks and not status.saved
    hint = f", not saved (`silo save {status.logger}`)" if unsaved else ""
    click.echo(f"{status.logger}: {status.state.value}, {many(status.ticks, 'tick')}{hint}")


@click.command()
@logger_argument
@types_option
@click.option("-n", "--name", default="", help="File name without ending, instead of LOGGER_DATE_NUMBER.")
@click.option("--timeout", type=click.FloatRange(min=1), default=600.0, show_default=True, help="Wait so long, s.")
@json_option
def save(logger: str | None, types: tuple[str, ...], name: str, timeout: float, as_json: bool) -> None:
    """Save what the buffers hold to files in the logger's folder, while it goes on logging.

    \b
    Examples:
      silo save demo
      silo save demo -t silo -t bag --name first_walk
    """
    chosen = file_types(types)
    with connect(logger) as client, _progress("saving") as progress:
        files = client.wait_saved(client.save(chosen, name), timeout, progress)
    if as_json:
        show_json(files)
        return
    for file in files:
        click.echo(f"{file.path}  {file.size_bytes / 1e6:.1f} MB")


@contextmanager
def _progress(label: str) -> Iterator[Callable[[float], None] | None]:
    """A progress bar on a terminal, nothing else where."""
    if not sys.stderr.isatty():
        yield None
        return
    with click.progressbar(length=1000, label=label, file=sys.stderr) as bar:

        def show(fraction: float) -> None:
            bar.update(int(fraction * 1000) - bar.pos)

        yield show
