"""An archive of runs: Parquet by robot, date and run, on a disk or in object storage, for whatever reads Parquet.

    wide/robot=anymal/date=2026-11-22/run=walk.silo/run.parquet    a row per tick, a column per scalar
    runs.parquet, signals.parquet, events.parquet ...              the tables of `silo query`
    facts/walk_part1.silo.msgpack, parts.json                      of runs in several files: of each, and which are one
    manifest/walk.silo.json                                        what was archived: sizes, SHA-256; written last

silo opens the Parquet files like any log. Each file of a run in several is archived by itself, and they are one run in
the tables.

A run is in the archive from when its manifest is. What was interrupted before that is done again, what is in it is not
touched; the tables follow at the end. One process at a time writes it, where the place knows locks (a store doesn't).
"""

import hashlib
import json
import os
import socket
import tempfile
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import msgspec

from silo.analysis.stretches import joined
from silo.core.recording import Recording, has_own_stamps
from silo.decoding import json_decoder, msgpack_decoder
from silo.errors import ElementError, FileFormatError, LogNotFoundError, SaveError, SiloError, reason
from silo.files.atomic import PART_ENDING, atomic_file, lock, sweep_parts
from silo.files.formats import writer_for
from silo.files.optional_packages import need
from silo.files.tables.parquet import read_parquet
from silo.run_index.facts import RunFacts
from silo.run_index.index import RunIndex, Told
from silo.run_index.labels import Labels
from silo.run_index.listed import ArchivedFacts, KnownFiles, ListedRun
from silo.run_index.runs import RunList
from silo.run_index.tables import COLUMNS, FACTS, HIVE, Folders, read_signals, typed

EXTRA = "archive"
MARK = "silo-archive.json"
PARTS = "parts.json"
VERSION = 1
_LOCK = ".silo-archive.lock"
_BLOCK = 1 << 20
LONGEST_PART = 200  # bytes of a file's name, without what it begins and ends with


class Archived(msgspec.Struct, frozen=True):
    """The manifest of a file. source: the folder that it is from, with its computer. chain: what other files of its run
    have in common with it, empty where it is a run by itself.
    """

    run: str
    file: str
    bytes: int
    sha256: str
    source: str
    source_bytes: int
    source_changed_ns: int
    chain: str = ""


@dataclass
class Archiving:
    """What became of runs: `problems` are those that are not in the archive, with the reason."""

    added: list[str] = field(default_factory=list)
    kept: int = 0
    bytes: int = 0
    problems: dict[str, str] = field(default_factory=dict)


class Parts(msgspec.Struct, frozen=True):
    """Names in the archive: the files of a run, in their order, and other ones of which these have more."""

    files: tuple[str, ...]
    others: tuple[str, ...] = ()


def chain_of(facts: RunFacts) -> str:
    """What files of one run have in common; empty for one that is a run by itself."""
    return f"{facts.robot}/{facts.run}/{facts.recorder}" if facts.run and (facts.part or facts.recorder) else ""


def known_files(runs: Mapping[str, ListedRun], indexes: Sequence[RunIndex | KnownFiles]) -> dict[str, ArchivedFacts]:
    """Return what indexes know of files, by their names in an archive."""
    if not runs:
        return {}
    signals = {index.root: index.signals() for index in indexes}
    episodes = {index.root: index.signals_of_episodes() for index in indexes}
    events = {index.root: index.events() for index in indexes}
    return {
        name: ArchivedFacts(
            msgspec.structs.replace(run.facts, path=name),
            tuple(signals[run.folder].get(run.facts.path, ())),
            tuple(tuple(episodes[run.folder].get((run.facts.path, at), ())) for at in range(len(run.facts.episodes))),
            tuple(events[run.folder].get(run.facts.path, ())),
            Labels(run.tags, run.notes),
        )
        for name, run in runs.items()
    }


