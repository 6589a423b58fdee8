"""Heavy libraries that come with an extra of the package: imported when needed, with a clear word when missing."""

import importlib
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from silo.errors import SaveError, SiloError
from silo.files.atomic import append_all, atomic_file


def need(module: str, extra: str, purpose: str) -> Any:
    """The module, imported. Raises `SiloError` that says what to install."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise SiloError(f'{purpose} need {package}: pip install "silo-logger[{extra}]"') from error


@contextmanager
def whole_file(path: Path) -> Iterator["WholeFile"]:
    """Like `atomic_file`, for libraries that don't look at how much a `write` took, and complain in their own ways."""
    with atomic_file(path) as raw, WholeFile(raw.fileno(), "wb", closefd=False) as file:
        try:
            yield file
        except SiloError:
            raise
        except (ValueError, OverflowError, TypeError, NotImplementedError, RuntimeError) as error:
            raise SaveError(f"can't save '{path}': {error}; nothing was left under that name") from error


class WholeFile(io.FileIO):
    """An unbuffered file whose `write` takes everything or raises: the plain one may take a part of it."""

    def write(self, data: Any, /) -> int:
        """Write all of `data`; raises `OSError`, for a full disk too."""
        view = memoryview(data).cast("B")
        append_all(self.fileno(), view)
        return len(view)
