"""For all tests: a runtime folder of their own, so that they meet no logger of this computer and leave none behind."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from silo.runtime import shared_memory_root


@pytest.fixture(autouse=True)
def runtime_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A private folder for segments and sockets; its path is short, as sockets need it."""
    folder = Path(tempfile.mkdtemp(prefix="silo-test-", dir=shared_memory_root()))
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(folder))
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def new_logger(tmp_path: Path) -> Iterator[Callable[..., "object"]]:
    """Makes loggers that keep their files in `tmp_path`, and closes them when the test ends."""
    from silo.logger.logger import Logger

    made = []

    def make(name: str = "test", **options: object) -> Logger:
        chosen = {"folder": tmp_path, "script": tmp_path / "logger.yaml", **options}
        logger = Logger(name, **chosen)
        made.append(logger)
        return logger

    yield make
    for logger in made:
        logger.close()