class Archive:
    """An archive at a path or URL (`s3://bucket/runs`), read and written by fsspec."""

    def __init__(self, where: str) -> None:
        """Open it. Raises SiloError without fsspec, ElementError for a URL with a password in it."""
        if "@" in urlsplit(where).netloc:
            raise ElementError("a URL of an archive holds no user and no password: they belong into the environment")
        with _told(where):
            self._files, self._root = need("fsspec.core", EXTRA, "Archives").url_to_fs(where)
        self.where = where
        self._listed: list[Archived] | None = None
        self._several: dict[str, Parts] | None = None
        self._is_local = "file" in (protocol := self._files.protocol) or protocol == "file"

    @property
    def exists(self) -> bool:
        """Whether there is one."""
        with _told(self.where):
            return bool(self._files.exists(self._at(MARK)))

    def add(self, runs: RunList, told: Told = lambda done, total: None, name: str = "") -> Archiving:
        """Put runs into it; those that are in it as they are now stay.

        Args:
            runs: which.
            told: called with how many of how many were looked at.
            name: what their names begin with in the archive, for runs of several computers.

        Returns:
            What became of each.

        Raises:
            SaveError: the archive can't be written.
            SiloError: it is of a newer silo, or pyarrow is missing.
        """
        need("pyarrow", EXTRA, "Archives")
        self._check(anew=True)
        with self._alone():
            return self._add_all(runs, told, name)

    def _add_all(self, runs: RunList, told: Told, name: str) -> Archiving:
        self._listed = self._several = None
        self._sweep()
        known, outcome = {one.run: one for one in self.manifest()}, Archiving()
        runs = runs.by_file()  # each file is one by itself: of a run that goes on more are added, and old ones deleted
        source = Folders(runs, runs.indexes)
        for place, (key, run) in enumerate(source.runs.items()):
            told(place, len(runs))
            called = _called(key, name)
            try:
                self._add(called, run, known.get(called), outcome)
            except (FileFormatError, LogNotFoundError, ElementError, MemoryError) as error:
                outcome.problems[called] = str(error) or type(error).__name__
        self._write_tables(source, name, outcome.problems)
        outcome.problems |= self._not_in_tables()
        return outcome

    def manifest(self) -> list[Archived]:
        """Return what is in it, by name. Raises FileFormatError for a manifest that can't be read."""
        with _told(self.where):
            # beside them may lie what somebody is writing
            names = sorted(name for name in self._files.find(self._at("manifest")) if name.endswith(".json"))
            texts = self._texts(names)
        try:
            return [json_decoder(Archived).decode(text) for _, text in sorted(texts.items())]
        except msgspec.DecodeError as error:
            raise FileFormatError(
                f"'{self.where}' has a damaged manifest: {error}; remove it and archive again"
            ) from error

    def check(self, told: Told = lambda done, total: None) -> dict[str, str]:
        """Read all of it again; return what is not as its manifest says, or not in the tables, by its name."""
        self._check()
        with self._alone():
            self._several = None
            return self._not_in_tables() | self._changed(told)

    def _changed(self, told: Told) -> dict[str, str]:
        wrong = {}
        for place, one in enumerate(every := self.manifest()):
            told(place, len(every))
            try:
                with _told(self.where), self._files.open(self._at(one.file)) as file:
                    if _sha256(file) != one.sha256:
                        wrong[one.run] = "it isn't what was archived"
            except SiloError as error:
                wrong[one.run] = str(error)
        return wrong

    def frame(self, table: str) -> Any:
        """Return a table of facts as a polars frame."""
        polars = need("polars", EXTRA, "Archives")
        self._check()
        with _told(self.where):
            if not self._files.exists(self._at(f"{table}.parquet")):
                return polars.DataFrame(schema=typed(COLUMNS[table]))
            with self._files.open(self._at(f"{table}.parquet")) as file:
                return polars.read_parquet(file.read())

    def read(self, run: str, signals: Sequence[str]) -> Any:
        """Return signals of a run, as `Drawer.read` does. Raises ElementError for a run that isn't here any more."""
        files = self._parts().get(run, Parts((run,))).files
        entries = [one for name in files for one in self._known() if one.run == name]
        if len(entries) < len(files):
            raise ElementError(f"'{self.where}' has no run '{run}': ask again, the archive changed meanwhile")
        with _told(self.where), ExitStack() as opened:
            paths = [self._at(one.file) for one in entries]
            sources = [opened.enter_context(self._files.open(path)) for path in paths]
            recordings = [read_parquet(Path(path), source) for path, source in zip(paths, sources, strict=True)]
            return read_signals(joined(recordings) if len(recordings) > 1 else recordings[0], signals)

    def sql(self, statement: str) -> Any:
        """Answer an SQL statement, as `RunList.sql` does; here the runs are those of the archive."""
        from silo.run_index.sql import query

        return query(self, statement)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Have no other process write here meanwhile, where there are locks."""
        with ExitStack() as held:
            if self._is_local and os.access(self._root, os.W_OK):
                with _told(self.where):
                    lock(held.enter_context(Path(self._at(_LOCK)).open("ab")).fileno())
            yield

    def _not_in_tables(self) -> dict[str, str]:
        """The files of which the tables lack the run, or its signals."""
        runs, signals = self.frame("runs"), set(self.frame("signals")["run"])
        whole = {run for run, elements in runs.select("run", "elements").iter_rows() if not elements or run in signals}
        whole = whole.union(*((*of.files, *of.others) for run, of in self._parts().items() if run in whole))
        return {
            one.run: f"it is in the archive, but not in its tables: archive it again, from {one.source}"
            for one in self.manifest()
            if one.run not in whole
        }

    def _sweep(self) -> None:
        """Remove what was being written here by processes that died."""
        for folder, _, names in os.walk(self._root) if self._is_local else ():
            if any(name.endswith(PART_ENDING) for name in names):
                sweep_parts(folder)

    def _known(self) -> list[Archived]:
        if self._listed is None:
            self._listed = self.manifest()
        return self._listed

    def _add(self, name: str, run: ListedRun, before: Archived | None, outcome: Archiving) -> None:
        if run.facts.problem:
            raise FileFormatError(run.facts.problem)
        source, about = f"{socket.gethostname()}:{run.folder.absolute()}", run.path.stat()
        size, changed_ns = run.facts.size_bytes, about.st_mtime_ns
        if before is not None:
            if (before.source_bytes, before.source_changed_ns) == (size, changed_ns):
                outcome.kept += 1
                if before.chain != chain_of(run.facts):  # of a silo that knew of none
                    self._write_manifest(msgspec.structs.replace(before, chain=chain_of(run.facts)))
                return
            if before.source != source:
                raise ElementError(
                    f"a run of this name was archived from {before.source}; give these another one (--as)"
                )
        recording = run.read()
        if has_own_stamps(recording):
            raise ElementError(
                "each of its topics has times of its own: convert it at a rate first (silo convert --rate)"
            )
        day = datetime.fromtimestamp(run.facts.begun_ns * 1e-9, timezone.utc).date()
        file = f"wide/robot={_part(run.facts.robot or 'none')}/date={day}/run={_part(name)}/run.parquet"
        written, digest = self._put(recording, file)
        self._write_manifest(Archived(name, file, written, digest, source, size, changed_ns, chain_of(run.facts)))
        if before is not None and before.file != file:
            with _told(self.where):
                self._files.rm(self._at(before.file))
        outcome.added.append(name)
        outcome.bytes += written

    def _write_manifest(self, made: Archived) -> None:
        self._write(f"manifest/{_part(made.run)}.json", msgspec.json.format(msgspec.json.encode(made)))

    def _put(self, recording: Recording, file: str) -> tuple[int, str]:
        """Write a run; return its size and what it sums up to."""
        prefix = f"{recording.prefix.rstrip('/')}/"
        with self._local(file) as path:
            writer_for(path)(recording, path, None, without=prefix, taken=HIVE)
            with path.open("rb") as written:
                digest = _sha256(written)
            return path.stat().st_size, digest

    @contextmanager
    def _local(self, file: str) -> Iterator[Path]:
        """A path to write a file at, which is in the archive afterwards."""
        target = self._at(file)
        with _told(self.where):
            if self._is_local:
                Path(target).parent.mkdir(parents=True, exist_ok=True)
                yield Path(target)
                return
            with tempfile.TemporaryDirectory(prefix="silo-archive-") as folder:
                path = Path(folder, file.rpartition("/")[2])
                yield path
                self._files.put_file(str(path), target)

    def _write(self, file: str, data: bytes) -> None:
        with self._local(file) as path, atomic_file(path) as out:
            out.write(data)

    def _write_tables(self, source: Folders, name: str, refused: Container[str]) -> None:
        """Bring the tables of facts up to date: rows of runs that are there now take the place of those of before."""
        polars = need("polars", EXTRA, "Archives")
        run = polars.col("run")
        self._listed = self._several = None
        there = {one.run: one for one in self.manifest()}
        runs = {
            called: run
            for key, run in source.runs.items()
            if (called := _called(key, name)) in there and called not in refused
        }
        files = self._files_of_runs(runs, source.indexes, there)
        known, parts = KnownFiles(list(files.values())), self._parts()
        joined_runs = Folders(known.runs(), [known])
        parts = {one: some for one, some in parts.items() if not files.keys() & {*some.files, *some.others}}
        for one in joined_runs.runs.values():
            if one.files or one.others:
                parts[one.facts.path] = Parts(tuple(one.paths), tuple(one.others))
        self._write(PARTS, msgspec.json.format(msgspec.json.encode(parts)))
        self._several = None
        for table in FACTS:
            rows = source.frame(table).with_columns(run.map_elements(partial(_called, name=name), polars.String))
            old = self.frame(table).filter(~run.is_in([*runs, *files]) & run.is_in(list(there)))
            alone = rows.filter(run.is_in(list(runs)) & ~run.is_in(list(files)))
            frame = polars.concat([old, alone, joined_runs.frame(table)], how="diagonal")
            with self._local(f"{table}.parquet") as path, atomic_file(path) as out:
                frame.write_parquet(out)

    def _files_of_runs(
        self, runs: Mapping[str, ListedRun], indexes: Sequence[RunIndex | KnownFiles], there: Mapping[str, Archived]
    ) -> dict[str, ArchivedFacts]:
        """What is known of the archived files of runs in several, of which one is among these; it is kept here."""
        found = known_files({one: run for one, run in runs.items() if chain_of(run.facts)}, indexes)
        chains = {there[one].chain for one in found}
        kept = [one.run for one in there.values() if one.chain in chains]
        names = {f"{_part(one)}.msgpack": one for one in kept}
        with _told(self.where):
            paths = [path for path in (self._at(f"facts/{file}") for file in names) if self._files.exists(path)]
            stored = self._texts(paths)
        texts = {names[path.rpartition("/")[2]]: text for path, text in stored.items()}
        # JSON has no infinite numbers, which statistics may be
        before = {one: self._decoded(msgpack_decoder(ArchivedFacts).decode, text, one) for one, text in texts.items()}
        for one, facts in found.items():
            if before.get(one) != facts:
                self._write(f"facts/{_part(one)}.msgpack", msgspec.msgpack.encode(facts))
        return {**before, **found}

    def _parts(self) -> dict[str, Parts]:
        """The runs in several files, by their names."""
        if self._several is None:
            with _told(self.where):
                there = self._files.exists(self._at(PARTS))
                text = self._files.cat_file(self._at(PARTS)) if there else b"{}"
            self._several = self._decoded(json_decoder(dict[str, Parts]).decode, text, PARTS)
        return self._several

    def _decoded(self, decode: Callable[[bytes], Any], text: bytes, what: str) -> Any:
        try:
            return decode(text)
        except msgspec.DecodeError as error:
            raise FileFormatError(
                f"'{self.where}' has damaged facts of '{what}': {error}; remove them and archive again"
            ) from error

    def _check(self, anew: bool = False) -> None:
        """Raise SiloError where this is no archive, or one of a newer silo; make it where it is to be made anew."""
        if not self.exists:
            if not anew:
                raise LogNotFoundError(
                    f"there is no archive at '{self.where}'; `silo archive FOLDER {self.where}` makes one"
                )
            self._write(MARK, json.dumps({"version": VERSION}).encode())
            return
        with _told(self.where):
            version = json.loads(self._files.cat_file(self._at(MARK))).get("version")
        if version != VERSION:
            raise SiloError(
                f"'{self.where}' is an archive of version {version}, this silo knows {VERSION}: install a newer one"
            )

    def _texts(self, paths: Sequence[str]) -> dict[str, bytes]:
        """What stands in some files, by their paths: all at once where none reads as a glob, as `logs [2026]` does."""
        if len(paths) > 1 and not set(self._root) & set("*?["):
            return dict(self._files.cat(list(paths)))
        return {path: self._files.cat_file(path) for path in paths}

    def _at(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}"


def _called(run: str, name: str) -> str:
    return f"{name}/{run}" if name else run


def _part(name: str) -> str:
    """A name as one part of a path, as partitions are named; of a long one what it begins with, and what it sums to."""
    quoted = partial(quote, safe=" ._-+,()")
    if len(told := quoted(name)) <= LONGEST_PART:
        return told
    room = LONGEST_PART - 25
    begin = next(begun for end in range(room, -1, -1) if len(begun := quoted(name[:end])) <= room)
    return f"{begin}-{hashlib.sha256(name.encode()).hexdigest()[:24]}"


def _sha256(file: Any) -> str:
    found = hashlib.sha256()
    while block := file.read(_BLOCK):
        found.update(block)
    return found.hexdigest()


@contextmanager
def _told(where: str) -> Iterator[None]:
    """Turn what a file system says into an error of silo."""
    try:
        yield
    except SiloError:
        raise
    except FileNotFoundError as error:
        raise LogNotFoundError(f"the archive '{where}' lacks '{error.filename or error}'") from error
    except Exception as error:  # each file system has its own
        words = reason(error)
        raise SaveError(f"the archive '{where}' can't be reached: {words}") from error
