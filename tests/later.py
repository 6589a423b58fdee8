"""Packages that are loaded by the first test that uses them: each worker collects all tests, but runs some of them."""

import importlib
from typing import Any


class Later:
    """A module, loaded when something of it is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # pytest asks whatever stands in a module for `_mock_name`, `__wrapped__`
            raise AttributeError(name)
        return getattr(importlib.import_module(self._name), name)
