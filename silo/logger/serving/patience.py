"""How long the robot program waits for a helper process: as long as that shows signs of life.

It answers a beat of the link, which its main thread does at once; or it works, as one that gets little processor time
does. A frozen one (SIGSTOP, a debugger, memory that is swapped out) does neither.
"""

from collections.abc import Callable

ROUND_S = 1.0
FROZEN_ROUNDS = 5  # without an answer, nor any processor time
DEAF_ROUNDS = 60  # without an answer, though it works


class Patience:
    """To be asked once a second of a wait. Seconds in which this program stood still itself count as one."""

    def __init__(self, beats: Callable[[], int], worked_ns: Callable[[], int]) -> None:
        self._signs = beats, worked_ns
        self._beats, self._worked_ns = beats(), worked_ns()
        self._deaf = self._quiet = 0

    def is_over(self) -> bool:
        """Whether there was no sign of life for so many rounds."""
        beats, worked_ns = (sign() for sign in self._signs)
        self._deaf = 0 if beats != self._beats else self._deaf + 1
        self._quiet = 0 if (beats, worked_ns) != (self._beats, self._worked_ns) else self._quiet + 1
        self._beats, self._worked_ns = beats, worked_ns
        return self._quiet >= FROZEN_ROUNDS or self._deaf >= DEAF_ROUNDS
