"""The index of a folder: an SQLite file that can be thrown away at any time, as it is made from the logs alone.

A log counts as known while its size and time of change are what they were. Several processes may bring it up to date
at once: each log is one short transaction. Where the folder can't be written, the index is in memory.
"""

import functools
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

import msgspec
import numpy as np

from silo.core.names import grouped
from silo.core.runtime import open_own
from silo.decoding import json_decoder, msgpack_decoder
from silo.errors import SiloError, reason
from silo.run_index.facts import NUMBERS, EventFacts, RunFacts, SignalFacts, read_facts, signal_facts
from silo.run_index.finding import NAME, There, logs_below

VERSION = 10
PATIENCE_S = 30.0
TOGETHER = 200  # logs whose facts are one transaction

Told = Callable[[int, int], None]
_TABLES = """
CREATE TABLE run (id INTEGER PRIMARY KEY, path TEXT UNIQUE, size INTEGER, changed INTEGER, facts BLOB, others BLOB);
CREATE TABLE signal (name TEXT, run INTEGER, element TEXT, unit TEXT, count INTEGER, least REAL,
    most REAL, mean REAL, std REAL, rms REAL, last REAL, kind TEXT, labels TEXT, PRIMARY KEY (name, run)) WITHOUT ROWID;
CREATE INDEX signal_of_run ON signal (run);
CREATE TABLE part (name TEXT, run INTEGER, numbers BLOB, PRIMARY KEY (name, run)) WITHOUT ROWID;
CREATE INDEX part_of_run ON part (run);
CREATE TABLE event (run INTEGER, at REAL, tick INTEGER, time INTEGER, kind TEXT, text TEXT, who TEXT);
CREATE INDEX event_of_run ON event (run);
"""
_TABLES_OF_A_RUN = ("signal", "part", "event")
_OF_RUNS = "SELECT run.path, signal.* FROM signal JOIN run ON run.id = signal.run"
_OF_EPISODES = (
    "SELECT run.path, part.numbers, signal.name, signal.element, signal.unit, signal.kind, signal.labels"
    " FROM part JOIN signal USING (name, run) JOIN run ON run.id = part.run"
)
_EVENTS = "SELECT run.path, event.* FROM event JOIN run ON run.id = event.run ORDER BY event.rowid"
_ENCODE, _DECODE = msgspec.msgpack.Encoder().encode, msgpack_decoder(RunFacts).decode


P = ParamSpec("P")
Found = TypeVar("Found")


def _in_words(ask: "Callable[Concatenate[RunIndex, P], Found]") -> "Callable[Concatenate[RunIndex, P], Found]":
    """Have SiloError raised where the file can't be used; one that is damaged goes, as it can be made anew."""

    @functools.wraps(ask)
    def asked(index: "RunIndex", /, *args: P.args, **kwargs: P.kwargs) -> Found:
        try:
            return ask(index, *args, **kwargs)
        except sqlite3.ProgrammingError:
            raise  # asked by another thread, or behind its end: nothing is wrong with the file
        except (sqlite3.DatabaseError, msgspec.MsgspecError) as error:
            file = index.root / NAME
            # else a full disk, or a long wait
            if isinstance(error, sqlite3.OperationalError) and "decode" not in str(error):
                raise SiloError(f"the index '{file}' can't be used now: {error}; try again") from error
            if index.kept:
                file.unlink(missing_ok=True)
            raise SiloError(
                f"the index '{file}' was damaged ({error}), and is removed: try again, it is made anew from the logs"
            ) from error

    return asked


