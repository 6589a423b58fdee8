"""The index of a folder: an SQLite file that can be thrown away at any time, as it is made from the logs alone.

A log counts as known while its size and time of change are what they were. Several processes may bring it up to date
at once: each log is one short transaction. Where the folder can't be written, the index is in memory.
"""

import os
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import msgspec

from silo.errors import SiloError
from silo.files.atomic import reason
from silo.run_index.facts import RunFacts, SignalFacts, read_facts
from silo.run_index.finding import There, logs_below

NAME = ".silo-runs.sqlite"
VERSION = 1
PATIENCE_S = 30.0
TOGETHER = 200  # logs whose facts are one transaction

Told = Callable[[int, int], None]
_TABLES = """
CREATE TABLE IF NOT EXISTS run (id INTEGER PRIMARY KEY, path TEXT UNIQUE, size INTEGER, changed INTEGER, facts BLOB);
CREATE TABLE IF NOT EXISTS signal (name TEXT, run INTEGER, element TEXT, unit TEXT, count INTEGER, least REAL,
    most REAL, mean REAL, std REAL, rms REAL, last REAL, PRIMARY KEY (name, run)) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS signal_of_run ON signal (run);
"""
_OF_RUNS = "SELECT run.path, signal.* FROM signal JOIN run ON run.id = signal.run"
_ENCODE, _DECODE = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RunFacts).decode


class RunIndex:
    """The index of one folder."""

    def __init__(self, root: Path) -> None:
        """Open it, or make it anew. Raises SiloError where there is no such folder."""
        if not root.is_dir():
            raise SiloError(f"there is no folder '{root}'")
        self.root = root
        file = root / NAME
        self.kept = os.access(file if file.exists() else root, os.W_OK)
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

    def refresh(self, told: Told = lambda done, total: None, *, anew: bool = False) -> None:
        """Bring it up to date with the folder; `told` is called with how many of how many logs were read.

        Raises SiloError where the folder can't be read.
        """
        try:
            there = logs_below(self.root)
        except OSError as error:
            raise SiloError(f"'{self.root}' can't be read: {reason(error)}") from error
        rows = [] if anew else self._database.execute("SELECT path, size, changed FROM run").fetchall()
        known = {path: There(size, changed) for path, size, changed in rows}
        gone = [path for path in known if path not in there]
        if anew or gone:
            with self._database as database:
                if anew:
                    database.execute("DELETE FROM signal")
                    database.execute("DELETE FROM run")
                self._forget(database, gone)
        new = [path for path, log in there.items() if known.get(path) != log]
        for begin in range(0, len(new), TOGETHER):
            some = new[begin : begin + TOGETHER]
            found = []
            for place, path in enumerate(some):
                told(begin + place, len(new))
                found.append((path, there[path], *read_facts(self.root, path, there[path].size_bytes)))
            with self._database as database:
                self._forget(database, some)
                for path, log, facts, signals in found:
                    row = database.execute(
                        "INSERT INTO run (path, size, changed, facts) VALUES (?, ?, ?, ?)", (path, *log, _ENCODE(facts))
                    )
                    database.executemany(
                        "INSERT OR IGNORE INTO signal VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                        [(one.name, row.lastrowid, *msgspec.structs.astuple(one)[1:]) for one in signals],
                    )

    def runs(self) -> list[RunFacts]:
        """Return all runs."""
        return [_DECODE(facts) for (facts,) in self._database.execute("SELECT facts FROM run")]

    def elements(self) -> dict[str, list[str]]:
        """Return the elements that any run has, and the scalars of each."""
        found: dict[str, list[str]] = {}
        for element, name in self._database.execute("SELECT DISTINCT element, name FROM signal"):
            found.setdefault(element, []).append(name)
        return found

    def signals(self, names: Sequence[str]) -> dict[str, list[SignalFacts]]:
        """Return the facts of scalars by the path of their run: its number is another one once it was read anew."""
        found: dict[str, list[SignalFacts]] = {}
        for begin in range(0, len(names), 500):
            some = names[begin : begin + 500]
            marks = ", ".join("?" * len(some))
            for path, name, _, *rest in self._database.execute(f"{_OF_RUNS} WHERE name IN ({marks})", some):
                found.setdefault(path, []).append(SignalFacts(name, *rest))
        return found

    def of_run(self, path: str) -> list[SignalFacts]:
        """Return the facts of all scalars of a run, by name."""
        rows = self._database.execute(f"{_OF_RUNS} WHERE path = ? ORDER BY name", (path,))
        return [SignalFacts(name, *rest) for _, name, _, *rest in rows]

    def _opened(self, path: Path | str) -> sqlite3.Connection:
        database = sqlite3.connect(path, timeout=PATIENCE_S, check_same_thread=False)
        try:
            (version,) = database.execute("PRAGMA user_version").fetchone()
            if version != VERSION:
                with database:
                    database.execute("DROP TABLE IF EXISTS run")
                    database.execute("DROP TABLE IF EXISTS signal")
                    database.execute(f"PRAGMA user_version = {VERSION}")
            database.executescript(_TABLES)
        except sqlite3.Error:
            database.close()
            raise
        return database

    @staticmethod
    def _forget(database: sqlite3.Connection, paths: Iterable[str]) -> None:
        for path in paths:
            database.execute("DELETE FROM signal WHERE run IN (SELECT id FROM run WHERE path = ?)", (path,))
            database.execute("DELETE FROM run WHERE path = ?", (path,))
