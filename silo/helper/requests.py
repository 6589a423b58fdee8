"""From bytes to a checked request: whatever arrives becomes a request that makes sense, or a refusal in words."""

from itertools import islice
from typing import Any

import msgspec

from silo.helper.mirror import LoggerSnapshot
from silo.ipc.messages import AnyAsk, AnyDo, ApplyEdits, Ask, Do, Hello, Refused, RefusedWhy, Request
from silo.ipc.refusals import refused_conflict
from silo.ipc.versions import client_problem
from silo.model import Edit, Problem
from silo.settings.rules import MAX_NAME, MAX_PROBLEMS, edit_problems, raw_problems, refusal, shorten

IS_DERIVED = (
    "is derived from others, and has no divider, buffer or action of its own; edit those, or give it another "
    "expression (silo derive)"
)


class _Kind(msgspec.Struct):
    type: str = ""
    protocol: int = 1


_ask_decoder = msgspec.msgpack.Decoder(AnyAsk)
_do_decoder = msgspec.msgpack.Decoder(AnyDo | Hello)
_kind_decoder = msgspec.msgpack.Decoder(_Kind)


def decode_ask(payload: bytes) -> AnyAsk | Refused:
    """Decode a request that reads."""
    if len(payload) > Ask.max_bytes:
        return _too_long(payload, Ask.max_bytes)
    try:
        request: AnyAsk = _ask_decoder.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return _not_understood(payload, error)
    return _wrong_protocol(request) or request


def decode_do(payload: bytes) -> AnyDo | Hello | Refused:
    """Decode a request that changes something (or `Hello`, by which a client finds out whether it gets through)."""
    if len(payload) > Do.max_bytes:
        return _too_long(payload, Do.max_bytes)
    try:
        request: AnyDo | Hello = _do_decoder.decode(payload)
    except msgspec.ValidationError as error:
        return _edit_problems(payload) or _not_understood(payload, error)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return _not_understood(payload, error)
    return _wrong_protocol(request) or request


def _wrong_protocol(request: Request[Any]) -> Refused | None:
    """Refuse a client of another protocol in words that every one of them decodes; a hello is answered."""
    problem = "" if isinstance(request, Hello) else client_problem(request.protocol)
    return Refused(RefusedWhy.FAILED, problem) if problem else None


def _too_long(payload: bytes, limit: int) -> Refused:
    return Refused(RefusedWhy.INVALID, f"a request of {len(payload)} bytes; at most {limit} are read")


def _not_understood(payload: bytes, error: Exception) -> Refused:
    try:
        kind = _kind_decoder.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        kind = _Kind()
    if kind.type and (problem := client_problem(kind.protocol)):
        return Refused(RefusedWhy.FAILED, problem)
    return Refused(RefusedWhy.INVALID, f"the request can't be understood: {str(error)[:300]}")


def _edit_problems(payload: bytes) -> Refused | None:
    """Return what is wrong with each edit, if these are edits with values out of range."""
    try:
        raw: Any = msgspec.msgpack.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return None  # the typed decoder stops at the first fault; there may be worse behind it
    if not isinstance(raw, dict) or raw.get("type") != ApplyEdits.__name__ or not isinstance(raw.get("edits"), list):
        return None
    problems = list(islice((problem for item in raw["edits"] for problem in _problems_of(item)), MAX_PROBLEMS))
    return _refused_edits(problems) if problems else None


def _problems_of(item: object) -> list[Problem]:
    """Why this is no edit, empty if it is one."""
    try:
        msgspec.convert(item, Edit)
    except msgspec.ValidationError as error:
        text = str(error)
    else:
        return []
    name = item.get("name") if isinstance(item, dict) else None
    shown = shorten(str(name), MAX_NAME) if name else "?"
    options = item.get("options") if isinstance(item, dict) else None
    found = raw_problems(shown, options) if isinstance(options, dict) else []
    return found or [Problem(shown, "", text)]


def _refused_edits(problems: list[Problem]) -> Refused:
    return Refused(RefusedWhy.INVALID, refusal(problems), problems)


def check_edits(request: ApplyEdits, now: LoggerSnapshot) -> Refused | None:
    """Return why edits of the present table can't be applied; what can be told here never reaches the robot process."""
    conflict = refused_conflict(request, now.table.revision)
    if conflict is not None:
        return conflict
    derived = next(
        (edit.name for edit in request.edits if edit.name not in now.places and now.element(edit.name)), None
    )
    if derived is not None:
        return _refused_edits([Problem(shorten(derived, MAX_NAME), "name", IS_DERIVED)])
    problems = edit_problems(request.edits, now.places)
    return _refused_edits(problems) if problems else None
