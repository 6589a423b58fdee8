"""`silo ls --follow`: a line per logger that changes in place; in a pipe, or as JSON, a line per change."""

import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from silo.cli.common import aligned, configuration, show_json
from silo.core.quantities.writing import count, duration_text, many, size_text, wall_clock
from silo.printing import drawing, printable

if TYPE_CHECKING:
    from silo.fleet.fleet import Fleet, FleetNow
    from silo.fleet.member import Member

PERIOD_S = 1.0  # of a terminal: times go on
STEADY_SHARE = 0.05  # a rate that differs by less is no change
HEADER = ("LOGGER", "STATE", "FOR", "HZ", "LOST", "FREE", "!", "SEEN", "WHO")
RIGHT = (2, 3, 4, 5)
Known = tuple[float, int, tuple[object, ...]]  # the rate of a logger, what was denied lately, and all else
UP, CLEAR_LINE, CLEAR_BELOW = "\x1b[{}A", "\x1b[K", "\x1b[J"


def follow_fleet(pattern: str, *, as_json: bool) -> None:
    """Show the loggers that a pattern means until Ctrl-C. Raises ConnectionLostError for no such configuration."""
    from silo.fleet.fleet import Fleet
    from silo.net.configuration import LOCAL, find_file

    config = configuration()
    if config not in ("", LOCAL):
        find_file(config)  # raises for what is neither
    with Fleet(config) as fleet:
        try:
            if as_json or not sys.stdout.isatty():
                _tell_changes(fleet, pattern, as_json=as_json)
            else:
                _show_in_place(fleet, pattern)
        except KeyboardInterrupt:
            return  # the usual end of following


def meant(found: "FleetNow", pattern: str) -> "list[Member]":
    """Return the loggers that a pattern means, the worst first."""
    return sorted(found.meant(pattern), key=lambda one: one.stands)


def addresses(found: "FleetNow") -> "dict[str, str]":
    """Return by its key how to name each logger: host and name, or what tells it from one of the same."""
    from silo.net.found import told_apart

    members = found.meant("")
    apart = told_apart([one.found for one in members])
    plain = [f"{one.found.host}/{one.found.name}" if one.found.host else one.found.name for one in members]
    return {
        one.key: short if plain.count(short) == 1 else word
        for one, short, word in zip(members, plain, apart, strict=True)
    }


# ------------------------------------------------------------------------------------------------------- on a terminal


def _show_in_place(fleet: "Fleet", pattern: str) -> None:
    """Paint the lines anew each second, and what is new at once."""
    height, painted_s, number = 0, 0.0, -1
    drawn = drawing(sys.stdout)
    fleet.wait_ready(2.0)
    while True:
        found = fleet.wait(number, PERIOD_S)
        number = found.number
        time.sleep(max(0.0, painted_s + 0.1 - time.monotonic()))  # many that come at once are painted once
        painted_s = time.monotonic()
        width, room = shutil.get_terminal_size()
        lines = screen_lines(found, meant(found, pattern), room - 1, painted_s, time.time_ns())
        up = UP.format(height) if height else ""
        drawn.write(up + "".join(f"{printable(line)[: width - 1]}{CLEAR_LINE}\n" for line in lines) + CLEAR_BELOW)
        drawn.flush()
        height = len(lines)


def screen_lines(found: "FleetNow", chosen: "Sequence[Member]", room: int, now_s: float, now_ns: int) -> list[str]:
    """Return at most `room` lines: the loggers, the worst first, then what can't be reached and how many there are."""
    names = addresses(found)
    from silo.fleet.member import segments
    from silo.fleet.near import unreachable_text

    notes = [unreachable_text(name, why).replace("\n", " ") for name, why in found.unreachable.items()]
    down = segments(chosen)
    notes = [*(one.words(now_s, now_ns) for one in down), *(one.words for one in found.routers), *notes]
    counts = [f"{sum(one.word == word for one in chosen)} {word}" for word in dict.fromkeys(o.word for o in chosen)]
    total = f"{many(len(chosen), 'logger')}{': ' if counts else ''}{', '.join(counts)}; Ctrl-C ends"
    hosts = {one.host for one in down}
    each = [one for one in chosen if not (one.lost and one.found.host in hosts)]  # a line for all the others
    most = max(1, room - len(notes) - 2)
    shown = each[:most] if len(each) <= most else each[: most - 1]
    rows = [HEADER, *(_cells(one, names[one.key], now_s, now_ns) for one in shown)]
    more = [f"and {len(each) - len(shown)} more that are no worse"] if len(shown) < len(each) else []
    return [*(aligned(rows, RIGHT) if shown else []), *more, *notes, total][: max(1, room)]


