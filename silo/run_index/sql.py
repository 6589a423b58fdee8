"""SQL over runs, by DuckDB: it says which columns of which runs it needs, and those alone are read.

DuckDB hands what it wants of a table to polars (columns, and conditions that compare a column with values), polars to
the functions here. A statement can reach no file, no network and no extension: all that is switched off and locked.
"""

import functools
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import psutil

from silo.core.names import did_you_mean, nearest
from silo.core.quantities.writing import size_text
from silo.errors import ElementError, SiloError
from silo.files.optional_packages import need
from silo.files.texts import unique_names
from silo.run_index.tables import COLUMNS, EXTRA, TIME, Drawer, T, typed

SHARE = 0.5  # of the memory that is free
_SAMPLE_BYTES, _CELL_BYTES = 64, 10
_LOCKED = {
    "enable_external_access": "false",
    "autoinstall_known_extensions": "false",
    "autoload_known_extensions": "false",
    "allow_community_extensions": "false",
    "python_enable_replacements": "false",
}

Load = Callable[[Any, list[str] | None], Iterator[Any]]  # predicate and columns -> frames


def query(drawer: Drawer, statement: str) -> Any:
    """Answer a statement as a polars frame.

    Raises ElementError for a wrong one or one that reads too much, SiloError where a log can't be read.
    """
    duckdb = need("duckdb", EXTRA, "SQL over runs")
    polars = need("polars", EXTRA, "SQL over runs")
    tables = _Tables(polars, drawer)
    # what is raised holds nothing of DuckDB, which complains at the program's end of what is left of it
    connection = duckdb.connect(":memory:", config=_LOCKED)
    try:
        connection.execute("SET TimeZone = 'UTC'")
        connection.execute("SET lock_configuration = true")
        for name in COLUMNS:
            connection.register(name, tables.lazy(name))
        answer = connection.sql(statement)
        return polars.DataFrame() if answer is None else answer.pl()
    except duckdb.Error as error:
        wrong = str(error)
    except polars.exceptions.PolarsError as error:
        wrong = f"no table here holds this answer ({error}): write epoch(...) of an interval, else what::text"
    finally:
        connection.close()
    raise tables.failed or ElementError(f"{wrong}\n(tables: {', '.join(COLUMNS)}; `describe wide` has the signals)")


