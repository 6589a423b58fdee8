"""`silo script`: the YAML files that say how each element is logged. They lie on the robot's side."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.bulk import carry_out, everyone_option, many_meant
from silo.cli.codes import EXIT_FOUND
from silo.cli.common import TypedPath, complete_logger, complete_script, connect, discovered, json_option, show
from silo.cli.edits import show_changes
from silo.cli.verbs import Target, Verbs, Words, target, verb
from silo.core.quantities.writing import and_more, many

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.scripts.requests import ScriptDiff, Scripts
    from silo.settings.script import Script


@click.group(cls=Verbs)
def script() -> None:
    """Show, check, load, save scripts; `diff` compares one with the logger.

    Paths of show, load, save and diff are on the robot's side, inside the folder of the logger's script; without a path
    the logger's own script is meant. A word that ends in .yaml or .yml is a path, another one a logger.
    """


def _by_path(ctx: click.Context, words: Sequence[str], usage: str) -> Target:
    """Take logger and path, either of which may be missing. A word with a `/` may be an address."""
    from silo.core.names import is_glob

    def is_path(word: str) -> bool:
        return word.endswith((".yaml", ".yml")) or (
            "/" in word and not is_glob(word) and "~" not in word and not discovered().named(word)
        )

    paths = [word for word in words if is_path(word)]
    loggers = [word for word in words if word not in paths]
    if len(paths) > 1 or len(loggers) > 1:
        raise click.UsageError("give at most one logger and one path (ending in .yaml or .yml)", ctx)
    return Target(loggers[0] if loggers else None, paths or [""])


_BY_PATH = Words(_by_path, complete_script)
_logger_and_path = target("[PATH]", _BY_PATH)


def _show_list(scripts: "Scripts") -> None:
    click.echo(f"{scripts.folder}:")
    for name in scripts.names:
        click.echo(f"  {name}{'  (in use)' if name == scripts.current else ''}")
    if not scripts.names:
        click.echo("  no scripts yet; `silo script save` writes one")


@verb(script, "list", shown=_show_list)
def list_command(client: "Client") -> "Scripts":
    """List the scripts on the robot's side.

    \b
    Example:
      silo script list demo
    """
    return client.scripts()


@verb(script, "show", "[PATH]", _BY_PATH, short="Print a script, or the present configuration as one.")
def show_command(client: "Client", path: str) -> None:
    """Print a script; without PATH, the present configuration as a script.

    \b
    Examples:
      silo script show demo > mine.yaml
      silo script show demo walk.yaml
    """
    text = client.read_script(path).text
    terminal = sys.stdout is not None and sys.stdout.isatty()  # None where the shell closed it
    click.echo(text if terminal else text.encode(), nl=False)  # into a file as it is there, to the last byte


@script.command(short_help="Check a script of this computer.")
@click.argument("path", type=TypedPath(path_type=Path))
@click.option("-l", "--logger", metavar="LOGGER", shell_complete=complete_logger, help="Check names against its table.")
def check(path: Path, logger: str | None) -> int:
    """Check a script of this computer; with --logger also whether its elements exist, and what it says of them fits.

    Every problem is told with its line. Exit code 1 if there are any, 4 for warnings: unknown keys, what is off by a
    missing one, names that are none.

    \b
    Examples:
      silo script check config/demo.yaml
      silo script check config/demo.yaml --logger demo
    """
    from silo.core.conditions import Conditions, Derived
    from silo.errors import ScriptError
    from silo.settings.script import apply_script, read_script, script_conditions

    found = read_script(path)
    warnings = [*found.warnings, *(_doubtful_names(found) if logger is None else ())]
    if logger is not None:
        with connect(logger) as client:
            table, status = client.table(), client.status()
        plan = apply_script(found, table.elements, status.frequency_hz, status.prefix)
        warnings += plan.rates
        derived = tuple(Derived(info.name, info.expression, info.unit) for info in table.derived)
        now = Conditions(derived=derived)
        script_conditions(found, now, table.elements, plan, status.prefix, status.frequency_hz)
        if plan.unknown:
            _warn(warnings)
            raise ScriptError("\n".join(f"{path}:{one}" for one in plan.unknown))
    _warn(warnings)
    elements = many(len(found.elements), "element")
    click.echo(f"{path}: {elements}, {many(len(warnings), 'warning')}" if warnings else f"{path}: fine, {elements}")
    return EXIT_FOUND if warnings else 0


def _doubtful_names(found: "Script") -> list[str]:
    """What a script lists under names that hardly any element has, whatever the logger."""
    return [
        f"{found.path}:{one.line}: element '{one.name}': names stand there whole, as `/log/joints/q`, each of its own"
        for one in found.elements
        if not one.name.startswith("/") or "*" in one.name
    ]


@script.command(short_help="Configure all elements by a script.")
@_logger_and_path
@click.option("-n", "--dry-run", is_flag=True, help="Only show what would change.")
@click.option("--cut", is_flag=True, help="If it runs: load and go on, without a tick between.")
@everyone_option
def load(words: Target, dry_run: bool, cut: bool, everyone: bool) -> None:
    """Configure all elements by a script; while the logger runs only with --cut: it goes on as changed.

    \b
    Examples:
      silo script load demo walk.yaml
      silo script load demo walk.yaml --dry-run
      silo script load demo walk.yaml --cut
      silo script load 'robot*/anymal' walk.yaml --all
    """
    logger, (path,) = words
    if dry_run and everyone:
        raise click.UsageError("--dry-run shows what one logger would change; leave out --all")
    if not dry_run and (found := many_meant("load the script for", logger, everyone=everyone)) is not None:
        from silo.client.bulk import loading

        carry_out("load", found, lambda client: loading(client, path, cut=cut))
        return
    with connect(logger) as client:
        if dry_run:
            _show_diff(client.diff_script(path))
            return
        applied = client.load_script(path, cut=cut)
    _warn(applied.warnings, applied.unknown)
    click.echo(f"loaded: {many(applied.changed, 'element')} changed (revision {applied.revision})")


@verb(script, "save", "[PATH]", _BY_PATH, short="Write the present configuration to a script.")
@click.option("-f", "--force", is_flag=True, help="Replace a script that exists.")
def save(client: "Client", path: str, force: bool) -> str:
    """Write the present configuration to a script on the robot's side.

    \b
    Examples:
      silo script save demo walk.yaml
      silo script save demo --force          (the logger's own script)
    """
    return client.save_script(path, overwrite=force)


@script.command(short_help="Show what loading a script would change.")
@_logger_and_path
@click.option("--exit-code", is_flag=True, help="Exit with 4 if there are differences.")
@json_option
def diff(words: Target, exit_code: bool, as_json: bool) -> int:
    """Show what loading a script would change.

    \b
    Examples:
      silo script diff demo
      silo script diff demo walk.yaml
    """
    logger, (path,) = words
    with connect(logger) as client:
        found = client.diff_script(path)
    show(found, as_json, lambda: _show_diff(found))
    return EXIT_FOUND if exit_code and (found.changes or found.conditions) else 0


def _show_diff(found: "ScriptDiff") -> None:
    show_changes([*found.changes, *found.conditions])
    _warn([*filter(None, [found.end]), *found.warnings], found.unknown)
    names = len({change.name for change in found.changes})
    others = len({change.name for change in found.conditions})
    told = [many(names, "element")] * bool(names)
    told += [f"{others} of derived signals, limits, triggers"] * bool(others)
    click.echo(f"{found.path}: {' and '.join(told)} would change" if told else f"{found.path}: no difference")


def _warn(warnings: Sequence[str], unknown: Sequence[str] = ()) -> None:
    """Say them, and which names of a script the logger doesn't have."""
    lacking = and_more([f"the script lists '{name}', which the logger doesn't have" for name in unknown], 20, "\n")
    for warning in [*warnings, *lacking.splitlines()]:
        click.echo(f"warning: {warning}", err=True)