def _cells(one: "Member", name: str, now_s: float, now_ns: int) -> tuple[str, ...]:
    from silo.core.quantities.writing import idle_words

    told, run_s, unseen_s = one.summary, one.run_s(now_ns), one.unseen_s(now_s)
    if told is None:
        seen = duration_text(unseen_s) if not one.here else "now"
        return (name, one.word, *["-"] * 4, one.sign, seen, one.problem.split("\n")[0])
    seen = "now" if one.here else f"{duration_text(unseen_s)} ago"
    alarms = f" {told.alarms}" if one.sign and one.sign == told.alarm else ""
    idle = [idle_words(one.idle_s(now_s))] if one.stalled else []
    idle += [f"DENIED {told.denied}"] if told.denied else []
    what = " ".join([*idle, *one.people]) if one.here and not one.dead else _after(one)
    return (
        name, one.word, duration_text(run_s) if run_s is not None else "-",
        one.rate, count(one.lost_count) if one.lost_count is not None else "-",
        size_text(told.disk_free_bytes) if told.disk_bytes else "-", f"{one.sign}{alarms}", seen, what,
    )  # fmt: skip


def _after(one: "Member") -> str:
    """What is known of one that is gone, or dead."""
    assert one.summary is not None
    return f"was {one.summary.state.value}" if one.lost else one.summary.reason


# ----------------------------------------------------------------------------------------------------------- in a pipe


def _tell_changes(fleet: "Fleet", pattern: str, *, as_json: bool) -> None:
    """Print what changes, one line for each logger that does."""
    from silo.fleet.near import unreachable_text

    known: dict[str, Known] = {}
    told: dict[str, str] = {}
    refused: dict[str, int] = {}
    number = -1
    while True:
        found = fleet.wait(number, 3600.0)
        number, now_s = found.number, time.monotonic()
        lines = [unreachable_text(name, why) for name, why in found.unreachable.items() if told.get(name) != why]
        told = dict(found.unreachable)
        lines += [printable(one.words) for one in found.routers if one.denied > refused.get(one.host, 0)]
        refused = {router.host: router.denied for router in found.routers}
        chosen = meant(found, pattern)
        news = list(changed(found, chosen, known))
        if as_json:
            for name, one in news:
                show_json(_object(name, one, now_s))
        else:
            for line in [*lines, *map(printable, told_lines(news, chosen, now_s, time.time_ns()))]:
                click.echo(f"{wall_clock(time.time_ns())}  {line}")
        print(end="", flush=True)


def told_lines(
    news: "Sequence[tuple[str, Member]]", chosen: "Sequence[Member]", now_s: float, now_ns: int
) -> list[str]:
    """Return a line for each logger that says something new; one for all of a host of which several fell silent."""
    from silo.fleet.member import segments

    fell = {one.found.host for _, one in news if one.lost}
    down = {one.host: one for one in segments(chosen) if one.host in fell}
    lines = [one.words(now_s, now_ns) for one in down.values()]
    return lines + [f"{name}  {sentence(one)}" for name, one in news if not (one.lost and one.found.host in down)]


def changed(found: "FleetNow", chosen: "Sequence[Member]", known: "dict[str, Known]") -> "Iterator[tuple[str, Member]]":
    """Yield those that say something else than what is known, which is noted."""
    names = addresses(found)
    for one in chosen:
        told = one.summary
        if told is None and not one.problem and one.here:
            continue  # it has come just now, and tells more in a moment
        before = known.get(one.key)
        hz = told.measured_hz if told is not None and one.running else 0.0
        if before is not None and abs(hz - before[0]) <= STEADY_SHARE * hz:
            hz = before[0]
        denied = told.denied if told is not None else 0
        facts = (told.lost, told.alarm, told.alarms, told.recorders, told.saved, told.reason) if told else ()
        known[one.key] = now = (hz, denied, (one.word, one.problem, *facts, *one.people))
        # what was denied an hour ago is no longer counted, which is no news
        if before is None or (now[0], now[2]) != (before[0], before[2]) or denied > before[1]:
            yield names[one.key], one


def sentence(one: "Member") -> str:
    """Return all that is known of a logger in a line."""
    from silo.core.quantities.writing import idle_words

    told = one.summary
    if told is None:
        return f"{one.word}{f': {one.problem}' if one.problem else ''}".replace("\n", " ")
    word = f"{told.state.value}, {idle_words(told.idle_s)}" if one.stalled else one.word
    parts = [word if not one.lost else f"silent, was {told.state.value}"]
    parts += [f"{one.rate} Hz"] if one.running and not one.stalled else []
    parts += [f"lost {one.lost_count}"] if one.lost_count is not None else []
    parts += [f"{size_text(told.disk_free_bytes)} free"] if told.disk_bytes else []
    parts += [f"{told.alarm} {told.alarms}"] if told.alarms else []
    parts += [f"REC {told.recorders}"] if told.recorders else []
    parts += [f"DENIED {told.denied}"] if told.denied else []
    parts += [" ".join(one.people)] if one.people else []
    parts += [told.reason] if told.reason and not one.running else []
    return "  ".join(parts).replace("\n", " ")


def _object(name: str, one: "Member", now_s: float) -> dict[str, Any]:
    told = one.summary
    shown: dict[str, Any] = {
        "time_ns": time.time_ns(), "address": name, "logger": one.found.name, "host": one.found.host,
        "state": one.word, "here": one.here, "unseen_s": round(one.unseen_s(now_s), 1), "sign": one.sign,
    }  # fmt: skip
    if one.problem:
        shown["error"] = one.problem
    if told is not None:
        shown["last_state"] = told.state
        shown |= {field: getattr(told, field) for field in told.__struct_fields__ if field not in ("state", "closed")}
    return shown
