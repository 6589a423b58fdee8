"""A client of one logger: what `silo`, `silo-tui` and your own programs use to talk to a helper process.

All calls block until the answer is there, and may be made by any thread. A refusal raises RefusedError (with `why` and
`problems`), silence ConnectionLostError; the connection comes back by itself. No NumPy is imported before a view, a
topic or a history is asked for.
"""

from typing import TYPE_CHECKING

from silo.client.client import Client
from silo.core.arguments import text
from silo.core.calls import told
from silo.errors import ElementError
from silo.fleet.resolving import Discovery, discover
from silo.net.found import LoggerAddress, parse_url
from silo.rpc.declaring import Ask

if TYPE_CHECKING:
    from silo.live.topic import Topic

__all__ = ["Client", "Discovery", "LoggerAddress", "connect", "discover", "topic"]


@told("silo.connect")
def connect(
    logger: "str | LoggerAddress" = "", timeout_s: float = Ask.timeout_s, config: str = "", *, read_only: bool = False
) -> Client:
    """Connect to a running logger.

    Args:
        logger: its address (`robot3/anymal`; a bare name, where only one has it, `name.pid` of several on this
            computer, `host~id/name` of several hosts of one name), or empty for the only one.
        timeout_s: how long to wait for an answer, at least.
        config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.
        read_only: send nothing that changes something, whatever the role; calls that would raise RefusedError.

    Returns:
        A client; close it, or use it as a context manager.

    Raises:
        ConnectionLostError: there is none, or several could be meant; the message says what to do.
    """
    return Client.connect(logger, timeout_s, config, read_only=read_only)


@told("silo.topic")
def topic(url: str, timeout_s: float = Ask.timeout_s, config: str = "") -> "Topic":
    """Subscribe to every sample of a published element by its address alone: `for batch in silo.topic(URL)`.

    Args:
        url: `silo://robot3/anymal/log/joints/q`, or `silo:///anymal/log/joints/q` without a host; `silo address` prints
            it.
        timeout_s: how long to wait for an answer, at least.
        config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.

    Returns:
        The subscription, with a connection of its own; close it, or use it as a context manager.

    Raises:
        ConnectionLostError: that is no address, there is no such logger, or several could be meant.
        ElementError: the address names no element, or one that isn't there.
    """
    text("url", url, 'silo.topic("silo://robot3/anymal/log/joints/q")')
    address = parse_url(url)
    if not address.element:
        raise ElementError(f"{url}: names no element: write {url.rstrip('/')}/joints/q; nothing was asked")
    client = Client.connect(address.logger, timeout_s, config)
    try:
        return client._topic(address.element, lambda _topic: client.close())
    except BaseException:
        client.close()
        raise
