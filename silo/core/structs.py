"""Structs and dataclasses that have fields in common."""

from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any, TypeVar, cast

Made = TypeVar("Made")


def alike(kind: Callable[..., Made], source: object, /, **changes: Any) -> Made:
    """A struct or dataclass of another kind, of the fields that `source` has under the same names.

    What is known of an element or a log goes so from segments to recordings and files, and back: each file has a
    struct of its own, whose order of fields is that of its bytes, and nothing is copied field by field.
    """
    given = {name: getattr(source, name) for name in _shared(kind, cast(Hashable, type(source))) if name not in changes}
    return kind(**given, **changes)


@lru_cache(maxsize=64)
def _shared(kind: Hashable, source: Hashable) -> tuple[str, ...]:
    has = {*fields_of(source)}
    return tuple(name for name in fields_of(kind) if name in has)


def fields_of(kind: Any) -> tuple[str, ...]:
    """The names of the fields of a struct or dataclass."""
    fields: tuple[str, ...] = getattr(kind, "__struct_fields__", None) or tuple(
        getattr(kind, "__dataclass_fields__", ())
    )
    return fields
