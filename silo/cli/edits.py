"""`silo set`: settings as words, elements by pattern, one transaction."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from silo.cli.common import (
    complete_words,
    connect,
    show_rows,
    split_logger,
    tell_viewers,
    unknown_logger,
    unsaved,
    unsaved_options,
)
from silo.core.names import Names, matching
from silo.core.quantities.writing import duration, many
from silo.errors import ElementError, RefusedError
from silo.settings.typed import (
    ElementSettings,
    apply_settings,
    completions,
    diff_options,
    help_rows,
    is_setting,
    rate_words,
    read_settings,
)

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.elements import Edit, ElementInfo, ElementOptions, FieldChange, Table
    from silo.state.requests import EditsApplied

MOST_CHANGES = 100  # of 10,000 elements, nobody reads each; `--dry-run` shows all

_HELP = """Change how elements are logged: all of them or none, and only while the logger is stopped, or at a cut.

PATTERN is an element, a namespace or a glob. SETTING is one of

\b
{settings}

\b
Examples:
  silo set demo /log/base '*/torque' divider=5 size=10s
  silo set '*/encoder_count' off --dry-run
  silo set demo '*/torque' divider=1 --cut
""".format(settings="\n".join(f"  {example:<16}  {meaning}" for example, meaning in help_rows()))


def split_settings(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Patterns, and settings: these hold a `=`, or are `on` or `off`."""
    settings = [word for word in words if is_setting(word)]
    return [word for word in words if word not in settings], settings


def complete_set(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """A logger first, then its elements, then settings."""
    words = ctx.params.get(param.name or "") or ()
    settings = [CompletionItem(word) for word in completions(incomplete)] if words else []
    return [*complete_words(ctx, param, incomplete), *settings]


def select(names: Sequence[str], patterns: Sequence[str], prefix: str = "") -> list[int]:
    """Return the places of the elements that patterns mean. Raises ElementError for one that means nothing."""
    known = Names(names, prefix)
    chosen: set[int] = set()
    for pattern in patterns:
        found = known.every(pattern)
        if not found:
            # who mistypes the logger has its name looked for in the only one there is
            nor = "; no logger of that name runs here: `silo ls`" if pattern == patterns[0] and patterns[1:] else ""
            raise ElementError(f"no element matches '{pattern}'{known.hint(pattern, '`silo info -e` lists them')}{nor}")
        if (later := known.find(pattern)) and found != later:
            click.echo(
                f"'{pattern}' means {many(len(found), 'element')} here, from the next release on "
                f"'{known.name(later[0])}'{f' and {len(later) - 1} more' if len(later) > 1 else ''}: "
                f"write '*/{pattern}' for all",
                err=True,
            )
        chosen.update(place for place, _ in found)
    return sorted(chosen)


def of_entries(elements: "Sequence[ElementInfo]", patterns: Sequence[str]) -> tuple[list[str], list[str]]:
    """Patterns with the element in place of an entry of it (`joints/q_3`), and what is to be told of that."""
    known = Names.of(elements)
    made, told = [], []
    for pattern in patterns:
        found = [] if known.find(pattern) else known.find(pattern, scalars=True)
        owner = list(dict.fromkeys(known.names[place] for place, _ in found))
        made += owner or [pattern]
        told += [f"'{pattern}' is of '{one}', which is shown as a whole" for one in owner]
    return made, told


@click.command("set", help=_HELP)
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] PATTERN... SETTING...", shell_complete=complete_set)
@click.option("-n", "--dry-run", is_flag=True, help="Only show what would change.")
@click.option("--restart", is_flag=True, help="If it runs: stop it, change, start again (this clears the buffers).")
@click.option("--cut", is_flag=True, help="If it runs: apply and go on, without a tick between.")
@unsaved_options
def set_command(
    words: tuple[str, ...], dry_run: bool, restart: bool, cut: bool, save_first: bool, discard: bool
) -> None:
    """Change how elements are logged; for the shell, `_HELP` says how."""
    from silo.core.elements import Edit

    logger, rest = split_logger(words, or_pattern=True)
    patterns, settings_words = split_settings(rest)
    if not patterns or not settings_words:
        raise unknown_logger(logger) or click.UsageError(
            "give a pattern and a setting: silo set demo '*/torque' divider=5"
        )
    if cut and restart:
        raise click.UsageError("--cut goes on with the run, --restart ends it: give one of them")
    settings = read_settings(settings_words)
    chosen = unsaved(save_first=save_first, discard=discard)
    with connect(logger) as client:
        status, table = client.status(), client.table()
        _refuse_derived(table, patterns)
        _refuse_entries(table, patterns, client.found.label)
        places = select([element.name for element in table.elements], patterns, status.prefix)
        meant = [table.elements[place] for place in places]
        options = apply_settings(settings, [(element.name, element.options) for element in meant], status.frequency_hz)
        changes = diff_options(meant, options)
        edits = [Edit(e.name, new) for e, new in zip(meant, options, strict=True) if e.options != new]
        what = f"{many(len(edits), 'element')} of {len(meant)} that match"
        if not edits:
            click.echo(f"nothing to change: {many(len(meant), 'element')} already as asked for")
            return
        if dry_run:
            _tell_rate(settings, options, status.frequency_hz)
            show_changes(changes)
            click.echo(f"would change {what}")
            return
        applied = _apply(client, edits, table.revision, cut=cut)
        runs = applied is None
        if applied is None:
            tell_viewers(client)
            if not restart:
                raise RefusedError(
                    f"logger '{status.logger}' is running: `silo stop {client.found.label}` first, or add --restart "
                    "(its buffers are cleared by a start: `silo save` before), or --cut (it goes on as changed); "
                    "nothing was changed"
                )
            if chosen == "refuse" and status.run_ticks and not status.saved:
                raise RefusedError(
                    f"logger '{status.logger}' holds {many(status.held_samples, 'sample')} of up to "
                    f"{duration(status.held_s)}, of which some are in no file, and a restart clears them: add --save "
                    "or --discard; nothing was changed"
                )
            client.stop()
            try:
                applied = client.apply(edits, table.revision)
            finally:
                client.start(chosen, click.echo)
        _tell_rate(settings, options, status.frequency_hz)
        for warning in applied.warnings:
            click.echo(warning, err=True)
        show_changes(changes[:MOST_CHANGES])
        if len(changes) > MOST_CHANGES:
            click.echo(f"... and {many(len(changes) - MOST_CHANGES, 'more change')}")
        click.echo(f"changed {what} (revision {applied.revision}){'; logging again' if runs else ''}")


