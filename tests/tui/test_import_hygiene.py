"""What may import what: the model stays plain, and heavy libraries wait until they are used."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import silo_tui

pytestmark = pytest.mark.slow


def modules_after(code):
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_the_model_knows_neither_textual_nor_zenoh():
    code = (
        "import pkgutil, importlib, silo_tui.model as model\n"
        "for each in pkgutil.walk_packages(model.__path__, 'silo_tui.model.'):\n    importlib.import_module(each.name)"
    )
    assert not modules_after(code) & {"textual", "zenoh", "rich"}


def test_the_app_is_there_without_plotext_and_zenoh():
    assert not modules_after("import silo_tui.app") & {"plotext", "zenoh"}


def test_a_first_screen_waits_for_no_plot_no_file_and_no_form():
    loaded = modules_after("import silo_tui.cli, silo_tui.app")
    waits = (
        "silo.analysis",
        "silo.judging",
        "silo.files.silo",
        "silo_tui.screens.files",
        "silo_tui.sessions.recorded",
        "silo.expressions",
        "silo_tui.screens.lists.loggers",
    )
    waits += ("silo_tui.screens.plots.monitor", "silo_tui.screens.dialogs.form", "silo_tui.sessions.held")
    assert not {one for one in loaded for each in waits if one == each or one.startswith(f"{each}.")}


def test_a_first_screen_needs_no_yaml_no_checksum_and_no_decoder_of_requests():
    loaded = modules_after(
        "import silo_tui.app, silo_tui.screens.table, silo.client.client, silo.fleet.fleet, silo_tui.settings.file"
    )
    assert not loaded & {"yaml", "_hashlib", "csv", "silo.requests", "silo_tui.layouts.texts"}


def test_small_classes_of_a_first_screen_are_structs_as_a_dataclass_takes_half_a_millisecond_to_be_made():
    code = (
        "import silo_tui.app, silo_tui.screens.table, silo.client.client, silo.fleet.fleet, dataclasses, sys\n"
        "made = [each for one in list(sys.modules.values()) for each in vars(one).values()\n"
        "        if one.__name__.startswith('silo') and isinstance(each, type) and dataclasses.is_dataclass(each)]\n"
        "print(len({each for each in made if each.__module__.startswith('silo')}), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stderr) <= 7


def test_help_needs_no_textual():
    assert "textual" not in modules_after("import silo_tui.cli")


def test_no_coroutine_is_handed_to_a_worker_that_may_be_cancelled_before_it_runs():
    handed = [
        (path.name, ast.unparse(node.args[0]).partition("(")[0])
        for path in sorted(Path(silo_tui.__file__).parent.rglob("*.py"))
        if "run_worker" in (text := path.read_text("utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".run_worker")
    ]
    # `run_aside` makes it when the worker begins; a flow is a coroutine already, and nothing cancels its group
    assert handed == [("context.py", "self._guarded"), ("modal.py", "cast")]
