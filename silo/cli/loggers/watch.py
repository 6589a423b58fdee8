"""`silo watch`: live values in plain lines, or as JSON for machines."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from silo.cli.common import complete_words, connect, json_option, patiently, show_json, split_logger, unknown_logger
from silo.cli.edits import of_entries, select
from silo.core.elements import State
from silo.core.quantities.writing import and_more, many, wall_clock
from silo.errors import ConnectionLostError, ElementError, RefusedError
from silo.printing import printable
from silo.rpc.published import NOT_LIVE_TEXTS

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.elements import ElementInfo, Entry
    from silo.live.view import View
    from silo.rpc.frames import Frame

MOST_VALUES = 16  # per line; a matrix of a hundred values is nothing to read
MOST_LINES = 20  # per refresh where no pattern was given
GONE_AFTER_S = 5.0
POLL_S = 0.01


@dataclass(frozen=True)
class WatchedElement:
    """One element of the watch: its entries stand at `first ...` of a frame's values."""

    info: "ElementInfo"
    first: int

    def texts(self, newest: Sequence[float], texts: Mapping[int, str]) -> list[str]:
        """Return the values in words."""
        return [
            self._word(texts[place], entry) if place in texts else show_value(newest[place], entry.dtype, entry.labels)
            for place, entry in enumerate(self.info.entries, start=self.first)
        ]

    @staticmethod
    def _word(word: str, entry: "Entry") -> str:
        if entry.labels and word.lstrip("-").isdecimal():
            word = entry.labels.get(int(word), word)
        return printable(word)


def show_value(value: float, dtype: str, labels: Mapping[int, str] | None) -> str:
    """Return a number as its type wants it: a name, a whole number, true or false, or six digits."""
    if math.isnan(value):
        return "nan"
    if labels is not None and value in labels:
        return labels[int(value)]
    if "b1" in dtype:
        return "true" if value else "false"
    return f"{value:.0f}" if dtype.lstrip("<|>=")[0] in "iu" else f"{value:.6g}"


def show_clock(time_ns: int) -> str:
    """Return the local time of a tick, `12:00:01.250`; dashes before the first tick."""
    if time_ns == 0:
        return "--:--:--.---"
    return wall_clock(time_ns, 3)


def lay_out(elements: "Sequence[ElementInfo]") -> list[WatchedElement]:
    """Return where the entries of each element stand in a frame that shows them all."""
    lines, first = [], 0
    for info in elements:
        lines.append(WatchedElement(info, first))
        first += len(info.entries)
    return lines


@click.command()
@click.argument("words", nargs=-1, metavar="[LOGGER] [PATTERN]...", shell_complete=complete_words)
@click.option("--rate", type=click.FloatRange(0.1, 30), default=2.0, show_default=True, help="Lines per second.")
@click.option("-n", "--count", type=click.IntRange(1), help="End after so many.")
@json_option
def watch(words: tuple[str, ...], rate: float, count: int | None, as_json: bool) -> None:
    """Print live values until Ctrl-C: one line per element and refresh, or one JSON object per refresh.

    Every element that is on can be watched, whether it is saved or published. PATTERN is an element, a namespace or a
    glob; without one, the first of those that are on are shown. Over a network it waits for a link that is cut.

    \b
    Examples:
      silo watch demo /log/base/pose '*/LF/*/torque'
      silo watch demo /log/battery --rate 1 --json | jq .values
    """

    def begin() -> "tuple[Client, list[str]]":
        logger, patterns = split_logger(words, or_pattern=True)
        if not patterns and (problem := unknown_logger(logger)) is not None:
            raise problem
        return connect(logger), patterns

    try:
        client, patterns = patiently(begin)
        with client:
            _watch(client, patterns, rate, count, as_json=as_json)
    except KeyboardInterrupt:
        return  # the usual end of watching


