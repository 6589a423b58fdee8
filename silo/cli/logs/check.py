"""`silo check FILE`: limits and conditions judged on a log, with an exit code for scripts."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.codes import EXIT_BLIND, EXIT_FOUND
from silo.cli.common import LogWord, TypedPath, find_saved, show, show_rows
from silo.cli.logs.saved_logs import _read, _warn, whole_option
from silo.core.quantities.writing import count

if TYPE_CHECKING:
    from silo.analysis.check import Finding
    from silo.core.conditions import SignalLimits


@click.command("check")
@click.argument("file", type=LogWord())
@click.option("-l", "--limit", "limits", multiple=True, metavar="NAME=LIMITS",
              help="red_low,yellow_low,yellow_high,red_high of a signal; - for one that there isn't.")  # fmt: skip
@click.option("--when", default="", metavar="EXPRESSION", help="Judge the limits given here only where this holds.")
@click.option("--never", multiple=True, metavar="EXPRESSION", help="Must be true at no tick.")
@click.option("--always", multiple=True, metavar="EXPRESSION", help="Must be false at no tick.")
@click.option("--rules", metavar="FILE", type=TypedPath(path_type=Path), help="A YAML file of rules for whole runs.")
@click.option("--against", metavar="BASELINE", help="A run that was good: nothing may be newly missing, broken, lost.")
@whole_option
@click.option("--junit", "report", metavar="FILE", type=TypedPath(path_type=Path), help="Write a report for CI.")
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def check_command(
    file: str,
    limits: tuple[str, ...],
    when: str,
    never: tuple[str, ...],
    always: tuple[str, ...],
    rules: Path | None,
    against: str | None,
    whole: bool,
    report: Path | None,
    as_json: bool,
) -> int:
    """Judge a log by the limits that stand in it, and by what is given here. Every sample counts.

    \b
    Examples:
      silo check run.silo
      silo check run.silo --limit joints/tau=-40,-30,30,40 --when 'controller/mode == STANCE'
      silo check run.silo --never 'abs(base/roll) > 0.6' --always 'battery/voltage > 21V'
      silo check new.silo --against good.silo --rules rules.yaml --junit report.xml

    \b
    Exit codes:
      0  nothing was violated        4  something was
      5  nothing could be judged     1  the file or an expression can't be read
    """
    from silo.analysis.check import check
    from silo.guards.guard import guard, junit
    from silo.guards.rules import read_rules

    path, base = find_saved(file), None if against is None else find_saved(against)
    recording = _read(path, whole)
    baseline = None if base is None else _read(base, whole)
    held = [] if rules is None else read_rules(rules)
    asked = [*recording.conditions.limits, *(_limits(text, when) for text in limits)]
    if baseline is not None:  # what it broke, too, is nothing new
        asked = asked[len(recording.conditions.limits) :]
    if not (asked or never or always or held or baseline):
        raise click.UsageError(
            "the log has no limits: give some, --limit joints/tau=-40,-30,30,40 or --never 'abs(base/roll) > 0.6'"
        )
    found = check(recording, asked, never, always) + guard(recording, held, baseline)
    if report is not None:
        junit(report, file, found)
    show(found, as_json, lambda: _show(found))
    _warn(path, recording)
    if base is not None and baseline is not None:
        _warn(base, baseline)
    if any(one.violated for one in found):
        return EXIT_FOUND
    return EXIT_BLIND if all(one.worst == "UNOBSERVABLE" for one in found) else 0


def _limits(text: str, when: str) -> "SignalLimits":
    from silo.core.conditions import SignalLimits

    name, sign, rest = text.rpartition("=")
    words = [word.strip() for word in rest.split(",")]
    if not sign or not name.strip() or len(words) != 4:
        raise click.UsageError(
            f"'{text}' are no limits: write NAME=red_low,yellow_low,yellow_high,red_high, - for one that there isn't"
        )
    try:
        low, warn_low, warn_high, high = (None if word in ("-", "") else float(word) for word in words)
    except ValueError:
        raise click.UsageError(f"'{text}': a limit is a number, or - where there is none") from None
    return SignalLimits(name.strip(), bounds=(low, warn_low, warn_high, high), when=when)


def _show(found: "list[Finding]") -> None:
    worst_first = sorted(found, key=lambda one: (not one.violated, not one.worst.startswith(("RED", "VIOLATED"))))
    rows = [["what", "worst", "times", "samples", "first", "peak", "at"]]
    for one in worst_first:
        peak = "" if one.peak is None else f"{one.peak:.6g}{'' if one.unit in ('', '-') else ' ' + one.unit}"
        word = one.worst.lower().replace("_", " ") + (f", stale {one.stale}x" if one.stale else "")
        word += ", in part" if _in_part(one) else ""
        rows.append([
            one.what, word, count(one.violations), count(one.samples), _at(one.first_s), peak, _at(one.peak_s),
        ])  # fmt: skip
    show_rows(rows, right=(2, 3, 4, 5, 6))
    for one in worst_first:
        if one.why:
            told = one.violated or _in_part(one)
            click.echo(f"{one.what}: {one.why}" if told else f"{one.what} can't be told: {one.why}")
    violated = sum(one.violated for one in found)
    blind = sum(one.worst == "UNOBSERVABLE" for one in found)
    in_part = sum(map(_in_part, found))
    judged = f"{len(found) - blind} judged" + (f", {in_part} of them in part" if in_part else "")
    judged += f", {blind} unobservable" if blind else ""
    click.echo(f"{violated} of {len(found)} violated" if violated else f"nothing violated ({judged})")
    print(end="", flush=True)


def _in_part(one: "Finding") -> bool:
    """Whether some of it could not be judged, and some could."""
    return bool(one.missing) and one.worst != "UNOBSERVABLE"


def _at(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.6g} s"
