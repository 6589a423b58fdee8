"""Heavy libraries that come with an extra of the package: imported when needed, with a clear word when missing."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from silo.errors import SaveError, SiloError
from silo.files.atomic import WholeFile, atomic_file


def need(module: str, extra: str, purpose: str) -> Any:
    """The module, imported. Raises `SiloError` that says what to install."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise SiloError(f'{purpose} need {package}: pip install "silo-logger[{extra}]"') from error


@contextmanager
def whole_file(path: Path) -> Iterator[WholeFile]:
    """Like `atomic_file`, for libraries that complain in their own ways."""
    with atomic_file(path) as file:
        try:
            yield file
        except SiloError:
            raise
        except (ValueError, OverflowError, TypeError, NotImplementedError, RuntimeError) as error:
            raise SaveError(f"can't save '{path}': {error}; nothing was left under that name") from error
