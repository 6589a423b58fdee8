"""Which part may know which: held in the text of the modules, and in fresh processes that import them."""

import ast
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# part of the program -> what none of its modules may import, not even within a function
FORBIDDEN = {
    "silo": ["silo_tui", "textual"],
    "silo/collecting": ["zenoh", "silo.files", "silo.ipc", "silo.helper", "silo.logger", "silo.analysis"],
    "silo/files": ["zenoh", "silo.logger", "silo.collecting", "silo.helper"],
    "silo/analysis": ["zenoh", "silo.logger", "silo.collecting", "silo.helper"],
    "silo/model": ["numpy", "zenoh"],
    "silo/kinds": ["numpy", "zenoh", "silo.collecting", "silo.files"],
    "silo/recording": ["zenoh", "silo.logger", "silo.collecting", "silo.files"],
    "silo_tui/model": ["textual", "zenoh", "silo.logger", "silo.collecting"],
    "silo/programs": ["zenoh", "silo.helper"],
}

# module -> what must not be loaded in a process that imported nothing else
NOT_LOADED = {
    "silo": ["numpy", "zenoh", "textual", "plotext", "msgspec"],
    "silo.model": ["numpy", "zenoh", "textual"],
    "silo.kinds": ["numpy", "silo.collecting", "silo.files"],
    "silo.files.formats": ["numpy", "silo.files.saving"],
    "silo.ipc.messages": ["numpy", "zenoh", "textual"],
    "silo.ipc.client": ["numpy", "textual", "plotext"],
    "silo.cli": ["numpy", "zenoh", "textual", "plotext", "silo_tui"],
    "silo.logger.logger": ["zenoh", "textual", "plotext", "silo.files", "silo.logger.serving", "silo_tui", "yaml"],
    "silo.collecting.run": ["zenoh", "silo.files", "silo.ipc", "silo.logger.logger"],
    "silo.files": ["zenoh", "silo.logger.logger", "silo.collecting"],
    "silo.analysis.log": ["zenoh", "silo.logger.logger", "silo.collecting"],
    "silo.recording": ["zenoh", "silo.collecting", "silo.files"],
    "silo_tui.cli": ["textual", "zenoh", "numpy"],
    "silo_tui.model.table": ["textual", "zenoh"],
    "silo_tui.model.live": ["textual", "zenoh"],
    "silo_tui.model.plots": ["textual", "zenoh"],
}


def modules_of(part):
    folder = ROOT / part
    return sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]


def imports_of(path):
    """Every module that a file imports, also within functions, but not those only for type checkers."""
    tree = ast.parse(path.read_text())
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide who is meant"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def is_within(module, part):
    return module == part or module.startswith(part + ".")


@pytest.mark.parametrize("part", FORBIDDEN)
def test_a_part_imports_nothing_that_it_must_not_know(part):
    files = [path for path in modules_of(part) if path.exists()]
    if not files:
        pytest.skip(f"there is no {part}")
    found = [
        f"{path.relative_to(ROOT)} imports {module}"
        for path in files
        for module in imports_of(path)
        for forbidden in FORBIDDEN[part]
        if is_within(module, forbidden)
    ]
    assert found == []


@pytest.mark.parametrize("module", NOT_LOADED)
def test_a_module_loads_nothing_that_it_can_do_without(module):
    if importlib.util.find_spec(module.split(".")[0]) is None or not find(module):
        pytest.skip(f"there is no {module}")
    program = f"import sys, {module}; print(*sorted(sys.modules), sep=chr(10))"
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, check=True)
    loaded = run.stdout.split()
    found = [name for name in loaded for unwanted in NOT_LOADED[module] if is_within(name, unwanted)]
    assert found == []


def find(module):
    path = ROOT / module.replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


@pytest.mark.parametrize("name", sorted({*__import__("silo").__all__}))
def test_every_public_name_has_a_home(name):
    import silo

    if name in ("Log", "Signal", "open_log") and not find("silo.analysis.log"):
        pytest.skip("there is no silo.analysis.log")
    assert getattr(silo, name).__name__


def test_an_unknown_name_is_an_attribute_error():
    import silo

    with pytest.raises(AttributeError, match="module 'silo' has no attribute 'loger'"):
        silo.loger  # noqa: B018
