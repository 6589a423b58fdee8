"""What the loop knows of parameters: changes that wait, and who lands them. Its features are in `silo/parameters/`."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from silo.core.parameters import ParameterInfo
from silo.segment.parameter_changes import ChangeRecord


class Landing(Protocol):
    """Where changes wait, until `land(n, t)` at the end of a tick stores them; `n` is the index of the next row."""

    waiting: list[Any]

    def land(self, n: int, t: int, /) -> None:
        """Store or refuse what waits."""

    def described(self) -> Sequence[ParameterInfo]:
        """What each parameter is, with its present value."""

    def begin_run(self, record: ChangeRecord | None, next_row: Callable[[], int], /) -> None:
        """Record changes there from now on."""

    def end_run(self, record: ChangeRecord | None, /) -> None:
        """Record there no more, unless another run began."""
