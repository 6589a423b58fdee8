"""Every error that silo raises, as one small tree. A message names the thing, the value, the range and the way out."""

import errno

from silo.printing import printable_lines


def reason(error: BaseException) -> str:
    """Why something failed: in the system's words where it has some (`No space left on device`), else in its own."""
    try:
        words = getattr(error, "strerror", None) or str(error).strip()  # libraries end theirs with a line break
    except Exception:  # noqa: BLE001  # a class of somebody's has no words
        words = ""
    return words or type(error).__name__


def lacks_descriptors(error: BaseException | None) -> bool:
    """Return whether something failed because no further file can be opened, for the moment: to be tried again."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
            return True
        error = error.__cause__
    return False


def _told(error: BaseException) -> str:
    """Return the words of an error of silo: those of a file or a robot in it can't move a terminal's cursor."""
    return printable_lines(BaseException.__str__(error))  # not as KeyError, which has them in quotes


class SiloError(Exception):
    """Base of all errors of silo."""

    __str__ = _told


class ElementError(SiloError, ValueError):
    """An element is unknown, listed twice, or given a value out of range. Nothing was changed."""


class ExpressionError(ElementError):
    """An expression can't be understood, or doesn't fit the signals; the message shows the place. Nothing was changed.

    `reason` is the message without the text of the expression, `at` and `end` are the place in it.
    """

    def __init__(self, reason: str, text: str, at: int, end: int) -> None:
        self.reason, self.text = reason, text
        self.at = min(max(at, 0), len(text))
        self.end = max(min(end, len(text)), self.at + 1)
        super().__init__(f"{reason}\n  {text}\n  {' ' * self.at}{'^' * (self.end - self.at)}")


class UnknownSignalError(ElementError, KeyError):
    """The log has no signal of that name."""


class ArgumentError(SiloError, TypeError):
    """A function was called with an argument that it doesn't have, with too many, or without one that it needs."""


class UnknownNameError(SiloError, AttributeError):
    """There is no method or function of that name; the message says what does it."""


class SourceError(SiloError, TypeError):
    """A variable can't be logged by reference; the message shows what to write instead."""


class StateError(SiloError, RuntimeError):
    """The call doesn't fit the logger's state (running, stopped, closed). Nothing was changed."""


class ScriptError(SiloError, ValueError):
    """A script can't be read or holds invalid values; the message has one `file:line: reason` per problem."""


class SegmentError(SiloError, RuntimeError):
    """The shared memory segment can't be made, opened or understood."""


class NoRoomError(SegmentError):
    """There is no room for the buffers: `needed_bytes` of which `free_bytes` are there."""

    def __init__(self, message: str, needed_bytes: int, free_bytes: int) -> None:
        """Make the error.

        Args:
            message: what it says.
            needed_bytes: how much the buffers need.
            free_bytes: how much there is.
        """
        super().__init__(message)
        self.needed_bytes, self.free_bytes = needed_bytes, free_bytes


class FileFormatError(SiloError, ValueError):
    """A log file isn't what its name says, or is damaged beyond what can be read."""


class LogNotFoundError(SiloError, FileNotFoundError):
    """No log has that path, start of a file name or run number, or more than one has."""


class SaveError(SiloError, OSError):
    """A log could not be saved. Nothing stands under the final name; the data is still in memory."""


class ConnectionLostError(SiloError, ConnectionError):
    """No answer from a logger's helper process: it is gone, frozen, or out of reach."""


class VersionError(ConnectionLostError):
    """Robot and client are of silos that don't understand each other; the message says which one is older."""


class GoesOnError(SiloError):
    """A robot process hasn't done yet what it was asked for, and may still do it: its status and an event tell."""

    def __init__(self, message: str, job: int = 0) -> None:
        """Make the error.

        Args:
            message: what it says.
            job: the number of the event that tells how it ends.
        """
        super().__init__(message)
        self.job = job


class UnsavedError(StateError):
    """Data that is in no file would be cleared; the message says how much. Nothing was changed."""


class RefusedError(SiloError):
    """The logger's helper process answered that it won't do this; the message is its reason."""


class LogWarning(UserWarning):
    """A log is damaged, cut off, or not complete; the text says what is missing."""

    __str__ = _told
