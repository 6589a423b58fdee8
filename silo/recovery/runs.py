"""Runs that dead programs left, in memory or in journals: all of a folder, all of a logger, one that is named."""

import contextlib
import itertools
import logging
from collections.abc import Iterable, Iterator
from pathlib import Path

from silo.core.elements import LoggerOptions
from silo.core.runtime import list_segments
from silo.errors import SiloError
from silo.journal.format import JOURNAL_SUFFIX
from silo.journal.reader import JournalReader
from silo.recovery.journals import claimed_journal, is_journal, left_journals, remove_proven, sweep_journals
from silo.recovery.left import LeftRun, RunReader
from silo.recovery.segments import claimed_segment, left_segments, release_segment, segment_folder, sweep_segments
from silo.segment.held_runs import readers

log = logging.getLogger("silo")


def find_all(folders: Iterable[Path]) -> list[LeftRun]:
    """What processes left that ended without saving: segments, and journals in `folders` whose segments are gone.

    Segments are looked for in the runtime folder too.
    """
    places = list(dict.fromkeys(folder.resolve() for folder in folders))
    segments = [one for folder in places for one in left_segments(folder)]
    journals = [one for folder in places for one in left_journals(folder)]
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
    segments = (one for one in left_segments(segment_folder(options), options.name) if one.ticks)
    journals = (one for _ in (0,) for one in left_journals(options.folder, options.name))
    for one in itertools.chain(segments, journals):
        schema = one.schema
        if schema is None or (schema.logger, schema.folder) != (options.name, options.folder):
            continue
        if schema.logger_id != options.id or not options.id:
            yield one


def _beside(options: LoggerOptions) -> list[int]:
    """Return the processes that log now under the name of a logger, into its folder."""
    found = list[int]()
    for reader in readers(list_segments(segment_folder(options)), options.name):
        with contextlib.closing(reader):
            schema = reader.schema
            same = (schema.logger, schema.folder) == (options.name, options.folder)
            if same and schema.logger_id != options.id and reader.alive():
                found.append(schema.pid)
    return sorted(set(found))


def look_back(options: LoggerOptions, *, served: bool) -> None:
    """Remove what dead processes left that holds no data; warn of others that log under this name into this folder.

    Without a helper, warn of what predecessors left unsaved as well.

    For the first start of a logger, which saves nothing: the program waits for it. Its helper process saves it as soon
    as clients can come.
    """
    # a start doesn't fail for what others left; where there is no folder to look into, the start itself says so
    with contextlib.suppress(SiloError, OSError):
        sweep(options)
        for pid in _beside(options):
            log.warning(
                "%s: process %d logs under this name into this folder, too: their files and events stand there side by "
                "side, and `silo` asks which of the two is meant; give each a name of its own",
                options.name,
                pid,
            )
        for left in left_of(options) if not served else ():
            held = left.holdings.text if left.holdings else ""
            log.warning(
                "an earlier run of logger '%s' ended without close(); it left %s, in no file: "
                "`silo recover %s` saves it, and frees its memory",
                options.name,
                held,
                left.path,
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
