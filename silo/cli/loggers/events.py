"""`silo mark` and `silo events`: say what happened, and read what did."""

import math
import shlex
import time
from collections.abc import Iterator, Sequence
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

import click
import msgspec

from silo.cli.common import LogWord, complete_logger, connect, find_saved, json_option, means_saved, show
from silo.cli.verbs import Target, Words, by_count, verb
from silo.core.elements import LoggedEvent, by_clock
from silo.core.episodes.words import BEGIN, END, VERDICTS, next_marks
from silo.core.quantities.writing import wall_clock
from silo.decoding import json_decoder
from silo.errors import LogNotFoundError
from silo.printing import printable

if TYPE_CHECKING:
    from silo.client.client import Client

FOLLOW_S = 0.2
MOST = 10_000


@verb(None, "mark", "TEXT")
@click.option("--tick", type=click.IntRange(0), help="Which tick, instead of the newest.")
def mark(client: "Client", text: str, tick: int | None) -> str:
    """Mark the newest tick of a logger with some words; they go to its event log and into its files.

    \b
    Examples:
      silo mark "slipped"                    (the only logger)
      silo mark demo "slipped on the ramp"
      silo mark demo "here" --tick 12871
    """
    if text == client.found.name:
        raise click.UsageError(f"'{text}' is the logger: which words? silo mark {text} 'TEXT'; nothing was marked")
    event = client.mark(text, tick)
    return f"marked tick {event.tick}: {event.text}"


def _said(ctx: click.Context, words: Sequence[str], usage: str) -> Target:
    """Take what is said, and tell where the episode's name belongs that stands behind it."""
    said = next(
        (place for place in (1, 0) if words[place : place + 1] and words[place] in (BEGIN, END, *VERDICTS)), None
    )
    if said is not None and len(words) > said + 1:
        rest = [f"--{'about' if '=' in word else 'name'} {shlex.quote(word)}" for word in words[said + 1 :]]
        raise click.UsageError(f"write {ctx.command_path} {' '.join([*words[: said + 1], *rest])}", ctx)
    return by_count(ctx, words, usage)


@verb(None, "episode", "WORD", Words(_said))
@click.option("--name", default="", help="Which one; the newest if it isn't given.")
@click.option("--about", "facts", metavar="KEY=VALUE", multiple=True, help="What is to be known of one that begins.")
def episode(client: "Client", word: str, name: str, facts: tuple[str, ...]) -> str:
    """Say of an episode that it was good or bad, is to be done again (redo), begins or ends.

    Programs mark episodes by `with log.episode("pick")`. What a person says holds against what the program says.

    \b
    Examples:
      silo episode good                      (the only logger, its newest episode)
      silo episode begin --name pick --about object=cup --about speed=0.4
      silo episode demo redo --name pick
    """
    split = [fact.partition("=") for fact in facts]
    if any(not key or not there for key, there, _ in split):
        raise click.UsageError("write --about KEY=VALUE")
    known = [] if word == BEGIN else client.events(limit=MOST)
    marks = next_marks(known, word, name, {key: _fact(value) for key, _, value in split})
    event = [client.mark(text) for text in marks][-1]
    return f"marked tick {event.tick}: {event.text}"


def _fact(typed: str) -> str | float | bool:
    """What is typed as a program would say it: `speed=0.4` is a number, `wet=true` a yes; all else are words."""
    try:
        value = json_decoder(bool | int | float).decode(typed)
    except msgspec.MsgspecError:
        return typed
    return value if math.isfinite(value) else typed


@click.command()
@click.argument("which", required=False, type=LogWord(), metavar="[LOGGER|FOLDER|FILE]", shell_complete=complete_logger)
@click.option("-f", "--follow", is_flag=True, help="Go on with what comes, until Ctrl-C.")
@json_option
def events(which: str | None, follow: bool, as_json: bool) -> None:
    """Print what happened: starts, stops, edits, triggers, losses, saves, marks; when, at which tick, by whom.

    Of a logger that runs, of a folder with logs (also when nobody runs any more), or in a saved file or run.

    \b
    Examples:
      silo events demo --follow
      silo events logs                       (a folder)
      silo events demo --json | jq 'select(.kind == "marker")'
    """
    try:
        _events(which, follow=follow, as_json=as_json)
    except KeyboardInterrupt:
        if not follow:
            raise  # the usual end of following is none


def _events(which: str | None, *, follow: bool, as_json: bool) -> None:
    if which is not None and means_saved(which):
        from silo.files.formats import is_bag_folder

        folder = Path(which)
        if folder.is_dir() and not is_bag_folder(folder):
            _of_folder(folder, follow=follow, as_json=as_json)
        elif follow:
            raise click.UsageError("a file doesn't go on: leave --follow out")
        else:
            _print(_of_file(which), as_json)
    else:
        with connect(which) as client:
            _of_logger(client, follow=follow, as_json=as_json)


def _of_file(path: str) -> Sequence[LoggedEvent]:
    from silo.files.added import added_formats
    from silo.files.formats import read_recording

    return read_recording(find_saved(path), added_formats).events


def _of_folder(folder: Path, *, follow: bool, as_json: bool) -> None:
    from silo.files.event_log import loggers_with_events, read_events
    from silo.files.naming import in_order

    loggers = loggers_with_events(folder)
    if not loggers:
        raise LogNotFoundError(f"{folder}: there is no event log; helper processes write one where their logger saves")
    seen: set[LoggedEvent] = set()
    while True:
        found = [(logger, event) for logger in loggers for event in read_events(folder, logger)]
        told = in_order(found, itemgetter(0), lambda one: one[1].number, lambda one: (one[1].clock_ns,))
        _print([event for _, event in told if event not in seen], as_json)
        seen.update(event for _, event in found)
        if not follow:
            return
        time.sleep(FOLLOW_S)


def _of_logger(client: "Client", *, follow: bool, as_json: bool) -> None:
    since = 0
    for found in _news(client):
        fresh = [event for event in found if event.number > since]
        _print(fresh, as_json)
        since = max((event.number for event in fresh), default=since)
        if not follow:
            return


def watch_kind(client: "Client", kind: str) -> None:
    """Print what happens of a kind from now on, until Ctrl-C."""
    newest = max((one.number for one in client.events(0, 1)), default=0)
    try:
        for found in _news(client, newest):
            _print([one for one in found if one.kind == kind], as_json=False)
    except KeyboardInterrupt:
        return  # the usual end


def _news(client: "Client", newest: int = 0) -> Iterator[Sequence[LoggedEvent]]:
    while True:
        found = client.events(newest, MOST)
        newest = found[-1].number if found else newest
        yield found
        time.sleep(FOLLOW_S)


def _print(found: Sequence[LoggedEvent], as_json: bool) -> None:
    for event in by_clock(found):
        show(msgspec.structs.asdict(event), as_json, partial(_line, event))


def _line(event: LoggedEvent) -> str:
    clock = wall_clock(event.clock_ns, 3, date=True)
    tick = str(event.tick) if event.tick >= 0 else "-"
    what = event.text if event.text.startswith(event.kind) else f"{event.kind}: {event.text}"
    return printable(f"{clock}  {tick:>9}  {what}" + (f"  ({event.who})" if event.who else ""))
