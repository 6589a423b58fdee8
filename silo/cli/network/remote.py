"""`silo remote`: ways to robots elsewhere: made, named, listed, removed, and examined where they fail."""

import json
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from silo.cli.common import TypedPath, configuration, items, json_option, show_json, show_rows
from silo.cli.verbs import Verbs
from silo.core.runtime import write_private
from silo.errors import ConnectionLostError, SiloError
from silo.net.configuration import LOCAL, NAME, PORT, remote_file, remotes


def _complete(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    return items(remotes(), incomplete)


@click.group(cls=Verbs)
def remote() -> None:
    """Reach loggers of other computers: every command looks at them too, beside those of this one.

    \b
    Examples:
      silo remote init lab --host robot3.local --user alice:operator --user bob
      silo remote add lab alice.json5        (on alice's computer: the file that init made for her)
      silo remote add lab tcp/robot3.local:7447     (an open way: for looking alone)
      silo remote doctor lab
      silo ls
    """


@remote.command("add")
@click.argument("name")
@click.argument("endpoint", metavar="ENDPOINT|FILE")
@click.option("--user", default="", help="User name, where the other side wants one; the password is asked for.")
@click.option("--ca", type=TypedPath(exists=True, dir_okay=False, path_type=Path), help="Certificate of its authority.")
@click.option("--replace", is_flag=True, help="In place of the remote of that name.")
def add(name: str, endpoint: str, user: str, ca: Path | None, replace: bool) -> None:
    """Call a robot, or a router with robots behind it, NAME: by its ENDPOINT, or the FILE that was handed out for it.

    \b
    Examples:
      silo remote add lab alice.json5
      silo remote add walker tls/robot3.local:7447 --user alice --ca ca.pem
    """
    from silo.net.access.probing import endpoint_of

    if not NAME.fullmatch(name) or name == LOCAL:
        raise click.UsageError(f"'{name}' is no name for a remote: letters, digits, _ . -, and not '{LOCAL}'")
    target = remote_file(name)
    if target.exists() and not replace:
        raise SiloError(f"remote '{name}' is there already ({target}); --replace takes its place; nothing was changed")
    if Path(endpoint).is_file():
        text = _absolute(Path(endpoint))
    elif endpoint_of(endpoint) is None:
        raise click.UsageError(
            f"'{endpoint}' is neither a file nor an endpoint such as tls/robot3.local:{PORT} or tcp/10.0.0.7:{PORT}"
        )
    else:
        text = _text_of(endpoint, user, ca)
    target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_private(target, text)
    click.echo(f"{target}: `silo remote doctor {name}` tries it, `silo ls` shows who is there")


def _text_of(endpoint: str, user: str, ca: Path | None) -> str:
    values: dict[str, object] = {"connect": {"endpoints": [endpoint]}}
    transport: dict[str, object] = {}
    if user:
        password = click.prompt(f"password of {user}", hide_input=True, err=True)
        transport["auth"] = {"usrpwd": {"user": user, "password": password}}
    if ca is not None:
        transport["link"] = {"tls": {"root_ca_certificate": str(ca.absolute())}}
    return json.dumps({**values, **({"transport": transport} if transport else {})}, indent=2) + "\n"


def _absolute(file: Path) -> str:
    """Return a handed out file, with paths in it that lead to the same files from elsewhere."""
    from silo.net.configuration import PATHS, from_file, written

    from_file(str(file))  # it is one, else its words say why not
    text, values, changed = file.read_text(encoding="utf-8"), written(str(file)), False
    for key in PATHS:
        *way, last = key.split("/")
        place = values
        for word in way:
            place = place.get(word) or {}
        if place.get(last) and not Path(place[last]).is_absolute():
            place[last], changed = str(file.absolute().parent / place[last]), True
    return json.dumps(values, indent=2) + "\n" if changed else text


@remote.command("ls")
@json_option
def ls(as_json: bool) -> None:
    """List the remotes.

    \b
    Example:
      silo remote ls
    """
    from silo.net.configuration import endpoints_of, from_file, user_of

    rows = []
    for name in remotes():
        try:
            settings = from_file(str(remote_file(name)))
            where, user = ", ".join(endpoints_of(settings, "connect", "client")), user_of(settings)
        except SiloError as error:
            where, user = str(error), ""
        rows.append({"name": name, "endpoint": where, "user": user, "file": str(remote_file(name))})
    if as_json:
        show_json(rows)
        return
    if not rows:
        click.echo("no remotes; `silo remote add NAME ENDPOINT` makes one")
        return
    show_rows([("NAME", "ENDPOINT", "USER", "FILE"), *(tuple(value or "-" for value in row.values()) for row in rows)])


@remote.command("rm")
@click.argument("name", shell_complete=_complete)
def rm(name: str) -> None:
    """Forget the remote NAME; the robot is left as it is.

    \b
    Example:
      silo remote rm lab
    """
    if name not in remotes():
        raise SiloError(
            f"no remote is called '{name}'; there are: {', '.join(remotes()) or 'none'}; nothing was removed"
        )
    remote_file(name).unlink()
    click.echo(f"removed {remote_file(name)}")


@remote.command("init")
@click.argument("folder", type=TypedPath(path_type=Path, file_okay=False))
@click.option("--host", "hosts", multiple=True, help="Name or address by which robot or router is reached; several.")
@click.option(
    "--user", "users", multiple=True, metavar="NAME[:ROLE]", help="viewer (looks) or operator (changes, too)."
)
@click.option(
    "--robot",
    "names",
    multiple=True,
    metavar="HOSTNAME",
    help="For a router: a robot that connects to it, with a file of its own; several, and more of them later.",
)
@click.option(
    "--robots", is_flag=True, help="For a router: one file for all robots; who has it can pose as any of them."
)
@click.option("--remove", "removed", multiple=True, metavar="NAME", help="A user or robot to let in no more; several.")
@click.option("--port", type=click.IntRange(1, 65535), help=f"Where it listens; as before, else {PORT}.")
@click.option("--listen", metavar="ADDRESS", help="On which address of its own; as before, else 0.0.0.0: on all.")
def init(
    folder: Path,
    hosts: tuple[str, ...],
    users: tuple[str, ...],
    names: tuple[str, ...],
    robots: bool,
    removed: tuple[str, ...],
    port: int | None,
    listen: str | None,
) -> None:
    """Make an authority, a certificate for a robot or router, users with roles, and a file to hand out to each.

    Again with the same FOLDER, it adds or removes users and renews the certificate; authority, passwords, names,
    address and port stay.

    \b
    Examples:
      silo remote init lab --host robot3.local --host 10.0.0.7 --user alice:operator --user bob:viewer
      silo remote init lab --user carol      (one more)
      silo remote init lab --remove carol    (refused from then on)
      silo remote init lab --host router.local --user alice:operator --robot robot3 --robot robot4
      silo remote init lab --robot robot5    (one more)
    """
    from silo.cli.network.authority import check_roles, make_network, robot_of, role_of
    from silo.net.access.rights import ROBOT, SHARED

    people, own = dict(map(role_of, users)), {**dict(map(robot_of, names)), **({SHARED: ROBOT} if robots else {})}
    check_roles(people, own)
    roles = {**people, **own}
    made = make_network(folder, list(hosts), port, roles, listen, removed)
    there = f"silo-{folder.name}"
    first = hosts[0] if hosts else "HOST"
    if made.robots:
        click.echo(f"router:  scp -r {made.server} {first}:{there}; there: silo router --config {there}/server.json5")
    else:
        click.echo(f'robot:  scp -r {made.server} {first}:{there}; there: log.serve(config="{there}/server.json5"),')
        click.echo(f"        or to try it: silo demo --config {there}/server.json5")
    for name, path in made.clients.items():
        how = (
            f'log.serve(config="{path.name}")' if name in made.robots else f"silo remote add {folder.name} {path.name}"
        )
        click.echo(f"{name}:  give {path}; there: {how}")
    if SHARED in made.robots:
        click.echo(f"whoever has {SHARED}.json5 can pose as any robot: --robot HOSTNAME makes a file for each instead")
    for name in removed:
        click.echo(f"{name}:  is removed: whoever comes with that file is refused from that start on")
    news = "removed" if removed and not roles else "new"
    click.echo(
        f"keep {made.folder / 'ca-key.pem'} to yourself. Who listens already learns of {news} users at its next start."
    )


@remote.command("doctor")
@click.argument("name", required=False, default="", metavar="[NAME|FILE]", shell_complete=_complete)
def doctor(name: str) -> None:
    """Try a way layer by layer, and say which one fails, and what to do: of a remote, of a file, of all remotes.

    \b
    Examples:
      silo remote doctor lab
      silo remote doctor client.json5
    """
    from silo.fleet.examining import examine
    from silo.net.access.probing import LayerError

    given = name or configuration()
    names = [given] if given and given != LOCAL else remotes()
    if not names:
        raise SiloError("there is no remote to look at; `silo remote add NAME ENDPOINT` makes one")
    failed = []
    for each in names:
        click.echo(f"{each}:")
        try:
            for layer, words in examine(each):
                click.echo(f"  ok      {layer.value}: {words}")
        except LayerError as error:
            click.echo(f"  FAILS   {error.layer.value}: {error}")
            failed.append(f"{each} ({error.layer.value})")
    if failed:
        raise ConnectionLostError(f"not reached: {', '.join(failed)}")
