"""Runs that dead programs left, in memory or in journals: all of a folder, all of a logger, one that is named."""

import contextlib
import itertools
import logging
from collections.abc import Iterable, Iterator
from pathlib import Path

from silo.core.elements import LoggerOptions
from silo.errors import SiloError
from silo.journal.format import JOURNAL_SUFFIX
from silo.journal.reader import JournalReader
from silo.recovery.journals import claimed_journal, find_stale_journals, is_journal, remove_proven, sweep_journals
from silo.recovery.left import LeftRun, RunReader
from silo.recovery.segments import claimed_segment, find_stale, release_segment, segment_folder, sweep_segments

log = logging.getLogger("silo")


def find_all(folders: Iterable[Path]) -> list[LeftRun]:
    """What processes left that ended without saving: segments, and journals in `folders` whose segments are gone.

    Segments are looked for in the runtime folder too.
    """
    places = list(dict.fromkeys(folder.resolve() for folder in folders))
    segments = [one for folder in places for one in find_stale(folder)]
    journals = [one for folder in places for one in find_stale_journals(folder)]
    return list({one.path: one for one in [*segments, *journals]}.values())


def sweep(options: LoggerOptions) -> None:
    """Remove what dead processes of a logger left that holds no data. Raises SiloError."""
    from silo.files.atomic import sweep_parts  # a program that logs needs no file format

    sweep_segments(segment_folder(options))
    sweep_parts(options.folder)
    sweep_journals(options.folder)


def left_of(options: LoggerOptions) -> Iterator[LeftRun]:
    """Yield what earlier processes of this very logger (its name, its folder) left that is in no file.

    Journals are looked for once all segments are dealt with: one whose segment goes meanwhile is needed from then on.
    Its own runs are none of them: a program that dies while its helper process looks is saved by that, and told once.
    """
    segments = (one for one in find_stale(segment_folder(options), options.name) if one.ticks)
    journals = (one for _ in (0,) for one in find_stale_journals(options.folder, options.name))
    for one in itertools.chain(segments, journals):
        schema = one.schema
        if schema is None or (schema.logger, schema.folder) != (options.name, options.folder):
            continue
        if schema.logger_id != options.id or not options.id:
            yield one


def look_back(options: LoggerOptions, *, served: bool) -> None:
    """Remove what dead processes left that holds no data; without a helper, warn of what predecessors left unsaved.

    For the first start of a logger, which saves nothing: the program waits for it. Its helper process saves it as soon
    as clients can come.
    """
    # a start doesn't fail for what others left; where there is no folder to look into, the start itself says so
    with contextlib.suppress(SiloError, OSError):
        sweep(options)
        for stale in left_of(options) if not served else ():
            held = stale.holdings.text if stale.holdings else ""
            log.warning(
                "an earlier run of logger '%s' ended without close(); it left %s, in no file: "
                "`silo recover %s` saves it, and frees its memory",
                options.name,
                held,
                stale.path,
            )


@contextlib.contextmanager
def claimed_run(path: Path, *, wait: bool = False) -> Iterator[RunReader]:
    """Hold a segment or a journal whose writer is gone for one who saves it; read while it is held.

    Raises SegmentError for what isn't one, or is damaged, StateError while its own process lives, or while its segment
    is there; BusyError while another process holds it (unless it may `wait`), SavedMeanwhileError if one has saved it.
    """
    held = claimed_journal if is_journal(path) or path.suffix == JOURNAL_SUFFIX else claimed_segment
    with held(path, wait=wait) as reader:
        yield reader


def let_go(reader: RunReader) -> None:
    """Delete a run of which all stands in files."""
    if isinstance(reader, JournalReader):
        remove_proven(reader)
    else:
        release_segment(reader)
