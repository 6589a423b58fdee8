"""One command for many loggers, where that is said so: `--all`, or a glob that is affirmed. One answer per logger."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from silo.cli.common import ask_first, discovered, read_only, show_json, tell_unreachable
from silo.core.quantities.writing import many
from silo.errors import ConnectionLostError, SiloError

if TYPE_CHECKING:
    from silo.client.bulk import Job
    from silo.net.found import LoggerAddress


def everyone_option(command: "Callable[..., object]") -> "Callable[..., object]":
    """Return the option `--all`, to be read by `many_meant`."""
    words = "All that LOGGER means: a glob like 'robot*/anymal', or every logger."
    return click.option("--all", "everyone", is_flag=True, help=words)(command)


def many_meant(verb: str, logger: str | None, *, everyone: bool) -> "list[LoggerAddress] | None":
    """Return the loggers that a glob or `--all` means; None where one is meant, as ever.

    A glob without `--all` names them and asks on a terminal. Raises UsageError where nobody can be asked, Abort for no,
    ConnectionLostError where there is none.
    """
    from silo.core.names import is_glob
    from silo.fleet.resolving import not_found_text
    from silo.net.found import logger_of, told_apart

    pattern = logger_of(logger or "")
    if not everyone and not is_glob(pattern):
        return None
    discovery = discovered()
    found = discovery.matching(pattern)
    if not found:
        raise ConnectionLostError(not_found_text(pattern, discovery))
    if not everyone:
        named = f"'{pattern}' means {many(len(found), 'logger')}: {', '.join(told_apart(found))}"
        what = f"{verb} {'it' if len(found) == 1 else 'all of them'}"
        ask_first(f"{named}\n{what}?", f"{named}; say --all to {what}; nothing was asked")
    return found


def carry_out(verb: str, found: "Sequence[LoggerAddress]", job: "Job", *, as_json: bool = False) -> None:
    """Ask all of them, and print an answer for each as it comes.

    Raises SiloError where one of them did not, or where a remote wasn't reached that may have more.
    """
    from silo.client.bulk import outcomes
    from silo.net.found import told_apart

    names = told_apart(found)
    width = max(map(len, names))
    failed, shown = [], []
    for outcome in outcomes(found, job, read_only=read_only()):
        name = names[outcome.place]
        if not outcome.done:
            failed.append(name)
        if as_json:
            shown.append({"logger": name, "done": outcome.done, "text": outcome.text, "files": outcome.files})
        else:
            sign = " " if outcome.done else "!"
            click.echo(f"{sign} {name:<{width}}  {outcome.text}")
    if as_json:
        show_json(sorted(shown, key=lambda one: str(one["logger"])))
    discovery = discovered()
    tell_unreachable(discovery.unreachable)
    if failed:
        raise SiloError(
            f"{verb}: {len(found) - len(failed)} of {many(len(found), 'logger')} did, {', '.join(failed)} not"
        )
    if discovery.unreachable:
        raise SiloError(f"{verb}: all that were seen did; not reached: {', '.join(discovery.unreachable)}")
