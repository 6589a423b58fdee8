"""`silo address`: how a program in any language reaches a logger or a topic."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from silo.cli.common import TypedPath, complete_words, connect, discovered, json_option, show, split_logger
from silo.core.runtime import write_private
from silo.errors import ConnectionLostError, SaveError, reason

SECRET = ("password", "_private_key_base64")  # how keys end whose values are nobody else's
LEFT_OUT = "..."


@click.command()
@click.argument("words", nargs=-1, metavar="[LOGGER] [ELEMENT]", shell_complete=complete_words)
@click.option("--zenoh", is_flag=True, help="Only the configuration for Zenoh, without a password.")
@click.option(
    "--to",
    type=TypedPath(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the configuration for Zenoh, whole, to a file that only you may read.",
)
@json_option
def address(words: tuple[str, ...], zenoh: bool, to: Path | None, as_json: bool) -> None:
    """Print the address of a logger or of one element, and what other languages need to read it.

    The URL is for silo's own commands and for Python (`silo.topic(URL)`); the key and the configuration are for Zenoh
    in any language. Where a password is asked for, only the file that --to writes holds it; on this computer it is that
    of this start of the robot program.

    \b
    Examples:
      silo address demo joints/torque
      silo address demo --to demo.json5        (Rust: Config::from_file, C: zc_config_from_file)
      silo watch silo://robot3/demo/log/joints/torque
    """
    from silo.net.found import url_of
    from silo.net.session import zenoh_settings
    from silo.rpc.words import full_name, why_silent

    logger, rest = split_logger(words)
    if len(rest) > 1:
        raise click.UsageError(f"an address is that of one element, not of {len(rest)}: {' '.join(rest)}")
    with connect(logger) as client:
        found, element = client.found, ""
        if rest:
            status, table = client.status(), client.table()
            element = full_name(rest[0], status, table)
            with suppress(ConnectionLostError):  # dead: its address stays
                if why := why_silent(element, found.label, status, table):
                    click.echo(why, err=True)
    whole = zenoh_settings(found)
    if to is not None:
        try:
            write_private(to, json.dumps(whole, indent=2) + "\n")
        except OSError as error:
            raise SaveError(f"can't write '{to}': {reason(error)}; nothing was written") from error
        click.echo(f"{to}: the configuration for Zenoh, for you alone", err=True)
    settings = shown(whole)
    if settings != whole and to is None:
        click.echo(f'a password is left out ("{LEFT_OUT}"): --to FILE writes all of it, for you alone', err=True)
    if zenoh:
        click.echo(json.dumps(settings, indent=2))
        return
    assert found.root is not None  # known since it was connected to
    taken = {word for one in discovered().loggers if one.root != found.root for word in one.addresses}
    url = url_of(next(word for word in found.addresses if "/" in word and word not in taken), element)
    key = found.root.topic(element) if element else found.root.key("topic", "**")
    facts = {"url": url, "key": key, "zenoh": settings}
    show(facts, as_json, lambda: f"url    {url}\nkey    {key}\nzenoh  {json.dumps(settings)}")


def shown(settings: Any) -> Any:
    """Return settings without what must stand on no screen and in no file of others."""
    if isinstance(settings, dict):
        return {key: LEFT_OUT if key.endswith(SECRET) and value else shown(value) for key, value in settings.items()}
    return [shown(value) for value in settings] if isinstance(settings, list) else settings
