"""`silo router`: where robots and desks meet: each robot connects to it, and so does each desk, once."""

import functools
from pathlib import Path

import click

from silo.cli.common import Ending, TypedPath

WATCH_S = 1.0


@click.command()
@click.option(
    "--config",
    type=TypedPath(path_type=Path, dir_okay=False, exists=True),
    required=True,
    help="What it listens on, who may connect, and who may do what: `silo config cp router.json5`, `silo remote init`.",
)
def router(config: Path) -> None:
    """Run a Zenoh router until Ctrl-C: robots connect to it, and desks see them all over one link.

    It keeps nothing, and logging goes on without it: clients and robots connect again by themselves. A `zenohd` with
    the same file does so, too, but stops for everybody when many robots vanish at once (a network segment that dies).

    \b
    Examples:
      silo config cp router.json5 && silo router --config router.json5
      silo router --config silo-lab/server.json5    (as `silo remote init lab --robot robot3` says)
    """
    from silo.control.denials import Denials
    from silo.fleet.routers import RouterFeed
    from silo.net.access.admission import direction_words, hold_directions, router_admission
    from silo.net.access.certificates import not_valid_today
    from silo.net.access.logins import asks_for_passwords, watch_logins
    from silo.net.configuration import from_file
    from silo.net.knocking import raise_descriptors
    from silo.net.session import close, open_router

    denials = Denials()
    if asks_for_passwords(str(config)):
        watch_logins(functools.partial(denials.note, "login refused: wrong user or password"))
    raise_descriptors()
    session, endpoints = open_router(str(config))
    settings = from_file(str(config))
    admission, old = router_admission(settings, endpoints, str(config)), hold_directions(settings)
    feed = RouterFeed(session, lambda: denials.told)
    ending = Ending()
    click.echo(f"router on {', '.join(endpoints)}")
    for words in not_valid_today(str(config)):
        click.echo(words, err=True)
    if old:
        click.echo(direction_words(str(config), old), err=True)
    if not admission.changes:
        click.echo(f"nobody may change anything through it: {admission.why}", err=True)
    elif not admission.proven:
        click.echo("whoever may change something can do so under any name: its rules don't hold names", err=True)
    try:
        while not ending.within(WATCH_S):
            denials.watch()
            feed.send()
    finally:
        close(session)
    click.echo("router ended; robots go on logging")
