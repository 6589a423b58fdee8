"""What travels between a logger's helper process and its clients: all requests and replies of all features.

How they are declared: `silo.rpc.declaring`. A module with requests that isn't listed here isn't decoded.
"""

import functools
import operator
from typing import TYPE_CHECKING, Any, TypeAlias

from silo.conditions import requests as conditions
from silo.control import requests as control
from silo.history import requests as history
from silo.history import search_requests as search
from silo.live import requests as live
from silo.parameters import requests as parameters
from silo.recorder import requests as recorder
from silo.recordings import requests as recordings
from silo.rpc.declaring import Ask, Do, Reply, Request, leaves
from silo.scripts import requests as scripts
from silo.state import requests as state

FEATURES = (state, scripts, control, conditions, history, search, live, recordings, recorder, parameters)

if TYPE_CHECKING:
    AnyAsk: TypeAlias = Ask[Any]
    AnyDo: TypeAlias = Do[Any]
    AnyReply: TypeAlias = Reply
else:  # the unions of all of them, by whose tags msgspec decodes
    AnyAsk = functools.reduce(operator.or_, leaves(Ask))
    AnyDo = functools.reduce(operator.or_, leaves(Do))
    AnyReply = functools.reduce(operator.or_, leaves(Reply))


def __getattr__(name: str) -> type[Request[Any]]:
    """Return a request that a method declares, by its name on the way: `SetTrigger`."""
    for kind in leaves(Request):
        if kind.__name__ == name:
            found: type[Request[Any]] = kind
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
