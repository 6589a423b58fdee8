"""`with log.episode("pick") as episode:`: its marks are set as the block is entered and left."""

import logging
from collections.abc import Callable, Mapping
from types import TracebackType

from silo.core.arguments import switch
from silo.core.episodes.words import begin_marks, end_mark
from silo.errors import StateError

log = logging.getLogger("silo")


class EpisodeBlock:
    """What `Logger.episode` returns: a context manager, and whether what is done in it went well.

    Attributes:
        name: what is done.
    """

    def __init__(
        self, mark: Callable[[str], None], name: object, success: object, about: Mapping[str, object], missing: str = ""
    ) -> None:
        """Set marks by `mark`; `missing` is why there is nothing to mark."""
        self._begin = begin_marks(name, about)
        self.name = str(name).strip()
        self.success = success  # type: ignore[assignment]  # checked there
        self._mark, self._missing = mark, missing
        self._state = "new"

    @property
    def success(self) -> bool | None:
        """Whether it went well, None where that is not known; it holds as it is when the block is left."""
        return self._success

    @success.setter
    def success(self, value: bool | None) -> None:
        self._success = None if value is None else switch("success", value)

    def __enter__(self) -> "EpisodeBlock":
        """Begin it. Raises StateError where it was begun before."""
        if self._state != "new":
            raise StateError(
                f"episode '{self.name}' was begun already: call log.episode('{self.name}') for the next one"
            )
        self._state = "begun"
        if self._missing:
            log.warning("episode '%s' stands in no run: %s", self.name, self._missing)
        for text in self._begin:
            self._mark(text)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it; an exception makes it no success, and its words stand in the mark."""
        if kind is None:
            self._mark(end_mark(self.name, self._success))
            return
        self._success = False
        words = " ".join(str(error).split())
        self._mark(end_mark(self.name, False, f"{kind.__name__}: {words}" if words else kind.__name__))

    def __repr__(self) -> str:
        return f"<episode '{self.name}', success {self._success}>"
