"""What travels between a logger's helper process and its clients: all requests and replies of all features.

How they are declared: `silo.rpc.declaring`. A module with requests that isn't listed here isn't decoded. Whatever bytes
arrive become a request that makes sense, or a refusal in words.
"""

import functools
import operator
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import msgspec

from silo.conditions import requests as conditions
from silo.control import requests as control
from silo.core.elements import Edit, Problem
from silo.decoding import converted, msgpack_decoder
from silo.history import requests as history
from silo.history import search_requests as search
from silo.live import requests as live
from silo.parameters import requests as parameters
from silo.recorder import requests as recorder
from silo.recordings import requests as recordings
from silo.rpc.declaring import Ask, Do, Reply, Request, leaves
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.versions import client_problem
from silo.scripts import requests as scripts
from silo.settings.options import MAX_NAME, MAX_PROBLEMS, raw_problems, shorten
from silo.state import requests as state
from silo.state.requests import ApplyEdits, Hello, check_none

Kind = TypeVar("Kind", bound=Request[Any])

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


class _Kind(msgspec.Struct):
    type: str = ""
    protocol: int = 1


_ask_decoder = msgpack_decoder(AnyAsk)
_do_decoder: "msgspec.msgpack.Decoder[AnyDo | Hello]" = msgpack_decoder(AnyDo | Hello)
_kind_decoder = msgpack_decoder(_Kind)


def decode_ask(payload: bytes) -> AnyAsk:
    """Decode a request that reads. Raises RequestRefusedError, as all of these do."""
    return _decoded(_ask_decoder, payload, Ask)


def decode_do(payload: bytes) -> AnyDo | Hello:
    """Decode a request that changes something (or `Hello`, by which a client finds out whether it gets through)."""
    return _decoded(_do_decoder, payload, Do)


def _check_size(payload: bytes, kind: type[Request[Any]]) -> None:
    if len(payload) > kind.max_bytes:
        text = f"a request of {len(payload)} bytes; at most {kind.max_bytes} are read"
        raise RequestRefusedError(RefusedWhy.INVALID, text)


def _decoded(decoder: "msgspec.msgpack.Decoder[Kind]", payload: bytes, base: type[Request[Any]]) -> Kind:
    _check_size(payload, base)
    try:
        request = decoder.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        if isinstance(error, msgspec.ValidationError):
            _check_values(payload)
        raise _not_understood(payload, error) from None
    _check_size(payload, type(request))
    # in words that clients of every protocol decode; a hello is answered
    problem = "" if isinstance(request, Hello) else client_problem(request.protocol)
    if problem:
        raise RequestRefusedError(RefusedWhy.FAILED, problem)
    return request


def _not_understood(payload: bytes, error: Exception) -> RequestRefusedError:
    try:
        kind = _kind_decoder.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        kind = _Kind()
    if kind.type and (problem := client_problem(kind.protocol)):
        return RequestRefusedError(RefusedWhy.FAILED, problem)
    return RequestRefusedError(RefusedWhy.INVALID, f"the request can't be understood: {str(error)[:300]}")


def _check_values(payload: bytes) -> None:
    """Raise what is wrong with each edit, if these are edits with values out of range."""
    try:
        raw: Any = msgspec.msgpack.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return  # the typed decoder stops at the first fault; there may be worse behind it
    if not isinstance(raw, dict) or raw.get("type") != ApplyEdits.__name__ or not isinstance(raw.get("edits"), list):
        return
    problems = list(islice((problem for item in raw["edits"] for problem in _problems_of(item)), MAX_PROBLEMS))
    check_none(problems)


def _problems_of(item: object) -> list[Problem]:
    """Why this is no edit, empty if it is one."""
    try:
        converted(item, Edit)
    except msgspec.ValidationError as error:
        text = str(error)
    else:
        return []
    name = item.get("name") if isinstance(item, dict) else None
    shown = shorten(str(name), MAX_NAME) if name else "?"
    options = item.get("options") if isinstance(item, dict) else None
    found = raw_problems(shown, options) if isinstance(options, dict) else []
    return found or [Problem(shown, "", text)]