def _apply(client: "Client", edits: "Sequence[Edit]", revision: int, *, cut: bool) -> "EditsApplied | None":
    """Return what became of edits; None where the logger runs, which it alone knows: it may have started just now."""
    from silo.rpc.refusals import RefusedWhy, RequestRefusedError

    try:
        return client.apply(edits, revision, cut=cut)
    except RequestRefusedError as refused:
        if cut or refused.why is not RefusedWhy.RUNNING:
            raise
        return None


def _tell_rate(settings: ElementSettings, options: "Sequence[ElementOptions]", frequency_hz: float) -> None:
    """What became of a rate; not before it is known that it becomes that."""
    if words := rate_words(settings, options[0].divider, frequency_hz):
        click.echo(words, err=True)


def _refuse_derived(table: "Table", patterns: Sequence[str]) -> None:
    """Raises ElementError for a pattern that means derived signals alone."""
    names, derived = [info.name for info in table.elements], [info.name for info in table.derived]
    for pattern in patterns if derived else ():
        if not matching(names, [pattern]) and (found := matching(derived, [pattern])):
            raise ElementError(
                f"'{found[0]}' is derived from others, and has no divider, buffer or action of its own: set those, or "
                f"give it another expression (`silo derive {found[0]} 'EXPRESSION'`); nothing was changed"
            )


def _refuse_entries(table: "Table", patterns: Sequence[str], logger: str) -> None:
    """Raises ElementError for a pattern that means entries of elements, which have no settings of their own."""
    for pattern in patterns:
        elements, told = of_entries(table.elements, [pattern])
        if told:
            raise ElementError(
                f"'{pattern}' is an entry of '{elements[0]}', which has one divider, action and buffer for all its "
                f"entries: `silo set {logger} {elements[0]} ...` sets the element; nothing was changed"
            )


def show_changes(changes: "Sequence[FieldChange]") -> None:
    """Print differences, one per line: element, field, old and new value."""
    show_rows([(change.name, change.field, change.old, "->", change.new) for change in changes])
