"""`silo query`, `silo archive`: runs as tables, asked in SQL, kept as Parquet."""

import io
from pathlib import Path
from typing import Any

import click

from silo.cli.codes import EXIT_FAILED, EXIT_FOUND
from silo.cli.common import progress, show_json, show_rows
from silo.core.quantities.writing import count, many, size_text
from silo.errors import SaveError
from silo.files.atomic import atomic_file, write_all
from silo.files.optional_packages import need

MOST_ROWS = 100


@click.command("query")
@click.argument("statement", metavar="SQL")
@click.option("--in", "places", metavar="FOLDER", multiple=True, help="Where the runs are: folders, or an archive.")
@click.option("--where", metavar="EXPR", default="", help="Only runs for which it holds, as of `silo runs`.")
@click.option("--to", "file", metavar="FILE", help="Write the answer to a .csv or .parquet file.")
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def query(statement: str, places: tuple[str, ...], where: str, file: str | None, as_json: bool) -> None:
    """Answer an SQL statement over runs, by DuckDB.

    \b
    Tables: runs, signals (a scalar of a run in numbers), episodes,
    episode_signals, events, parameters, about;
    samples: run, signal, t, time, value, text; wide: a column for each scalar.
    Only those signals and runs are read that the statement asks for. It reaches
    no other file, no network, no extension.

    \b
    Examples:
      silo query "select run, span_s, lost from runs where lost > 0" --in logs
      silo query 'select run, max("joints/tau_3") from wide group by run' --in logs
      silo query "select signal, avg(value) from samples where signal = 'imu/acc_z' group by all"
    """
    if file is not None and (Path(file).suffix not in (".csv", ".parquet") or Path(file).exists()):
        raise SaveError(f"'{file}' must end with .csv or .parquet, and not be there already")
    frame = _asked(places or (".",), where)(statement)
    if file is not None:
        _write(frame, file)
        click.echo(f"{file}: {many(len(frame), 'row')}")
    elif as_json:
        show_json(_with_all_digits(frame).to_dicts())
    elif frame.width:
        numbers = [place for place, kind in enumerate(frame.dtypes) if kind.is_numeric()]
        show_rows([frame.columns, *([_cell(one) for one in row] for row in frame.head(MOST_ROWS).iter_rows())], numbers)
        if len(frame) > MOST_ROWS:
            click.echo(f"... {count(len(frame) - MOST_ROWS)} rows more: LIMIT fewer, or write them, --to rows.csv")


@click.command("archive")
@click.argument("folders", metavar="[FOLDER]...", nargs=-1)
@click.argument("to", metavar="TO")
@click.option("--where", metavar="EXPR", default="", help="Only runs for which it holds, as of `silo runs`.")
@click.option("--since", metavar="WHEN", help="Only those from then on: 2026-11-22, '2026-11-22 14:00'.")
@click.option("--until", metavar="WHEN", help="Only those that began before; of a day, until its end.")
@click.option("--as", "name", metavar="NAME", default="", help="What their names begin with there.")
@click.option("--check", is_flag=True, help="Read the archive again, and hold it against its manifest.")
def archive(
    folders: tuple[str, ...], to: str, where: str, since: str | None, until: str | None, name: str, check: bool
) -> int:
    """Keep runs as Parquet: by robot, date and run, with their facts, events and statistics.

    TO is a folder, or a URL that fsspec knows (s3://bucket/runs; credentials come from the environment). What is in it
    as it is now stays; what was interrupted goes on. `silo query --in TO` asks it, and so does all that reads Parquet.

    \b
    Examples:
      silo archive logs /mnt/archive
      silo archive logs s3://robots/runs --since 2026-11-01 --as lab2
      silo archive --check /mnt/archive

    \b
    Exit codes:
      0  all is in the archive        1  something is not, and was named        4  it is not as archived (--check)
    """
    from silo.run_index.archive import Archive
    from silo.run_index.runs import runs

    there = Archive(to)
    if check:
        if folders:
            raise click.UsageError("--check takes the archive alone")
        with progress("check") as tell:
            wrong = there.check(tell)
        _name(wrong)
        click.echo(f"{many(len(there.manifest()), 'file')}, {len(wrong)} not as archived")
        return EXIT_FOUND if wrong else 0
    with progress("archive") as tell:
        done = there.add(runs(*folders, where=where, since=since, until=until), tell, name)
    _name(done.problems)
    click.echo(
        f"{to}: {many(len(done.added), 'file')} added ({size_text(done.bytes)}), {done.kept} there already, "
        f"{len(done.problems)} not archived"
    )
    return EXIT_FAILED if done.problems else 0


def _asked(places: tuple[str, ...], where: str) -> Any:
    """What answers SQL over some places: an archive, or folders of logs."""
    from silo.run_index.archive import MARK, Archive
    from silo.run_index.runs import runs

    if len(places) == 1 and ("://" in places[0] or Path(places[0], MARK).exists()):
        if where:
            raise click.UsageError("--where is for folders of logs; of an archive ask the table `runs`")
        return Archive(places[0]).sql
    with progress("index") as tell:
        found = runs(*places, where=where, told=tell)
    return found.sql


def _name(problems: dict[str, str]) -> None:
    for run, why in problems.items():
        click.echo(f"{run}: {why}")


def _write(frame: Any, file: str) -> None:
    """Write a frame, whole or not at all. Raises SaveError."""
    made = io.BytesIO()
    if file.endswith(".csv"):
        _in_cells(frame).write_csv(made)
    else:
        frame.write_parquet(made)
    with atomic_file(file) as target:
        write_all(target.fileno(), [made.getbuffer()], 0)


def _in_cells(frame: Any) -> Any:
    """The frame with what CSV has no cell for, as lists and bytes, in JSON."""
    import msgspec

    polars = need("polars", "query", "SQL over runs")
    wide = [name for name, kind in frame.schema.items() if kind.is_nested() or kind == polars.Binary]
    texts = {name: [msgspec.json.encode(one).decode() for one in frame[name].to_list()] for name in wide}
    return frame.with_columns(**{name: polars.Series(column, dtype=polars.String) for name, column in texts.items()})


def _with_all_digits(frame: Any) -> Any:
    """The frame with its times as text: Python's have no nanoseconds."""
    polars = need("polars", "query", "SQL over runs")
    times = [name for name, kind in frame.schema.items() if isinstance(kind, polars.Datetime)]
    digits = {name: f"%Y-%m-%dT%H:%M:%S%.9f{'Z' if frame.schema[name].time_zone else ''}" for name in times}
    return frame.with_columns([polars.col(name).dt.strftime(digits[name]) for name in times])


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
