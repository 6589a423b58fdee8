"""`silo info`: a logger, its elements, or a saved file."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from silo.cli.common import (
    LogWord,
    complete_words,
    configuration,
    connect,
    json_option,
    logged_for,
    means_saved,
    show_json,
    show_rows,
    split_logger,
    type_of,
)
from silo.core.elements import is_stalled
from silo.core.quantities.writing import duration, idle_words, many, size_text
from silo.errors import ConnectionLostError

if TYPE_CHECKING:
    from silo.core.elements import ElementInfo, Status


@click.command()
@click.argument("words", nargs=-1, type=LogWord(), metavar="[LOGGER] [PATTERN]...", shell_complete=complete_words)
@click.option("-e", "--elements", "all_elements", is_flag=True, help="List all elements.")
@json_option
def info(words: tuple[str, ...], all_elements: bool, as_json: bool) -> None:
    """Show a logger, the elements that match, or what is in a saved file.

    \b
    Examples:
      silo info                              (the only logger)
      silo info demo '*/torque' /log/base    (elements: glob or namespace)
      silo info demo_20260102_10-00-00_00001.silo
      silo info logs                         (the newest run of a folder)
    """
    if len(words) == 1 and means_saved(words[0]):
        from silo.cli.logs.saved_logs import print_file_info

        print_file_info(words[0], as_json)
        return
    if len(words) > 1 and os.path.isfile(words[0]) and means_saved(words[0]):  # noqa: PTH113
        raise click.UsageError(f"one file at a time: silo info {words[0]}; of its signals `silo stats FILE NAME`")
    logger, patterns = split_logger(words)
    with _telling_what_was_left(logger), connect(logger) as client:
        status, label = client.status(), client.found.label
        table = client.table() if patterns or all_elements or as_json or status.max_time_s else None
        limit = _limit_words(table.elements if table else [], status.max_time_s)
        elements = [*table.elements, *table.derived] if table and (patterns or all_elements or as_json) else []
    if patterns:
        from silo.cli.edits import of_entries, select

        patterns, told = of_entries(elements, patterns)
        for text in told:
            click.echo(text, err=True)
        elements = [elements[place] for place in select([e.name for e in elements], patterns, status.prefix)]
    if as_json:
        show_json({"status": status, "elements": elements})
        return
    if not patterns:
        _show_status(status, label, limit)
    if elements:
        _show_elements(elements)


@contextmanager
def _telling_what_was_left(logger: str | None) -> Iterator[None]:
    """Where no logger is found, say which recordings dead ones left in memory, and how they are saved."""
    try:
        yield
    except ConnectionLostError as error:
        from silo.core.runtime import orphaned_segments

        if configuration() or not orphaned_segments():
            raise
        from silo.recovery.segments import left_segments

        left = [
            f"logger '{one.schema.logger}' died: {one.reason}; it held {one.holdings.text}: `silo recover` saves it"
            for one in left_segments()
            if one.schema and one.holdings and logger in (None, one.schema.logger)
        ]
        raise ConnectionLostError("\n".join([str(error), *left])) from error


def _show_status(status: "Status", label: str, limit: str) -> None:
    since, most, ticks = logged_for(status), status.held_bytes_most, status.durable_ticks
    failed = ", ".join(f"{name} at {many(count, 'tick')}" for name, count in status.failed_most.items())
    unheld = ", ".join(f"{name} (seen at tick {tick})" for name, tick in status.unheld.items())
    held = f"{many(status.held_runs, 'earlier run')}, {size_text(status.held_bytes)}"
    held += f", of at most {status.held_runs_most} runs, {most / 1e6:.0f} MB"
    later = many(max(0, status.ticks - ticks), "tick")
    logged = f"{many(status.run_ticks, 'tick')}{f' in {since}' if since != '-' else ''}"
    logged += f", not saved ({_held(status)})" if status.run_ticks and not status.saved else ""
    elements = f"{status.enabled} of {status.elements} are logged, {status.entries} values per tick at most"
    recorded = f"{many(status.recorders, 'recording')} under way: `silo record {label} --ls`"
    rows = [  # whether it is told, what it is, the words
        (True, "logger", f"{status.logger} on {status.host}, user {status.user}"),
        (True, "state", f"{status.state.value}{f' ({status.reason})' if status.reason else ''}{_stalled(status)}"),
        (status.state.value == "dead", "recording", _recording(status)),
        (True, "frequency", f"{status.frequency_hz:g} Hz{_measured(status)}"),
        (True, "logged", logged),
        (True, "lost", f"{many(status.lost, 'sample')}"),
        (status.failed, "failed", f"{many(status.failed, 'sample')} could not be read: {failed}"),
        (status.unheld, "unheld", f"nobody but silo holds the array any more, its values stay: {unheld}"),
        (ticks >= 0, "durable", f"to tick {ticks}; a power cut now would lose {later} after it"),
        (True, "elements", elements),
        (status.derived, "derived", f"{many(status.derived, 'signal')}: `silo derive ls`"),
        (status.recorders, "recorded", recorded),
        (True, "time limit", limit),
        (True, "memory", size_text(status.segment_bytes)),
        (most, "held", held),
        (True, "folder", status.folder),
        (True, "script", status.script),
        (True, "process", f"{status.pid}, helper {status.helper_pid}"),
        (True, "revision", str(status.revision)),
    ]
    show_rows([words for told, *words in rows if told])


def _limit_words(elements: "Sequence[ElementInfo]", limit_s: float) -> str:
    """What is said of `max_time`: also where it ends nothing, as buffers are."""
    if not limit_s:
        return "none"
    from silo.segment.retention import ending_by_time, kept_how

    kept = kept_how(elements)
    if ending_by_time(kept, limit_s):
        return f"{limit_s:g} s"
    alike = f"all buffers are {min(kept.values()).name.lower()}" if kept else "nothing is logged"
    return f"{limit_s:g} s, which ends nothing now: {alike}"


def _stalled(status: "Status") -> str:
    """What is said of a logger that runs and doesn't tick."""
    if not is_stalled(status.idle_s, status.frequency_hz):
        return ""
    return f", {idle_words(status.idle_s)}: its program is frozen, or doesn't call collect()"


def _measured(status: "Status") -> str:
    """How fast it really ticks, while it runs."""
    if status.state.value != "running":
        return ""
    idle = is_stalled(status.idle_s, status.frequency_hz)
    hz = 0.0 if idle else status.measured_hz
    return f", measured {hz:.4g} Hz" if idle or hz else ", not measured yet"


def _recording(status: "Status") -> str:
    """Where the recording of a dead logger is."""
    if not status.run_ticks:
        return "none: it had logged nothing, or what it logged can't be read"
    if status.saved:
        ticks = many(status.run_ticks, "tick")
        return f"all that the buffers held of its {ticks} stands in files in {status.folder}"
    return f"{_held(status)}, and not all of it is in a file: `silo recover` saves it"


def _held(status: "Status") -> str:
    return f"the buffers hold {many(status.held_samples, 'sample')} of up to {duration(status.held_s)}"


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
            one.options.buffer.name.lower() if not one.expression else "-",
            str(one.options.size) if not one.expression else "-",
            one.description,
        )
        for one in elements
    ]
    show_rows([header, *rows], right=(4, 7))
