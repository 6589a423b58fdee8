"""From bytes to a checked request: whatever arrives becomes a request that makes sense, or a refusal in words."""

from itertools import islice
from typing import Any

import msgspec

from silo.helper.mirror import LoggerSnapshot
from silo.ipc.messages import AnyAsk, AnyDo, ApplyEdits, Hello, Refused, RefusedWhy, SlowAsk, leaves
from silo.model import Edit, Problem
from silo.settings.rules import MAX_NAME, MAX_PROBLEMS, edit_problems, raw_problems, refusal, shorten

MAX_ASK_BYTES = 2 * 2**20
MAX_DO_BYTES = 8 * 2**20


class _Kind(msgspec.Struct):
    type: str = ""


_ask_decoder = msgspec.msgpack.Decoder(AnyAsk)
_do_decoder = msgspec.msgpack.Decoder(AnyDo | Hello)
_kind_decoder = msgspec.msgpack.Decoder(_Kind)
_SLOW = {kind.__name__ for kind in leaves(SlowAsk)}


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
    if request.revision not in (-1, now.table.revision):
        return Refused(
            RefusedWhy.CONFLICT,
            f"somebody changed the table meanwhile (it is at revision {now.table.revision}, the edits are based on "
            f"{request.revision}): read it again; nothing was changed",
        )
    problems = edit_problems(request.edits, now.places)
    return _refused_edits(problems) if problems else None
