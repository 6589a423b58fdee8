"""How a logger hands a call on to the part that does it: arguments, types and docstring stand there alone."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")


def of(part: str, method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """Return a method that is one of an object's part: `add = of("_scripted", ScriptedTable.add)`.

    Type checkers see the part's signature, `help()` and the reference its docstring; a wrong call is told of there.

    Args:
        part: the attribute that holds the part.
        method: of the part's class.
    """

    @wraps(method)
    def call(self: object, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(getattr(self, part), *args, **kwargs)

    return cast(Callable[Concatenate[Any, P], R], call)