def _watch(client: "Client", patterns: Sequence[str], rate: float, count: int | None, *, as_json: bool) -> None:
    found = client.table()
    table = [*found.elements, *found.derived]
    patterns, told = of_entries(table, patterns)
    for text in told:
        click.echo(text, err=True)
    chosen = [table[place] for place in select([e.name for e in table], patterns)] if patterns else table
    blind = [e for e in chosen if e.expression and not e.options.enabled]
    silent = [e.name for e in chosen if not e.options.enabled and not e.expression]
    chosen = [e for e in chosen if e.options.enabled]
    if not table:
        raise ElementError("the logger has no elements yet: nothing to watch")
    if not chosen and blind:
        raise ElementError(f"{blind[0].name} {blind[0].description}: nothing to watch")
    if not chosen:
        raise ElementError(
            f"{and_more(silent, 1)}: off; `silo set PATTERN on` switches it on, while the logger is stopped"
        )
    if not patterns:
        silent, blind, chosen = [], [], _first(chosen, as_json)
    for one in blind:
        click.echo(f"{one.name} {one.description}", err=True)
    if silent:
        click.echo(and_more([f"{name}: off" for name in silent], 10, "\n"), err=True)
    lines = lay_out(chosen)
    with closing(client.view([e.name for e in chosen], [], rate, 100_000_000)) as view:
        for shown, frame in enumerate(_frames(client, view), start=1):
            _show_json(lines, frame) if as_json else _show_lines(lines, frame)
            if shown == count:
                return


def _first(chosen: "list[ElementInfo]", as_json: bool) -> "list[ElementInfo]":
    """What is shown where nobody said what: all for machines, a screenful for people."""
    if as_json or len(chosen) <= MOST_LINES:
        return chosen
    click.echo(
        f"the first {MOST_LINES} of {len(chosen)} elements that are on; say which: `silo watch PATTERN`", err=True
    )
    return chosen[:MOST_LINES]


def _frames(client: "Client", view: "View") -> "Iterator[Frame]":
    """Every new frame. Raises ConnectionLostError when the robot program died, or, on this computer, is gone.

    Over a network it may be the link that is cut, and comes back.
    """
    last_s = time.monotonic()
    state = None
    waits = False
    while True:
        frame = view.frame()
        if frame is None:
            if view.refused:
                raise RefusedError(view.refused)
            if time.monotonic() - last_s > GONE_AFTER_S and not client.connected and not waits:
                if not client.found.config:
                    text = "the logger is gone; `silo ls` shows what runs, `silo recover` what was left"
                    raise ConnectionLostError(text)
                click.echo(f"{client.found.label}: no connection; connecting again by itself, until Ctrl-C", err=True)
                waits = True
            time.sleep(POLL_S)
            continue
        last_s, waits = time.monotonic(), False
        if frame.state is State.DEAD:
            raise ConnectionLostError(client.status().reason)
        if state not in (None, frame.state) or (state is None and frame.state.value != "running"):
            click.echo(f"logger is {frame.state.value}", err=True)
        state = frame.state
        yield frame


def _show_lines(lines: Sequence[WatchedElement], frame: "Frame") -> None:
    newest = frame.newest.tolist()
    clock = show_clock(frame.time_ns)
    for place, (line, held) in enumerate(zip(lines, frame.held.tolist(), strict=True)):
        values = line.texts(newest, frame.texts) if held else ["-"]
        more = f" ... ({len(values)} values)" if len(values) > MOST_VALUES else ""
        unit = "" if line.info.unit == "-" or not held else f" {line.info.unit}"
        why = f"  ({NOT_LIVE_TEXTS[frame.not_live[place]]})" if held and place in frame.not_live else ""
        failed = f"  ! not read at {many(frame.failed[place], 'tick')}" if place in frame.failed else ""
        click.echo(f"{clock}  {line.info.name}  {' '.join(values[:MOST_VALUES])}{more}{unit}{why}{failed}")


def _show_json(lines: Sequence[WatchedElement], frame: "Frame") -> None:
    values = {
        line.info.name + entry.suffix: frame.exact(place, entry.dtype)
        for line in lines
        for place, entry in enumerate(line.info.entries, start=line.first)
    }
    shown = {"time_ns": frame.time_ns, "tick": frame.tick, "state": frame.state, "lost": frame.lost_total}
    failed = {lines[place].info.name: count for place, count in frame.failed.items()}
    not_live = {lines[place].info.name: why.value for place, why in frame.not_live.items()}
    told = {**({"failed": failed} if failed else {}), **({"not_live": not_live} if not_live else {})}
    show_json({**shown, "values": values, **told})
