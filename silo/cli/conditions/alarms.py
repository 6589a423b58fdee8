"""`silo alarms`: which signals are, or were in this run, beyond their limits, with an exit code for scripts."""

import time
from typing import TYPE_CHECKING

import click

from silo.cli.codes import EXIT_BLIND, EXIT_FOUND
from silo.cli.common import connect, json_option, logger_argument, show_json, show_rows
from silo.core.quantities.writing import duration, whole_duration

if TYPE_CHECKING:
    from silo.conditions.requests import Alarms
    from silo.conditions.standing import LimitStatus

FOLLOW_S = 0.5


@click.command("alarms")
@logger_argument
@click.option("-f", "--follow", is_flag=True, help="Go on: a line for each change, until Ctrl-C.")
@click.option("-a", "--all", "all_limits", is_flag=True, help="List signals that never were beyond, too.")
@click.option("--seen", is_flag=True, help="Acknowledge all alarms, in your name.")
@json_option
def alarms(logger: str | None, follow: bool, all_limits: bool, seen: bool, as_json: bool) -> int:
    """Show which signals are, or were in this run, beyond their limits, worst first. Every sample counts.

    HH and LL are beyond red, H and L beyond yellow, == is stale, ~~ blind (it can't be told), OK is well again.

    \b
    Examples:
      silo alarms demo || echo 'something was beyond its limits'
      silo alarms demo --follow --json

    \b
    Exit codes:
      0  nothing was violated in this run        4  something was
      5  nothing was that could be judged, but some limits are blind        3  no such logger
    """
    with connect(logger) as client:
        if seen:
            click.echo(client.acknowledge(), err=as_json)
        found = client.alarms()
        if not follow:
            status = client.status()
            now_ns = time.time_ns() if status.state.value == "running" else status.last_tick_ns
            _show(found, now_ns, all_limits=all_limits, as_json=as_json)
            return _code(found)
        known: dict[str, LimitStatus] = {}
        try:
            while True:
                known = _show_changes(found, known, as_json=as_json)
                time.sleep(FOLLOW_S)
                found = client.alarms()
        except KeyboardInterrupt:
            return _code(found)


def _code(found: "Alarms") -> int:
    if any(one.violated for one in found.limits):
        return EXIT_FOUND
    return EXIT_BLIND if any(one.word.value == "~~" for one in found.limits) else 0


def _show(found: "Alarms", now_ns: int, *, all_limits: bool, as_json: bool) -> None:
    shown = [one for one in found.limits if all_limits or one.violated or one.why]
    if as_json:
        show_json({"run": found.run, "tick": found.tick, "limits": found.limits if all_limits else shown})
        return
    if not found.limits:
        click.echo(
            "no limits: log.limit('joints/tau', (-40, -30, 30, 40)) in the program, or in the script\n"
            "signal_limits:\n  - {name: joints/tau, bounds: [-40, -30, 30, 40]}"
        )
        return
    header = ("!", "SIGNAL", "VALUE", "LIMIT", "WORST", "FOR", "COUNT", "SEEN BY")
    if shown:
        show_rows([header, *(_row(one, now_ns) for one in shown)], right=(2, 3, 4, 5, 6))
    for one in shown:
        if one.why:
            click.echo(f"{one.name} is blind: {one.why}")
    click.echo(alarms_text(found.limits))


def _row(one: "LimitStatus", now_ns: int) -> tuple[str, ...]:
    return (
        one.word.value, one.name, _number(one.value), _number(one.limit),
        f"{one.worst_word.value} {_number(one.worst)}" if one.worst is not None else "",
        _lasted(one, now_ns),
        str(_count(one) or ""),
        one.seen,
    )  # fmt: skip


def _lasted(one: "LimitStatus", now_ns: int) -> str:
    """For how long; that of a logger that doesn't run ends with its newest tick."""
    lasted_s = one.lasted_s(now_ns)
    return "" if lasted_s is None else whole_duration(lasted_s) if one.is_over else duration(lasted_s)


def _count(one: "LimitStatus") -> int:
    return one.count + one.stale_count


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def alarms_text(found: "list[LimitStatus]") -> str:
    """Return how many signals are beyond their limits, in a line."""
    now = sum(one.is_over for one in found)
    over = sum(one.violated and not one.is_over for one in found)
    blind = sum(one.word.value == "~~" for one in found)
    watched = f"{len(found)} watched{f', {blind} blind' if blind else ''}"
    if not now and not over and blind:
        judged = len(found) - blind
        what = f"nothing of the {judged} that could be judged was beyond its limits" if judged else "nothing was judged"
        return f"{what} in this run ({watched})"
    if not now and not over:
        return f"nothing was beyond its limits in this run ({watched})"
    return f"{now} beyond now, {over} well again ({watched})"


def _show_changes(found: "Alarms", known: "dict[str, LimitStatus]", *, as_json: bool) -> "dict[str, LimitStatus]":
    """Print what differs from what was shown before, a line each; returns what is known now."""
    for one in found.limits:
        before = known.get(one.name)
        told = before is not None and (before.word, before.count, before.stale_count, before.alarm) == (
            one.word, one.count, one.stale_count, one.alarm)  # fmt: skip
        if told or (before is None and not one.violated and not one.why):
            continue
        if as_json:
            show_json(one)
        else:
            unit = "" if one.unit in ("", "-") else f" {one.unit}"
            value = f" {_number(one.value)}{unit}" if one.value is not None else ""
            worst = f", worst {_number(one.worst)}{unit}" if one.worst is not None else ""
            count = f", {_count(one)}x" if _count(one) else ""
            why = f": {one.why}" if one.why else ""
            click.echo(f"{one.word.value} {one.name}{value}{worst}{count}{why}")
    print(end="", flush=True)
    return {one.name: one for one in found.limits}
