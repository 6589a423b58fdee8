"""`silo foxglove`: a logger in Foxglove, Lichtblick or PlotJuggler."""

import secrets

import click

from silo.bridges.listening import LOOPBACK, bound, check_installed
from silo.cli.common import check_control, complete_logger, configuration, tell_viewers


@click.command()
@click.argument("logger", required=False, shell_complete=complete_logger)
@click.option("--port", type=click.IntRange(0, 65535), default=8765, show_default=True, help="0: any that is free.")
@click.option("--bind", default="127.0.0.1", show_default=True, metavar="ADDRESS", help="Others need the token.")
@click.option("--control", is_flag=True, help="Let it start, stop, save, set parameters; then with a token.")
@click.option("--token", is_flag=True, help="Let only those look who have the address with the token.")
@click.option("--origin", "origins", multiple=True, metavar="URL", help="Let pages of this origin connect, too.")
def foxglove(logger: str | None, port: int, bind: str, control: bool, token: bool, origins: tuple[str, ...]) -> None:
    """Serve a logger to Foxglove, Lichtblick and PlotJuggler, until Ctrl-C. Nothing of ROS is needed.

    Every element that is on is a topic, saved only or published, with the messages that bags have. What nobody
    subscribes to is not read. A viewer that is too slow loses messages, is told so, and harms nobody. It goes on when
    the robot program is started anew.

    From another computer: `ssh -L 8765:localhost:8765 robot`, and open ws://localhost:8765 there.

    \b
    Examples:
      silo foxglove                     (then: Open connection, Foxglove WebSocket, ws://localhost:8765)
      silo foxglove anymal --control    (start, stop, save by "Service Call", gains by "Parameters")
    """
    check_installed("websockets", "foxglove")
    from silo.bridges.foxglove.server import Terms, run
    from silo.bridges.services import pinned, services, setting
    from silo.client.client import Client

    config, looks = configuration(), not check_control(control)  # of this thread's command

    name, reach = pinned(lambda wanted: Client.connect(wanted, config=config, read_only=looks), logger or "")
    if control:
        with reach() as client:
            tell_viewers(client)  # before others are told that they can change something
    secret = secrets.token_urlsafe(24) if control or token or bind not in LOOPBACK else ""
    offered = services(reach, name) if control else None
    terms = Terms(name, bind, secret, origins, offered, setting(reach) if control else None)
    with bound(bind, port) as listening:
        host = "localhost" if terms.on_loopback else bind
        address = f"ws://{host}:{listening.getsockname()[1]}{'/' + secret if secret else ''}"
        click.echo(f"{name} at {address}")
        click.echo(
            "whoever has this address can start, stop, save and set parameters" if control else "read-only", err=True
        )
        click.echo("Foxglove, Lichtblick: Open connection > Foxglove WebSocket; PlotJuggler: Foxglove Bridge", err=True)
        run(terms, reach, listening, lambda text: click.echo(text, err=True))
