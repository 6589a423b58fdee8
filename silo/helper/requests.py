"""From bytes to a checked request: whatever arrives becomes a request that makes sense, or a refusal in words."""

import re
from itertools import islice
from typing import Any

import msgspec

from silo.helper.mirror import LoggerSnapshot
from silo.ipc.messages import AnyAsk, AnyDo, ApplyEdits, Hello, Refused, RefusedWhy, SlowAsk, leaves
from silo.model import Edit, Problem

MAX_ASK_BYTES = 2 * 2**20
MAX_DO_BYTES = 8 * 2**20
MAX_PROBLEMS = 200


class _Kind(msgspec.Struct):
    type: str = ""


_ask_decoder = msgspec.msgpack.Decoder(AnyAsk)
_do_decoder = msgspec.msgpack.Decoder(AnyDo | Hello)
_kind_decoder = msgspec.msgpack.Decoder(_Kind)
_SLOW = {kind.__name__ for kind in leaves(SlowAsk)}
_FIELD = re.compile(r" - at `\$\.(?:options\.)?(\w+).*`$")


def is_slow(payload: bytes) -> bool:
    """Return whether this asks for something that may take long to answer: by its tag alone, whatever else is in it."""
    if len(payload) > MAX_ASK_BYTES:
        return False
    try:
        return _kind_decoder.decode(payload).type in _SLOW
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return False


def decode_ask(payload: bytes) -> AnyAsk | Refused:
    """Decode a request that reads."""
    if len(payload) > MAX_ASK_BYTES:
        return _too_long(payload, MAX_ASK_BYTES)
    try:
        request: AnyAsk = _ask_decoder.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return _not_understood(error)
    return request


def decode_do(payload: bytes) -> AnyDo | Hello | Refused:
    """Decode a request that changes something (or `Hello`, by which a client finds out whether it gets through)."""
    if len(payload) > MAX_DO_BYTES:
        return _too_long(payload, MAX_DO_BYTES)
    try:
        request: AnyDo | Hello = _do_decoder.decode(payload)
    except msgspec.ValidationError as error:
        return _edit_problems(payload) or _not_understood(error)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return _not_understood(error)
    return request


def _too_long(payload: bytes, limit: int) -> Refused:
    return Refused(RefusedWhy.INVALID, f"a request of {len(payload)} bytes; at most {limit} are read")


def _not_understood(error: Exception) -> Refused:
    return Refused(RefusedWhy.INVALID, f"the request can't be understood: {str(error)[:300]}")


def _edit_problems(payload: bytes) -> Refused | None:
    """Return what is wrong with each edit, if these are edits with values out of range."""
    try:
        raw: Any = msgspec.msgpack.decode(payload)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
        return None  # the typed decoder stops at the first fault; there may be worse behind it
    if not isinstance(raw, dict) or raw.get("type") != ApplyEdits.__name__ or not isinstance(raw.get("edits"), list):
        return None
    found = (problem for item in raw["edits"] if (problem := _problem_of(item)) is not None)
    problems = list(islice(found, MAX_PROBLEMS))
    return _refused_edits(problems) if problems else None


def _problem_of(item: object) -> Problem | None:
    """Return why this is no edit, None if it is one."""
    try:
        msgspec.convert(item, Edit)
    except msgspec.ValidationError as error:
        text = str(error)
    else:
        return None
    name = item.get("name") if isinstance(item, dict) else None
    found = _FIELD.search(text)
    field = found[1] if found else ""
    options = item.get("options") if isinstance(item, dict) else None
    got = f", got {options[field]!r:.80}" if isinstance(options, dict) and field in options else ""
    reason = _FIELD.sub("", text).replace("Expected `int` >=", "must be a whole number >=")
    return Problem(str(name)[:200] if name else "?", field, reason + got)


def _refused_edits(problems: list[Problem]) -> Refused:
    lines = "; ".join(f"element '{problem.name}': {problem.field} {problem.reason}" for problem in problems[:3])
    more = f"; and {len(problems) - 3} more" if len(problems) > 3 else ""
    return Refused(RefusedWhy.INVALID, f"{lines}{more}; nothing was changed", problems)


def check_edits(request: ApplyEdits, now: LoggerSnapshot) -> Refused | None:
    """Return why edits of the present table can't be applied; what can be told here never reaches the robot process."""
    if request.revision not in (-1, now.table.revision):
        return Refused(
            RefusedWhy.CONFLICT,
            f"somebody changed the table meanwhile (it is at revision {now.table.revision}, the edits are based on "
            f"{request.revision}): read it again; nothing was changed",
        )
    problems = []
    seen: set[str] = set()
    for edit in request.edits:
        if edit.name not in now.places:
            problems.append(Problem(edit.name[:200], "name", "is not in the table"))
        elif edit.name in seen:
            problems.append(Problem(edit.name, "name", "is edited twice"))
        seen.add(edit.name)
        if len(problems) >= MAX_PROBLEMS:
            break
    return _refused_edits(problems) if problems else None
