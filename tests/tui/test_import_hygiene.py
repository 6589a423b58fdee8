"""What may import what: the model stays plain; what waits until it is used stands in tests/unit beside that of silo."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import silo_tui

pytestmark = pytest.mark.slow


def test_the_model_knows_neither_textual_nor_zenoh():
    code = (
        "import pkgutil, importlib, sys, silo_tui.model as model\n"
        "for each in pkgutil.walk_packages(model.__path__, 'silo_tui.model.'):\n"
        "    importlib.import_module(each.name)\n"
        "print({'textual', 'zenoh', 'rich'} & set(sys.modules))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"


def test_small_classes_of_a_first_screen_are_structs_as_a_dataclass_takes_half_a_millisecond_to_be_made():
    code = (
        "import silo_tui.app, silo_tui.screens.table, silo.client.client, silo.fleet.fleet, dataclasses, sys\n"
        "made = [each for one in list(sys.modules.values()) for each in vars(one).values()\n"
        "        if one.__name__.startswith('silo') and isinstance(each, type) and dataclasses.is_dataclass(each)]\n"
        "print(len({each for each in made if each.__module__.startswith('silo')}))"
    )
    assert int(subprocess.check_output([sys.executable, "-c", code], text=True)) <= 7


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