class RunIndex:
    """The index of one folder. Every method may raise SiloError, where its file can't be used."""

    def __init__(self, root: Path) -> None:
        """Open it, or make it anew. Raises SiloError where there is no such folder."""
        if not root.is_dir():
            raise SiloError(f"there is no folder '{root}'")
        self.root = root
        self.unfit: list[str] = []  # names of logs that it can't have
        file = root / NAME
        self.kept = os.access(file if file.exists() else root, os.W_OK) and _is_own(file)
        try:
            self._database = self._opened(file if self.kept else ":memory:")
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):  # it can't be written here
                self.kept = False
                self._database = self._opened(":memory:")
            else:  # damaged
                file.unlink(missing_ok=True)
                self._database = self._opened(file)

    def close(self) -> None:
        """Let go of the file."""
        self._database.close()

    @_in_words
    def refresh(self, told: Told = lambda done, total: None, *, anew: bool = False) -> None:
        """Bring it up to date with the folder; `told` is called with how many of how many logs were read.

        Raises SiloError where the folder can't be read.
        """
        try:
            self.unfit.clear()
            there = logs_below(self.root, self.unfit)
        except OSError as error:
            raise SiloError(f"'{self.root}' can't be read: {reason(error)}") from error
        rows = [] if anew else self._database.execute("SELECT path, size, changed, others FROM run").fetchall()
        known = {path: (size, changed) for path, size, changed, _ in rows}
        self._follow(rows, known, there)
        gone = [path for path in known if path not in there]
        if anew or gone:
            with self._database as database:
                if anew:
                    for table in (*_TABLES_OF_A_RUN, "run"):
                        database.execute(f"DELETE FROM {table}")
                self._forget(database, gone)
        new = [path for path, log in there.items() if known.get(path) != log[:2]]
        for begin in range(0, len(new), TOGETHER):
            some = new[begin : begin + TOGETHER]
            found = []
            for place, path in enumerate(some):
                told(begin + place, len(new))
                found.append((path, there[path], read_facts(self.root, path, there[path].size_bytes)))
            with self._database as database:
                self._forget(database, some)
                for path, log, facts in found:
                    run = database.execute(
                        "INSERT INTO run (path, size, changed, facts, others) VALUES (?, ?, ?, ?, ?)",
                        (path, *log[:2], _ENCODE(facts.run), _ENCODE(log.others)),
                    ).lastrowid
                    database.executemany(
                        f"INSERT OR IGNORE INTO signal VALUES ({', '.join('?' * 13)})",
                        [
                            (one.name, run, *msgspec.structs.astuple(one)[1:-1], _text_of(one.labels))
                            for one in facts.signals
                        ],
                    )
                    database.executemany(
                        "INSERT OR IGNORE INTO part VALUES (?, ?, ?)",
                        [(one.name, run, part.tobytes()) for one, part in zip(facts.signals, facts.parts, strict=True)
                         if part.size],
                    )  # fmt: skip
                    database.executemany(
                        f"INSERT INTO event VALUES ({', '.join('?' * 7)})",
                        [(run, *msgspec.structs.astuple(one)) for one in facts.events],
                    )

    def _follow(
        self, rows: Sequence[tuple[str, int, int, bytes]], known: dict[str, tuple[int, int]], there: dict[str, There]
    ) -> None:
        """Let runs have the name of another format that was there when they were read, where theirs is gone."""
        for path, _, _, others in rows:
            if path in there:
                continue
            for name, size, changed in msgpack_decoder(list[tuple[str, int, int]]).decode(others):
                if name not in known and name in there and there[name][:2] == (size, changed):
                    with self._database as database:
                        # another process may be ahead: of rows that are gone or there already nothing comes
                        for (facts,) in database.execute("SELECT facts FROM run WHERE path = ?", (path,)).fetchall():
                            told = msgspec.structs.replace(_DECODE(facts), path=name, size_bytes=size)
                            database.execute(
                                "UPDATE OR IGNORE run SET path = ?, size = ?, changed = ?, facts = ? WHERE path = ?",
                                (name, size, changed, _ENCODE(told), path),
                            )
                    known[name] = (size, changed)
                    del known[path]
                    break

    @_in_words
    def runs(self) -> list[RunFacts]:
        """Return all runs."""
        return [_DECODE(facts) for (facts,) in self._database.execute("SELECT facts FROM run")]

    @_in_words
    def elements(self) -> dict[str, list[str]]:
        """Return the elements that any run has, and the scalars of each."""
        return grouped(self._database.execute("SELECT DISTINCT element, name FROM signal"))

    @_in_words
    def words(self) -> dict[str, set[str]]:
        """Return the words of enumerations that any run has, by their elements."""
        found: dict[str, set[str]] = {}
        for element, words in self._database.execute("SELECT DISTINCT element, labels FROM signal WHERE labels <> ''"):
            found.setdefault(element, set()).update(_labels(words).values())
        return found

    @_in_words
    def signals(self, names: Sequence[str] | None = None) -> dict[str, list[SignalFacts]]:
        """Return the facts of scalars by the path of their run: its number is another one once it was read anew.

        Of all scalars without names.
        """
        rows = self._rows(_OF_RUNS, names)
        return grouped((path, SignalFacts(*(name, *rest, _labels(words)))) for path, name, _, *rest, words in rows)

    @_in_words
    def signals_of_episodes(self, names: Sequence[str] | None = None) -> dict[tuple[str, int], list[SignalFacts]]:
        """Return the facts of scalars by the path of their run and the number of the episode in it."""
        found: dict[tuple[str, int], list[SignalFacts]] = {}
        for path, blob, name, element, unit, kind, words in self._rows(_OF_EPISODES, names):
            labels = _labels(words)
            for number, numbers in enumerate(_parts(blob)):
                found.setdefault((path, number), []).append(signal_facts(name, element, unit, numbers, kind, labels))
        return found

    @_in_words
    def of_run(self, path: str, episode: int | None = None) -> list[SignalFacts]:
        """Return the facts of all scalars of a run, or of one of its episodes, by name."""
        if episode is None:
            rows = self._database.execute(f"{_OF_RUNS} WHERE path = ? ORDER BY name", (path,))
            return [SignalFacts(*(name, *rest, _labels(words))) for _, name, _, *rest, words in rows]
        rows = self._database.execute(f"{_OF_EPISODES} WHERE path = ? ORDER BY name", (path,))
        return [signal_facts(name, element, unit, _parts(blob)[episode], kind, _labels(words))
                for _, blob, name, element, unit, kind, words in rows]  # fmt: skip

    def _rows(self, query: str, names: Sequence[str] | None) -> Iterator[tuple[Any, ...]]:
        if names is None:
            yield from self._database.execute(query)
            return
        for begin in range(0, len(names), 500):
            some = names[begin : begin + 500]
            yield from self._database.execute(f"{query} WHERE name IN ({', '.join('?' * len(some))})", some)

    @_in_words
    def events(self) -> dict[str, list[EventFacts]]:
        """Return what happened by the path of the run, in its order there."""
        return grouped((path, EventFacts(*rest)) for path, _, *rest in self._database.execute(_EVENTS))

    def _opened(self, path: Path | str) -> sqlite3.Connection:
        database = sqlite3.connect(path, timeout=PATIENCE_S, check_same_thread=False)
        try:
            if _version(database) != VERSION:
                with database:
                    database.execute("BEGIN IMMEDIATE")
                    if _version(database) != VERSION:  # another one may have made it meanwhile
                        for table in (*_TABLES_OF_A_RUN, "run"):
                            database.execute(f"DROP TABLE IF EXISTS {table}")
                        for statement in _TABLES.split(";\n"):
                            database.execute(statement)
                        database.execute(f"PRAGMA user_version = {VERSION}")
        except sqlite3.Error:
            database.close()
            raise
        return database

    @staticmethod
    def _forget(database: sqlite3.Connection, paths: Iterable[str]) -> None:
        for path in paths:
            for table in _TABLES_OF_A_RUN:
                database.execute(f"DELETE FROM {table} WHERE run IN (SELECT id FROM run WHERE path = ?)", (path,))
            database.execute("DELETE FROM run WHERE path = ?", (path,))


def _parts(blob: bytes) -> list[list[float]]:
    numbers: list[list[float]] = np.frombuffer(blob).reshape(-1, len(NUMBERS)).tolist()
    return numbers


def _text_of(labels: Mapping[int, str]) -> str:
    return msgspec.json.encode(labels).decode() if labels else ""


def _labels(text: str) -> dict[int, str]:
    return json_decoder(dict[int, str]).decode(text) if text else {}


def _is_own(file: Path) -> bool:
    """Whether the index is a file of its own, or can be made: not where somebody planted a link."""
    try:
        os.close(open_own(file, os.O_RDWR | os.O_CREAT, 0o644))
    except OSError:
        return False
    return True


def _version(database: sqlite3.Connection) -> int:
    (version,) = database.execute("PRAGMA user_version").fetchone()
    return int(version)
