"""What a bridge with `--control` lets others do to a logger: start, stop, save."""

import functools
import secrets
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from silo.control.denials import Denials
from silo.core.tuning.parameters import ParameterInfo, ParameterValue
from silo.errors import ConnectionLostError, SiloError
from silo.files.bags.ros_types import ENCAPSULATION, add_text
from silo.printing import printable

if TYPE_CHECKING:
    from silo.client.client import Client

MOST_TOLD = 300  # letters of what was called, and of what came of it

Connect = Callable[[], "Client"]
Call = Callable[[str], str]  # takes who calls, in words; says what came of it
# sets parameters for who calls, in words, from another computer or not; says what came of it, and what all are then
Tune = Callable[[Mapping[str, ParameterValue], str, bool], tuple[str, list[ParameterInfo]]]


def services(connect: Connect, prefix: str) -> dict[str, Call]:
    """Return what others may call, by name: each connects, does it for who calls, and says what came of it.

    Events name both: the user of the bridge, who is known to the robot, and for whom it was done.
    """

    def call(do: "Callable[[Client], str]", caller: str) -> str:
        with connect() as client:
            client._act_for(caller)
            return do(client)

    what: dict[str, Callable[[Client], str]] = {
        "start": lambda client: f"{client.found.label} is {client.start().state.value}",
        "stop": lambda client: f"{client.found.label} is {client.stop().state.value}",
        "save": lambda client: "saved " + ", ".join(file.path for file in client.wait_saved(client.save())),
    }
    return {f"/{prefix}/{name}": functools.partial(call, do) for name, do in what.items()}


def setting(connect: Connect) -> Tune:
    """Return what sets parameters of the logger, all or none, for whoever asks the bridge: also from elsewhere."""

    def tune(values: Mapping[str, ParameterValue], caller: str, remote: bool) -> tuple[str, list[ParameterInfo]]:
        with connect() as client:
            client._act_for(caller)
            text = client._set_parameters(dict(values), secrets.token_hex(8), 0.0, remote).text
            return text, client.parameters.described()

    return tune


def audit(what: str, how: str, caller: str, text: str) -> str:
    """Return the one line by which a bridge tells what came of a call, whatever its caller called it."""
    what = what if len(what) <= MOST_TOLD else f"{what[:MOST_TOLD]}... ({len(what)} letters)"
    text = text if len(text) <= MOST_TOLD else f"{text[:MOST_TOLD]}..."
    return printable(f"{what}, {how} by {caller}: {text}")


class Audit:
    """Tells what came of each call; of a flood that was refused a few lines, which `watch` tells now and then."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._refused = Denials()
        self._refused.tell = lambda text, who: tell(f"{text} by {who}" if who else text)
        self.watch = self._refused.watch

    def called(self, name: str, call: Call, caller: str) -> tuple[str, bool]:
        """Do a call, and tell what came of it; returns that, and whether it was done."""
        try:
            text, done = call(caller), True
        except SiloError as error:
            text, done = str(error), False
        self.note(name, "called", caller, text, done=done)
        return text, done

    def note(self, what: str, how: str, caller: str, text: str, *, done: bool) -> None:
        """Tell what came of a call, or that it was refused."""
        told = audit(what, how, caller, text)
        if done:
            self._tell(told)
        else:
            self._refused.note(told, "")


def pinned(connect: "Callable[[str], Client]", wanted: str) -> tuple[str, Connect]:
    """Return the name of the logger that is meant now, and what connects to it and to no other.

    The robot program may end and be started anew; what has another name or is of another computer is never taken for
    it, even where it is the only one left. Raises ConnectionLostError where there is none, or several could be meant.
    """
    with connect(wanted) as client:
        first, name = client.found, client.status().logger
    if not name:
        raise ConnectionLostError("the logger has no name")
    again = wanted or (f"{first.host}/{first.name}" if first.host else first.name)

    def reach() -> "Client":
        client = connect(again)
        found = client.found
        same = found.name == first.name and found.host == first.host
        if same and (found.machine == first.machine or not (found.machine and first.machine)):
            return client
        client.close()
        raise ConnectionLostError(f"{found.label} isn't the robot that this began with; start it anew for that one")

    return name, reach


def trigger_response(text: str, *, success: bool) -> bytes:
    """Return the answer of a `std_srvs/srv/Trigger`, in CDR."""
    body = bytearray([success])
    add_text(body, text)
    return ENCAPSULATION + body
