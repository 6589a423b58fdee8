"""`silo runs`, `silo tag`, `silo note`: which runs there are, and what people say of them."""

import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.common import TypedPath, find_saved, progress, show, show_json, show_rows
from silo.core.arguments import shown
from silo.core.quantities.writing import count, many, size_text
from silo.errors import LogNotFoundError, LogWarning

MOST_APART = 20

if TYPE_CHECKING:
    from silo.run_index.apart import Apart
    from silo.run_index.listed import ListedRun
    from silo.run_index.runs import RunList


@click.command("runs")
@click.argument("folders", metavar="[FOLDER]...", nargs=-1, type=TypedPath(path_type=Path))
@click.option("--where", metavar="EXPR", default="", help="Only those for which it holds.")
@click.option("--word", "-w", "words", metavar="WORD", multiple=True, help="Only those that have the word somewhere.")
@click.option("--tag", "tags", metavar="TAG", multiple=True, help="Only those with the tag.")
@click.option("--since", metavar="WHEN", help="Only those from then on: 2026-11-22, '2026-11-22 14:00'.")
@click.option("--until", metavar="WHEN", help="Only those that began before; of a day, until its end.")
@click.option("--show", "shown", metavar="EXPR", multiple=True, help="A column more: 'max(joints/tau_3)'.")
@click.option("--episodes", is_flag=True, help="A line for each episode of the runs; EXPR speaks of episodes.")
@click.option("--against", metavar="EXPR", default="", help="What tells them from those for which it holds.")
@click.option("--rebuild", is_flag=True, help="Make the index anew from the logs.")
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def runs(
    folders: tuple[Path, ...],
    where: str,
    words: tuple[str, ...],
    tags: tuple[str, ...],
    since: str | None,
    until: str | None,
    shown: tuple[str, ...],
    episodes: bool,
    against: str,
    rebuild: bool,
    as_json: bool,
) -> None:
    """List the runs in folders and below, the newest last.

    The first time each log is read once; what is known of it then stands in an index beside the logs.

    EXPR speaks of a whole run, or of an episode: max(joints/tau_3), min, mean, std, rms, last, count of signals; span,
    lost, limits, triggers, marks; a tag, a parameter, or the last value of a signal by its name.

    --against lists what differs instead, each signal by the statistic that differs most: APART is 1 where its number
    alone tells these runs from the others, and 0 where it says nothing.

    \b
    Examples:
      silo runs
      silo runs logs --where 'max(joints/tau_3) > 30 and lost == 0'
      silo runs logs --episodes --where 'success and speed > 0.3'
      silo runs logs --episodes --where bad --against good
      silo runs logs --tag slip --since 2026-11-22 --show 'rms(imu/acc_z)'
    """
    from silo.run_index.runs import runs as find_runs
    from silo.run_index.runs import told_of

    with progress("index") as tell:
        found = find_runs(*folders, since=since, until=until, rebuild=rebuild, told=tell)
    every = found.episodes() if episodes else found

    def narrowed(condition: str) -> "RunList":
        some = (every.where(condition) if condition else every).find(*words)
        for tag in tags:
            some = some.where(f"tagged(`{tag}`)")
        return some

    with _telling_warnings():
        found = narrowed(where)
        if against:
            apart = found.apart(narrowed(against))
            show(apart, as_json, lambda: _show_apart(apart))
            return
        columns = [(expression, found.values(expression)) for expression in shown]
        if as_json:
            rows = [told_of(run) | {name: values[place] for name, values in columns} for place, run in enumerate(found)]
            show_json(rows)
            return
        if len(found):
            head = ("RUN", "ROBOT", "BEGUN", "SPAN", "LOST", "LIMITS", "TASK", *(name for name, _ in columns), "SAID")
            table = [_row(run, [f"{values[place]:.5g}" for _, values in columns]) for place, run in enumerate(found)]
            show_rows([head, *table], right=(3, 4, 5, *range(7, 7 + len(columns))))
        click.echo(_summary(found, "episode" if episodes else "run"))


