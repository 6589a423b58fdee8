"""`silo set`: settings as words, elements by pattern, one transaction."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from fnmatch import translate
from typing import TYPE_CHECKING

import click

from silo.cli.common import complete_words, connect, many, show_rows, split_logger
from silo.errors import ElementError, RefusedError
from silo.model import MAX_BUFFER_SIZE, MAX_DIVIDER, Action, BufferType, ElementOptions, buffer_size_for

if TYPE_CHECKING:
    from silo.ipc.client import Client
    from silo.model import FieldChange

MOST_CHANGES = 100  # of 10,000 elements, nobody reads each; `--dry-run` shows all

_TIME = re.compile(r"([0-9]*\.?[0-9]+)(ms|s|min|h)")
_SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
_SWITCHES = {"on": True, "off": False, "true": True, "false": False, "yes": True, "no": False}
_KEYS = ("divider", "buffer", "size", "action", "enabled")


@dataclass(frozen=True)
class Settings:
    """What the words of `silo set` ask for; None leaves a field as it is. `size_s` is a size given as a time."""

    enabled: bool | None = None
    divider: int | None = None
    action: Action | None = None
    buffer_type: BufferType | None = None
    size: int | None = None
    size_s: float | None = None

    def apply(self, now: ElementOptions, frequency_hz: float) -> ElementOptions:
        """The options of an element under these settings; a size given as a time follows the divider."""
        divider = now.divider if self.divider is None else self.divider
        size = now.buffer_size if self.size is None else self.size
        if self.size_s is not None:
            size = buffer_size_for(self.size_s, frequency_hz, divider)
        return ElementOptions(
            now.enabled if self.enabled is None else self.enabled,
            divider,
            now.action if self.action is None else self.action,
            now.buffer_type if self.buffer_type is None else self.buffer_type,
            size,
        )


def split_settings(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Patterns, and settings: these hold a `=`, or are `on` or `off`."""
    settings = [word for word in words if "=" in word or word in ("on", "off")]
    return [word for word in words if word not in settings], settings


def parse_settings(words: Sequence[str]) -> Settings:
    """The settings in words such as `divider=5`, `size=10s`, `on`. Raises ElementError that names the word."""
    settings = Settings()
    for word in words:
        key, _, value = word.partition("=") if "=" in word else ("enabled", "", word)
        settings = _with(settings, key.strip().lower(), value.strip(), word)
    return settings


def _with(settings: Settings, key: str, value: str, word: str) -> Settings:
    from silo.settings.script import member_of

    if key == "enabled":
        if value.lower() not in _SWITCHES:
            raise ElementError(f"'{word}': enabled must be on or off; nothing was changed")
        return replace(settings, enabled=_SWITCHES[value.lower()])
    if key == "divider":
        return replace(settings, divider=_whole(value, word, "divider", MAX_DIVIDER))
    if key == "size":
        time = _TIME.fullmatch(value)
        if time is None:
            return replace(settings, size=_whole(value, word, "size", MAX_BUFFER_SIZE), size_s=None)
        return replace(settings, size=None, size_s=float(time[1]) * _SECONDS[time[2]])
    if key == "buffer":
        buffer = member_of(BufferType, value)
        if buffer is None:
            raise ElementError(f"'{word}': buffer must be fixed, looping or growing; nothing was changed")
        return replace(settings, buffer_type=buffer)
    if key == "action":
        action = Action.SAVE_AND_PUBLISH if value.lower() == "both" else member_of(Action, value)
        if action is None:
            raise ElementError(
                f"'{word}': action must be save, publish (live only) or both (save_and_publish); nothing was changed"
            )
        return replace(settings, action=action)
    near = get_close_matches(key, _KEYS, 1)
    hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(_KEYS)}"
    raise ElementError(f"'{word}': no setting '{key}'; {hint}")


def _whole(value: str, word: str, field: str, highest: int) -> int:
    number = int(value) if re.fullmatch(r"[0-9]{1,12}", value) else 0
    if not 1 <= number <= highest:
        times = ", or a time such as 10s" if field == "size" else ""
        raise ElementError(f"'{word}': {field} must be a whole number from 1 to {highest}{times}; nothing was changed")
    return number