class _Tables:
    """Frames that are made when they are asked for; `failed` is what went wrong in that."""

    def __init__(self, polars: Any, drawer: Drawer) -> None:
        self._polars, self._drawer = polars, drawer
        self._known = functools.cache(drawer.frame)
        self._meant: dict[str, str] = {}  # the signal of a column of the wide table
        self.failed: SiloError | None = None

    def lazy(self, name: str) -> Any:
        plugins = need("polars.io.plugins", EXTRA, "SQL over runs")
        load: Load = {"samples": self._samples, "wide": self._wide}.get(name, lambda *asked: iter([self._known(name)]))
        schema = {**typed(COLUMNS[name]), **(self._columns() if name == "wide" else {})}

        def read(columns: list[str] | None, predicate: Any, rows: int | None, together: int | None) -> Iterator[Any]:
            there = 0
            try:
                for frame in load(predicate, columns):
                    kept = frame if predicate is None else frame.filter(predicate)
                    kept = kept.select(list(schema) if columns is None else columns)
                    kept = kept if rows is None else kept.head(rows - there)
                    there += len(kept)
                    yield kept
                    if rows is not None and there >= rows:
                        return
            except SiloError as error:
                self.failed = error.with_traceback(None)
                raise RuntimeError(str(error)) from None
            if not there:
                yield self._polars.DataFrame(schema=schema).select(list(schema) if columns is None else columns)

        return plugins.register_io_source(read, schema=schema)

    def _columns(self) -> dict[str, Any]:
        """The columns of the wide table: DuckDB tells names apart by letters, not by their case.

        Of names that differ by case alone none stays as it is: each would be found by the others. Nor does one of a
        signal that is called like a column of each table. What is numbers in one run is numbers in all, of
        enumerations, too; texts of others have a column beside it.
        """
        kinds = self._polars.col("kind").unique()
        signals = list(self._known("signals").group_by("signal").agg(kinds).sort("signal").iter_rows())
        alike = Counter([*COLUMNS["wide"], *(name.lower() for name, _ in signals)])
        own = unique_names(str, str.lower)
        column = {name: own(name) for name, _ in signals if alike[name.lower()] == 1}
        for name, count in alike.items():
            if count > 1:
                own(name)
        column |= {name: own(name) for name, _ in signals if name not in column}
        self._meant = {column[name]: name for name, _ in signals}
        types = {column[name]: self._polars.Float64 if "number" in kinds else self._polars.String
                 for name, kinds in signals}  # fmt: skip
        for name, kinds in signals:
            if {"number", "text"} <= {*kinds}:
                beside = own(f"{column[name]}_text")
                self._meant[beside], types[beside] = name, self._polars.String
        return types

    def _samples(self, predicate: Any, columns: list[str] | None) -> Iterator[Any]:
        polars, column = self._polars, self._polars.col
        stamps = column(T).alias("t"), column(TIME).alias("time")
        every = self._known("signals")
        if len(every) and not len(self._kept_by(predicate, every, ("signal",))):
            raise ElementError(f"no run has such a signal{_near(str(predicate), every['signal'].unique().to_list())}")
        wanted = self._kept_by(predicate, every, ("run", "signal"))
        self._fits(int(wanted["samples"].sum() or 0) * _SAMPLE_BYTES, "name signals (signal = '...') and runs")
        for (run,), of_run in wanted.group_by("run", maintain_order=True):
            kinds = list(of_run["signal", "kind"].iter_rows())
            words = [one for one, kind in kinds if kind != "number"]
            numbers = {one: f"#{one}" if kind == "enum" else one for one, kind in kinds}
            frame = self._drawer.read(run, list(dict.fromkeys([*numbers.values(), *words])))
            for name, numeric in numbers.items():
                value = polars.lit(None, polars.Float64) if name in words and numeric == name else column(numeric)
                text = column(name) if name in words else polars.lit(None, polars.String)
                made = frame.select(*stamps, value.alias("value"), text.alias("text"), column(numeric).alias("_"))
                yield made.filter(column("_").is_not_null()).with_columns(
                    polars.lit(run).alias("run"), polars.lit(name).alias("signal")
                )

    def _wide(self, predicate: Any, columns: list[str] | None) -> Iterator[Any]:
        polars, schema = self._polars, {**typed(COLUMNS["wide"]), **self._columns()}
        stamps = polars.col(T).alias("t"), polars.col(TIME).alias("time")
        judged = predicate.meta.root_names() if predicate is not None else []
        asked = list(schema) if columns is None else [*columns, *judged]
        asked = [one for one in dict.fromkeys(asked) if one in self._meant]
        runs = self._kept_by(predicate, self._known("runs").filter(polars.col("problem") == ""), ("run",))
        self._fits(int(runs["ticks"].sum() or 0) * _CELL_BYTES * (3 + len(asked)), "name columns and runs")
        there: dict[str, dict[str, str]] = {}
        for run, signal, kind in self._known("signals").select("run", "signal", "kind").iter_rows():
            there.setdefault(run, {})[signal] = kind
        for run in runs["run"]:
            kinds = {own: there.get(run, {}).get(self._meant[own], "") for own in asked}
            read_as = {own: _read_as(self._meant[own], kind, schema[own]) for own, kind in kinds.items()}
            mine = {own: name for own, name in read_as.items() if name}
            frame = self._drawer.read(run, list(dict.fromkeys(mine.values())))
            missing = [polars.lit(None, schema[own]).alias(own) for own in asked if own not in mine]
            rest = [polars.lit(None, schema[own]).alias(own) for own in self._meant if own not in asked]
            parts = [polars.col(name).cast(schema[own]).alias(own) for own, name in mine.items()]
            yield frame.select(*stamps, polars.lit(run).alias("run"), *parts, *missing, *rest)

    def _kept_by(self, predicate: Any, frame: Any, columns: Sequence[str]) -> Any:
        """The rows of a frame that a condition leaves, so far as it speaks of these columns."""
        for part in _parts(predicate) if predicate is not None else ():
            if set(part.meta.root_names()) <= set(columns):
                frame = frame.filter(part)
        return frame

    @staticmethod
    def _fits(size: int, way_out: str) -> None:
        room = int(psutil.virtual_memory().available * SHARE)
        if size > room:
            raise ElementError(
                f"this reads about {size_text(size)} of samples at once, and {size_text(room)} may be taken; "
                f"{way_out}, or narrow the runs first (where=)"
            )


def _read_as(signal: str, kind: str, column: Any) -> str:
    """What a column of numbers, or of texts, reads of a signal; of an enumeration it is either; empty for nothing."""
    is_numbers = bool(column.is_numeric())
    if kind == "enum":
        return f"#{signal}" if is_numbers else signal
    return signal if kind and (kind == "number") == is_numbers else ""


def _near(condition: str, names: Sequence[str]) -> str:
    """What a text in a condition may mean."""
    asked = [text for text in condition.split('"')[1::2] if text not in COLUMNS["samples"]]
    near = [one for text in asked for one in nearest(text, names)]
    return did_you_mean(near[:1], "`select distinct signal from signals` lists them")


def _parts(condition: Any) -> list[Any]:
    """Conditions that all hold where this one does."""
    inner = condition.meta.pop()
    for one, other in (inner, inner[::-1]) if len(inner) == 2 else ():
        if (one & other).meta == condition:
            return [*_parts(one), *_parts(other)]
    return [condition]