@contextlib.contextmanager
def _telling_warnings() -> Iterator[None]:
    """Say in lines what Python programs are warned of."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", LogWarning)
        yield
    for words in dict.fromkeys(str(one.message) for one in told):
        click.echo(f"warning: {words}", err=True)


@click.command("tag")
@click.argument("run", metavar="RUN")
@click.argument("tags", metavar="TAG...", nargs=-1, required=True)
@click.option("--remove", is_flag=True, help="Take these tags from it.")
def tag(run: str, tags: tuple[str, ...], remove: bool) -> None:
    """Give a run tags, or take them; what is said stands beside the run, in silo-labels.jsonl.

    \b
    Examples:
      silo tag logs/anymal_2026-11-22_14-00-00_00017.silo slip
      silo tag 17 slip wet --remove
    """
    from silo.run_index.labels import read_labels
    from silo.run_index.labels import tag as give

    folder, name = _found(run)
    give(folder, name, () if remove else tags, tags if remove else ())
    click.echo(f"{name}: {', '.join(read_labels(folder)[name].tags) or 'no tags'}")


@click.command("note")
@click.argument("run", metavar="RUN")
@click.argument("words", metavar="[WORDS]...", nargs=-1)
@click.option("--undo", "back", is_flag=True, help="Take the last note or tag back.")
def note(run: str, words: tuple[str, ...], back: bool) -> None:
    """Say something of a run, in a sentence.

    \b
    Examples:
      silo note 17 'slipped on the wet floor'
      silo note 17 --undo
    """
    from silo.run_index import labels

    folder, name = _found(run)
    if back == bool(words):
        raise click.UsageError("write what is to be noted, or --undo")
    if back:
        click.echo(f"{name}: took back {labels.undo(folder, name)}")
        return
    labels.note(folder, name, " ".join(words))
    click.echo(f"{name}: {many(len(labels.read_labels(folder)[name].notes), 'note')}")


def _found(run: str) -> tuple[Path, str]:
    """The folder and the name of a run. Raises LogNotFoundError."""
    path = find_saved(run)
    if path.is_dir() and path.suffix == "":
        raise LogNotFoundError(f"'{path}' is a folder; name a run in it")
    return path.absolute().parent, path.stem


def _show_apart(found: "list[Apart]") -> None:
    head = ("SIGNAL", "HOW", "UNIT", "THESE", "OTHERS", "APART")
    rows = [(one.what, one.how, one.unit, f"{one.these:.5g}", f"{one.others:.5g}", f"{one.apart:+.2f}")
            for one in found[:MOST_APART]]  # fmt: skip
    show_rows([head, *rows], right=(3, 4, 5))
    if len(found) > MOST_APART:
        click.echo(f"{len(found) - MOST_APART} more differ less; --json has all")


def _row(run: "ListedRun", more: list[str]) -> tuple[str, ...]:
    facts = run.facts
    place = f"#{facts.episodes[0].number}" if facts.kind == "episode" else ""
    return (
        f"{facts.path}{place}", facts.robot, f"{run.begun:%Y-%m-%d %H:%M:%S}", f"{facts.span_s:.4g} s",
        count(facts.lost) if facts.lost else "", str(facts.limits or ""), facts.task, *more, run.said,
    )  # fmt: skip


def _summary(found: "RunList", what: str) -> str:
    unfit = [name for index in found.indexes for name in index.unfit]
    if unfit:
        why = "names that are no UTF-8, or have control characters: give them others"
        click.echo(f"{many(len(unfit), 'log')} left out, {shown(unfit[0])} the first: {why}", err=True)
    if not len(found):
        return f"no {what}; look in another folder, or ask for less"
    unread = sum(bool(run.facts.problem) for run in found)
    more = f", of which {unread} can't be read" if unread else ""
    return f"{many(len(found), what)}, {size_text(found.size_bytes)}{more}"