def select(names: Sequence[str], patterns: Sequence[str]) -> list[int]:
    """Places of the elements that a pattern names: an element, a namespace, or a glob (`*` crosses `/`).

    A pattern that doesn't begin with `/` or `*` may begin anywhere behind a `/`. Raises ElementError for a pattern
    that names nothing.
    """
    chosen: set[int] = set()
    for pattern in patterns:
        anchored = pattern if pattern.startswith(("/", "*")) else f"*/{pattern}"
        anchored = anchored.rstrip("/") or "/*"
        matcher = re.compile(f"{translate(anchored)}|{translate(anchored + '/*')}")
        found = [place for place, name in enumerate(names) if matcher.match(name)]
        if not found:
            near = get_close_matches(pattern, names, 1, cutoff=0.5)
            hint = f"; did you mean '{near[0]}'?" if near else "; `silo info -e` lists them"
            raise ElementError(f"no element matches '{pattern}'{hint}")
        chosen.update(found)
    return sorted(chosen)


@click.command("set")
@click.argument(
    "words", nargs=-1, required=True, metavar="[LOGGER] PATTERN... SETTING...", shell_complete=complete_words
)
@click.option("-n", "--dry-run", is_flag=True, help="Only show what would change.")
@click.option("--restart", is_flag=True, help="If it runs: stop it, change, start again (this clears the buffers).")
def set_command(words: tuple[str, ...], dry_run: bool, restart: bool) -> None:
    """Change how elements are logged: all of them or none, and only while the logger is stopped.

    PATTERN is an element, a namespace or a glob. SETTING is one of

    \b
      on, off           log it or not
      divider=5         every fifth tick
      buffer=looping    fixed (first samples), looping (newest), growing (all)
      size=1000         samples; or a time: size=10s, size=5min
      action=both       save, publish (live only), both

    \b
    Examples:
      silo set demo /log/base '*/torque' divider=5 size=10s
      silo set '*/encoder_count' off --dry-run
    """
    logger, rest = split_logger(words, or_pattern=True)
    patterns, settings_words = split_settings(rest)
    if not patterns or not settings_words:
        raise click.UsageError("give a pattern and a setting: silo set demo '*/torque' divider=5")
    settings = parse_settings(settings_words)
    with connect(logger) as client:
        _set(client, patterns, settings, dry_run=dry_run, restart=restart)


def _set(client: "Client", patterns: Sequence[str], settings: Settings, *, dry_run: bool, restart: bool) -> None:
    from silo.model import Edit, State
    from silo.settings.script import diff_options

    status, table = client.status(), client.table()
    places = select([element.name for element in table.elements], patterns)
    chosen = [table.elements[place] for place in places]
    options = [settings.apply(element.options, status.frequency_hz) for element in chosen]
    changes = diff_options(chosen, options)
    edits = [Edit(e.name, new) for e, new in zip(chosen, options, strict=True) if e.options != new]
    what = f"{many(len(edits), 'element')} of {len(chosen)} that match"
    if not edits:
        click.echo(f"nothing to change: {many(len(chosen), 'element')} already as asked for")
        return
    if dry_run:
        show_changes(changes)
        click.echo(f"would change {what}")
        return
    runs = status.state is State.RUNNING
    if runs and not restart:
        raise RefusedError(
            f"logger '{status.logger}' is running: `silo stop {status.logger}` first, or add --restart "
            "(its buffers are cleared by a start: `silo save` before); nothing was changed"
        )
    if runs:
        client.stop()
    try:
        applied = client.apply(edits, table.revision)
    finally:
        if runs:
            client.start()
    show_changes(changes[:MOST_CHANGES])
    if len(changes) > MOST_CHANGES:
        click.echo(f"... and {len(changes) - MOST_CHANGES} more changes")
    click.echo(f"changed {what} (revision {applied.revision}){'; logging again' if runs else ''}")


def show_changes(changes: "Sequence[FieldChange]") -> None:
    """Print differences, one per line: element, field, old and new value."""
    show_rows([(change.name, change.field, change.old, "->", change.new) for change in changes])
