"""`silo foxglove`, `silo ros2`, `silo mcp`: a logger, or the runs in folders, in the viewers of others."""

import secrets
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.bridges.listening import LOOPBACK, bound, check_installed
from silo.cli.common import Ending, TypedPath, check_control, complete_logger, configuration, tell_viewers
from silo.errors import LogNotFoundError

if TYPE_CHECKING:
    from silo.bridges.services import Connect

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "lyrical", "rolling")


def _pinned(logger: str | None, *, control: bool) -> "tuple[str, Connect]":
    """Return the name of the logger that is meant, and what connects to it; of viewers that may change something."""
    from silo.bridges.services import pinned
    from silo.client.client import Client

    config, looks = configuration(), not check_control(control)  # of this thread's command
    name, reach = pinned(lambda wanted: Client.connect(wanted, config=config, read_only=looks), logger or "")
    if control:
        with reach() as client:
            tell_viewers(client)  # before others are told that they can change something
    return name, reach


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
    from silo.bridges.services import services, setting

    name, reach = _pinned(logger, control=control)
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


@click.command()
@click.argument("logger", required=False, shell_complete=complete_logger)
@click.option("--router", default="tcp/localhost:7447", show_default=True, metavar="ENDPOINT", help="Of rmw_zenoh.")
@click.option("--domain", type=click.IntRange(0, 232), default=0, envvar="ROS_DOMAIN_ID", show_default=True)
@click.option("--distro", type=click.Choice(DISTRIBUTIONS), default="jazzy", envvar="ROS_DISTRO", show_default=True)
@click.option("--control", is_flag=True, help="Let all in the graph start, stop, save, set parameters.")
def ros2(logger: str | None, router: str, domain: int, distro: str, control: bool) -> None:
    """Show a logger to ROS 2 with rmw_zenoh, until Ctrl-C. No ROS is needed on this computer.

    Every element that is on is a topic below the logger's name, with a standard message: std_msgs, geometry_msgs where
    an element is a vector, quaternion, pose or twist, and sensor_msgs/JointState beside positions (q) that have
    velocities (qd) or efforts (tau). What nobody subscribes to is not read. ROS_DOMAIN_ID and ROS_DISTRO are heeded.

    \b
    Examples:
      silo ros2 anymal                            (beside it: ros2 run rmw_zenoh_cpp rmw_zenohd)
      ros2 topic echo /anymal/log/base/height     (with RMW_IMPLEMENTATION=rmw_zenoh_cpp)
      silo ros2 anymal --control                  (ros2 service call /anymal/stop std_srvs/srv/Trigger)
    """
    check_installed("xxhash", "ros2")
    from silo.bridges.feed import LoggerFollower
    from silo.bridges.ros2.graph import Graph, joined
    from silo.bridges.ros2.names import Distribution, Node, ros_name
    from silo.bridges.services import services, setting

    ending = Ending()
    name, reach = _pinned(logger, control=control)
    offered = services(reach, ros_name(name)) if control else {}
    with joined(router) as session:
        node = Node(domain, str(session.zid()), ros_name(name))
        graph = Graph(
            session, node, Distribution(distro), lambda listener: LoggerFollower(reach, listener),
            lambda text: click.echo(text, err=True), setting(reach) if control else None,
        )  # fmt: skip
        with graph.serving(offered):
            click.echo(f"{name} is node /{node.name} in domain {domain} of {router}, for ROS 2 {distro}")
            click.echo("all in the graph can start, stop, save, set parameters" if control else "read-only", err=True)
            ending.wait()


@click.command("mcp")
@click.argument("folders", metavar="[FOLDER]...", nargs=-1, type=TypedPath(path_type=Path))
def mcp(folders: tuple[Path, ...]) -> None:
    """Show the runs below folders to an agent, by the Model Context Protocol, until it ends. Read-only.

    An agent starts it: give its configuration the command `silo` with the arguments `mcp` and the folders. It lists
    runs, tells what is in one, computes statistics and expressions, draws pictures, and reads what runs now. It can't
    change anything and reaches no other file.

    \b
    Examples:
      silo mcp logs
      claude mcp add silo -- silo mcp ~/logs
    """
    from silo.bridges.agents import Shelf, server

    for folder in folders:
        if not folder.is_dir():
            raise LogNotFoundError(f"there is no folder '{folder}'")
    server(Shelf(folders or (Path(),))).run()
