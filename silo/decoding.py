"""The one place where decoders are made: one after the other, whichever threads ask for them.

msgspec notes on a struct's class how it is decoded before it has worked that out. A second thread that decodes the same
class for the first time then reads what isn't there yet, and the process ends with SIGSEGV (0.22.0; three threads that
decode a new class each time show it within a second). What is made here is whole before anybody gets it.
"""

import os
import threading
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, overload

import msgspec

T = TypeVar("T")
Hook = Callable[[type, Any], Any]

_locks = [threading.RLock()]  # one


def _renew() -> None:
    _locks[0] = threading.RLock()


os.register_at_fork(after_in_child=_renew)  # another thread of the parent may have held it


@cache
def _json(kind: Any) -> msgspec.json.Decoder[Any]:
    with _locks[0]:
        return msgspec.json.Decoder(kind)


@cache
def _msgpack(kind: Any, hook: Hook | None) -> msgspec.msgpack.Decoder[Any]:
    with _locks[0]:
        return msgspec.msgpack.Decoder(kind, dec_hook=hook)


@overload
def json_decoder(kind: type[T]) -> msgspec.json.Decoder[T]: ...
@overload
def json_decoder(kind: Any) -> msgspec.json.Decoder[Any]: ...
def json_decoder(kind: Any) -> msgspec.json.Decoder[Any]:
    """Return what decodes JSON as a type."""
    return _json(kind)


@overload
def msgpack_decoder(kind: type[T], hook: Hook | None = None) -> msgspec.msgpack.Decoder[T]: ...
@overload
def msgpack_decoder(kind: Any, hook: Hook | None = None) -> msgspec.msgpack.Decoder[Any]: ...
def msgpack_decoder(kind: Any, hook: Hook | None = None) -> msgspec.msgpack.Decoder[Any]:
    """Return what decodes MessagePack as a type; `hook` makes what msgspec doesn't know."""
    return _msgpack(kind, hook)


def converted(value: object, kind: type[T]) -> T:
    """Return plain values as a type. Raises msgspec.ValidationError where they don't fit."""
    json_decoder(kind)
    return msgspec.convert(value, kind)
