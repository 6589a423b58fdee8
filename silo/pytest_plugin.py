"""For tests of robot programs: the fixture `silo_log`. pytest loads it wherever silo is installed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from silo.logger.logger import Logger


@pytest.fixture
def silo_log(request: pytest.FixtureRequest, tmp_path: Path) -> "Iterator[Logger]":
    """A `silo.Logger` by the name of the test, in its `tmp_path`; what it logged is saved when the test ends.

    Where the test fails, pytest's report shows the path of the file.
    """
    from silo.logger.logger import Logger

    name = re.sub(r"\W", "_", request.node.name)[:40]
    with Logger(name, folder=tmp_path, script=tmp_path / "logger.yaml") as log:
        yield log
