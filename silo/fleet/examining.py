"""Trying a way to robots layer by layer: what `silo remote doctor` prints."""

from collections.abc import Iterator

from silo.errors import ConnectionLostError, RefusedError, VersionError
from silo.fleet.exchange import ask_once, exchange
from silo.fleet.resolving import discover
from silo.net.access.probing import Layer, LayerError, reach, tls_problem
from silo.net.configuration import find_file, from_file, user_of
from silo.net.found import LoggerAddress, told_apart
from silo.net.sessions import borrowed
from silo.state.requests import Hello, HelloReply
from silo.version import VERSION

TIMEOUT_S = 2.0


def examine(config: str) -> Iterator[tuple[Layer, str]]:
    """Yield each layer that works, with what was found there. Raises LayerError at the first that doesn't."""
    try:
        path = find_file(config)
        settings = from_file(path)
    except ConnectionLostError as error:
        raise LayerError(Layer.CONFIGURATION, str(error)) from error
    yield Layer.CONFIGURATION, path
    reached = reach(path)
    if reached.endpoint is not None and reached.address:
        yield Layer.NAME, f"{reached.endpoint.host} is {reached.address}"
        yield Layer.ROUTE, f"a round trip takes {reached.rtt_s * 1000:.1f} ms"
        yield Layer.PORT, f"{reached.endpoint.port} takes connections"
        if reached.endpoint.kind == "tls":
            problem = tls_problem(path, reached.endpoint, reached.rtt_s)
            if problem is not None:
                raise problem
            yield Layer.TLS, "name, date and authority of its certificate are right"
    user = user_of(settings)
    with borrowed("", path):
        yield Layer.PASSWORD, f"user '{user}' is let in" if user else "it lets us in without"
        yield from _asked(discover(TIMEOUT_S, path).loggers, user)


def _asked(loggers: list[LoggerAddress], user: str) -> Iterator[tuple[Layer, str]]:
    """Ask every logger who it is, and whether it takes changes of us."""
    for found, address in zip(loggers, told_apart(loggers), strict=True):
        try:
            reply = ask_once(found, Hello(version=VERSION), TIMEOUT_S)
        except VersionError as error:
            raise LayerError(Layer.VERSION, str(error)) from error
        except (ConnectionLostError, RefusedError) as error:
            raise LayerError(Layer.ROLE, str(error)) from error
        may = (
            "may change it"
            if _may_change(found)
            else f"may look, not change{f' ({reply.why_not})' if reply.why_not else ''}"
        )
        yield Layer.ROLE, f"{address}: {f'user {user!r}' if user else 'this user'} {may}"
        yield Layer.VERSION, f"{address}: silo {reply.version}, protocol {reply.protocol}"


def _may_change(found: LoggerAddress) -> bool:
    root = found.root
    if root is None:
        return False
    question = Hello(version=VERSION)
    with borrowed(found.socket, found.config) as mine:
        try:
            reply = exchange(mine, root, question, TIMEOUT_S, root.address, as_change=True)
        except ConnectionLostError:
            return False  # access control swallows what isn't allowed
    return isinstance(reply, HelloReply)
