"""What a damaged file leads to, whose fields may hold anything, and the words for it."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import zstandard
from mcap.exceptions import McapError

from silo.errors import FileFormatError

DAMAGE = (
    struct.error, ValueError, LookupError, ArithmeticError, TypeError, RecursionError, EOFError, McapError,
    zstandard.ZstdError, msgspec.MsgspecError,
)  # fmt: skip


@contextmanager
def damage_told(file: Path) -> Iterator[None]:
    """Turn what a damaged file leads to, whose fields may hold anything, into FileFormatError."""
    try:
        yield
    except FileFormatError:
        raise  # which names the file already
    except DAMAGE as error:
        raise FileFormatError(f"{file}: {told_damage(error)}") from error
    except MemoryError as error:
        raise FileFormatError(f"{file}: it takes more memory than there is") from error


def told_damage(error: BaseException) -> str:
    """Return what is wrong with a file, in words."""
    text = str(error)
    if isinstance(error, ValueError) and not isinstance(error, UnicodeError | msgspec.MsgspecError):
        return text
    if isinstance(error, LookupError):
        return f"damaged: it names {text}, which isn't there"
    return f"damaged: {text or type(error).__name__}"
