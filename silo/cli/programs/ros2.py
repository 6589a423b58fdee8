"""`silo ros2`: a logger in the graph of ROS 2."""

import signal
import threading

import click

from silo.bridges.listening import check_installed
from silo.cli.common import check_control, complete_logger, configuration, tell_viewers

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "lyrical", "rolling")


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
    from silo.bridges.services import pinned, services, setting
    from silo.client.client import Client

    config, looks = configuration(), not check_control(control)  # of this thread's command

    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    name, reach = pinned(lambda wanted: Client.connect(wanted, config=config, read_only=looks), logger or "")
    if control:
        with reach() as client:
            tell_viewers(client)  # before others are told that they can change something
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
            ended.wait()
