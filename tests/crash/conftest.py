"""The fixtures of `tests/ipc`: robot programs in processes of their own."""

import importlib.util
from pathlib import Path

import pytest

_place = Path(__file__).parents[1] / "ipc" / "conftest.py"
_spec = importlib.util.spec_from_file_location("silo_ipc_fixtures", _place)
assert _spec is not None and _spec.loader is not None
_fixtures = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_fixtures)

runtime = _fixtures.runtime
robots = _fixtures.robots
Heard = _fixtures.Heard


@pytest.fixture(autouse=True)
def _warm(warm: None) -> None:
    """Processes start warm here."""
