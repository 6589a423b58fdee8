"""What must not be loaded in a fresh process; who may import whom at all stands in `pyproject.toml`."""

import ast
import importlib.util
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import silo
import silo.files

ROOT = Path(__file__).resolve().parents[2]

# modules -> what must not be loaded in a process that imported nothing else
NOT_LOADED = {
    "silo": ["numpy", "zenoh", "textual", "plotext", "msgspec", "typing"],
    "silo.core.elements": ["numpy", "zenoh", "textual"],
    "silo.core.kinds": ["numpy", "silo.segment", "silo.journal", "silo.loop", "silo.files"],
    "silo.files.formats": [
        "numpy",
        *(f"silo.files.{each.name}" for each in pkgutil.iter_modules(silo.files.__path__) if each.name != "formats"),
    ],
    "silo.cli.logs.saved_logs": ["numpy", "plotext", "matplotlib", "pyarrow", "zstandard", "textual"],
    "silo.requests": ["numpy", "zenoh", "textual"],
    "silo.client.connect": ["numpy", "textual", "plotext"],
    "silo.cli": ["numpy", "zenoh", "textual", "plotext", "silo_tui", "click", "msgspec", "typing"],
    "silo.fleet.resolving": [
        "numpy",
        "textual",
        "silo.client",
        "silo.conditions",
        "silo.files",
        "silo.history",
        "silo.live",
        "silo.requests",
        "silo.scripts",
        "hashlib",
        "html",
        "tempfile",
    ],
    "silo.logger.logger": [
        "zenoh",
        "textual",
        "plotext",
        "silo.files",
        "silo.logger.serving.serving",
        "silo_tui",
        "yaml",
    ],
    "silo.loop.run": ["zenoh", "silo.files", "silo.net", "silo.rpc", "silo.client", "silo.logger.logger"],
    "silo.files": ["zenoh", "silo.logger.logger", "silo.segment", "silo.journal", "silo.loop"],
    "silo.analysis.log": ["zenoh", "silo.logger.logger", "silo.segment", "silo.journal", "silo.loop"],
    "silo.core.recording": ["zenoh", "silo.segment", "silo.journal", "silo.loop", "silo.files"],
    "silo_tui.cli": ["textual", "zenoh", "numpy"],
    "silo_tui.app": ["plotext", "zenoh"],
    # a first screen waits for no plot, no file and no form
    "silo_tui.cli, silo_tui.app": [
        "silo.analysis",
        "silo.judging",
        "silo.files.silo",
        "silo.expressions",
        "silo_tui.screens.files",
        "silo_tui.screens.lists.loggers",
        "silo_tui.screens.plots.monitor",
        "silo_tui.screens.dialogs.form",
        "silo_tui.sessions.recorded",
        "silo_tui.sessions.held",
    ],
    # it needs no yaml, no checksum and no decoder of requests
    "silo_tui.app, silo_tui.screens.table, silo.client.client, silo.fleet.fleet, silo_tui.settings.file": [
        "yaml",
        "_hashlib",
        "csv",
        "silo.requests",
        "silo_tui.layouts.texts",
    ],
}


def loaded_by(module: str) -> list[str]:
    """Every module of a fresh process that imported this one, or these."""
    program = f"import sys, {module}; print(*sorted(sys.modules), sep=chr(10))"
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    run = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


def is_within(module: str, part: str) -> bool:
    return module == part or module.startswith(part + ".")


@pytest.mark.slow
@pytest.mark.parametrize("module", NOT_LOADED)
def test_a_module_loads_nothing_that_it_can_do_without(module: str) -> None:
    unwanted = NOT_LOADED[module]
    assert [name for name in loaded_by(module) if any(is_within(name, part) for part in unwanted)] == []


@pytest.mark.slow
def test_a_module_that_is_gone_is_a_failure() -> None:
    with pytest.raises(AssertionError, match=r"No module named 'silo\.gone'"):
        loaded_by("silo.gone")


def test_type_checkers_and_programs_are_told_the_same_public_names() -> None:
    tree = ast.parse((ROOT / "silo/__init__.py").read_text())
    typing_only = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in typing_only.body if isinstance(node, ast.ImportFrom)]
    told = {alias.name: node.module for node in imports for alias in node.names}
    assert [name for name, home in told.items() if home == "silo"] == [
        "errors",
        "types",
    ]
    assert {name: home for name, home in told.items() if home != "silo"} == silo._HOME_OF
    assert all(alias.asname == alias.name for node in imports for alias in node.names)


@pytest.mark.slow
def test_completion_sees_every_public_name_before_it_is_loaded() -> None:
    program = "import silo, sys; assert set(silo.__all__) <= set(dir(silo)); assert 'silo.logger' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], env=dict(os.environ, PYTHONPATH=str(ROOT)), check=True)


@pytest.mark.parametrize("part", sorted({part for parts in NOT_LOADED.values() for part in parts}))
def test_what_must_not_be_loaded_is_there_under_this_name(part: str) -> None:
    assert importlib.util.find_spec(part) is not None


@pytest.mark.parametrize("name", sorted(silo.__all__))
def test_every_public_name_has_a_home(name: str) -> None:
    assert getattr(silo, name).__name__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'silo' has no attribute 'loger'"):
        silo.loger  # noqa: B018


NEEDED = {  # the extra -> what needs which packages of it
    "analysis": "pandas: tables, tables of runs; polars: tables; scipy: rotations; xarray: tables",
    "archive": "fsspec: Archives; polars: Archives; pyarrow: Archives",
    "bags": "pyulog: ULogs; rosbags: bags of ROS 1, bags of others",
    "convert": "h5py: HDF5 files; pyarrow: Data sets, Parquet files; scipy: .mat files",
    "mcp": "mcp: servers for agents; mcp_types: servers for agents",
    "plot": "matplotlib: pictures, plots on a screen",
    "query": "duckdb: SQL over runs; polars: SQL over runs, Tables of runs",
    "rerun": "rerun: .rrd files",
}


def test_a_package_that_is_missing_is_in_the_extra_that_is_named():
    found = {}
    for path in sorted((ROOT / "silo").rglob("*.py")):
        words = {}
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "need" and hasattr(node.args[0], "value"):
                words = words or vars(importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts)))
                module, extra, what = (words.get(ast.unparse(one), getattr(one, "value", "")) for one in node.args)
                found.setdefault(extra, {}).setdefault(module.partition(".")[0], set()).add(what)
    told = {
        extra: "; ".join(f"{package}: {', '.join(sorted(whats))}" for package, whats in sorted(packages.items()))
        for extra, packages in sorted(found.items())
    }
    assert told == NEEDED
    extras = (ROOT / "pyproject.toml").read_text().partition("[project.optional-dependencies]")[2]
    for extra, packages in found.items():
        installed = extras.partition(f"\n{extra} = [")[2].partition("]")[0].replace("-sdk", "")
        assert all(f'"{package.partition("_")[0]}>=' in installed for package in packages)
