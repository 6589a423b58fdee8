"""`silo record`: endless recordings to MCAP files, begun, listed and ended; they go on without this command."""

import time
from typing import TYPE_CHECKING

import click

from silo.cli.common import complete_words, connect, json_option, show, show_json, show_rows, split_logger
from silo.core.quantities.writing import count, duration_text, many, size_text

if TYPE_CHECKING:
    from silo.recorder.requests import RecorderInfo

_OPTIONS = {"ls": "ls", "list": "ls", "stop": "stop [NAME]"}  # words that others of our commands take


@click.command()
@click.argument("words", nargs=-1, metavar="[LOGGER] [PATTERN]...", shell_complete=complete_words)
@click.option("--to", default="", metavar="DIR", help="Inside the logger's folder; `recordings` if not given.")
@click.option("--split", default="1GB", show_default=True, metavar="SIZE|TIME", help="When a part ends: 1GB, 10min.")
@click.option("--keep", default="", metavar="SIZE", help="Delete the oldest parts of its name above this: 50GB.")
@click.option("-n", "--name", default="", help="Of the recording and its files, instead of the logger's name.")
@click.option("--stop", "stop_name", is_flag=False, flag_value="", default=None, metavar="[NAME]", help="End one.")
@click.option("--ls", "only_list", is_flag=True, help="List the recordings.")
@json_option
def record(
    words: tuple[str, ...],
    to: str,
    split: str,
    keep: str,
    name: str,
    stop_name: str | None,
    only_list: bool,
    as_json: bool,
) -> None:
    """Record the logger's elements, or those that match, from now on: across restarts, until it is stopped.

    A process beside the logger streams every sample to MCAP files (Foxglove, PlotJuggler, rosbags, `silo plot`). Each
    part is whole in itself. It stops by itself before the disk is full: 2 % or 1 GB of it, the less, is left free.

    \b
    Examples:
      silo record demo                       (everything, to DIR/recordings)
      silo record demo '/log/joints/*' --to walks --split 10min --keep 50GB
      silo record --ls
      silo record --stop demo
    """
    if word := next((one for one in words[:1] if one in _OPTIONS), ""):  # else a recording of nothing would begin
        raise click.UsageError(f"write `silo record --{_OPTIONS[word]}`; nothing is recorded")
    logger, patterns = split_logger(words, or_pattern=True)
    with connect(logger) as client:
        if only_list:
            infos = client.recorders()
            show(infos, as_json, lambda: _show(infos))
            return
        if stop_name is not None:
            click.echo(client.stop_recorder(stop_name))
            return
        started = client.record(patterns, to, split, keep, name)
        label = client.found.label
    if as_json:
        show_json(started)
        return
    click.echo(f"recording '{started.name}' to {started.folder}; `silo record {label} --stop {started.name}` ends it")
    if started.text:
        click.echo(started.text, err=True)


def _show(infos: "list[RecorderInfo]") -> None:
    if not infos:
        click.echo("nothing is being recorded; `silo record` begins it")
        return
    header = ("NAME", "STATE", "FOR", "PARTS", "SIZE", "SAMPLES", "LOST", "FOLDER")
    show_rows([header, *map(_row, infos)], right=(2, 3, 4, 5, 6))
    for info in infos:
        if info.text:
            click.echo(f"{info.name}: {info.text}", err=True)
        elif info.lost:
            click.echo(f"{info.name}: {many(info.lost, 'sample')} were lost; the files say which", err=True)


def _row(info: "RecorderInfo") -> tuple[str, ...]:
    return (
        info.name,
        info.state.value,
        duration_text((time.time_ns() - info.since_ns) / 1e9),
        str(info.parts + bool(info.part)),
        size_text(info.size_bytes),
        count(info.samples),
        count(info.lost),
        info.folder,
    )
