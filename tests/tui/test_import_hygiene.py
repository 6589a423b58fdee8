"""What may import what: the model stays plain, and heavy libraries wait until they are used."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


def modules_after(code):
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_the_model_knows_neither_textual_nor_zenoh():
    code = (
        "import pkgutil, importlib, silo_tui.model as model\n"
        "for each in pkgutil.iter_modules(model.__path__):\n    importlib.import_module('silo_tui.model.' + each.name)"
    )
    assert not modules_after(code) & {"textual", "zenoh", "rich"}


def test_the_app_is_there_without_plotext_and_zenoh():
    assert not modules_after("import silo_tui.app") & {"plotext", "zenoh"}


def test_help_needs_no_textual():
    assert "textual" not in modules_after("import silo_tui.cli")
