"""What is handed out: a wheel with all that runs, an sdist with all that tests and documents it."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.egg-info", "build", ".*_cache", ".git", ".venv", "site")
BUILD = "import backend, sys; folder = sys.argv[1]; backend.build_wheel(folder); backend.build_sdist(folder)"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[set[str], set[str], str]:
    """The names in the wheel, those in the sdist, and the metadata."""
    pytest.importorskip("setuptools", "77", reason="this environment can't build; pip install 'setuptools>=77'")
    folder = tmp_path_factory.mktemp("built")
    tree = folder / "tree"
    shutil.copytree(ROOT, tree, symlinks=True, ignore=LEFT_OUT)
    environment = {**os.environ, "PYTHONPATH": str(tree / ".ci")}
    command = [sys.executable, "-c", BUILD, str(folder)]
    done = subprocess.run(command, cwd=tree, env=environment, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    wheel = zipfile.ZipFile(next(folder.glob("*.whl")))
    with tarfile.open(next(folder.glob("*.tar.gz"))) as sdist:
        in_sdist = {name.partition("/")[2] for name in sdist.getnames()}
    metadata = next(name for name in wheel.namelist() if name.endswith("METADATA"))
    return set(wheel.namelist()), in_sdist, wheel.read(metadata).decode()


def in_tree(*folders: str) -> set[str]:
    paths = (path for folder in folders for path in (ROOT / folder).rglob("*"))
    return {str(path.relative_to(ROOT)) for path in paths if path.is_file() and "__pycache__" not in path.parts}


def test_the_wheel_holds_every_file_of_both_packages(built):
    wheel, _, _ = built
    assert in_tree("silo", "silo_tui") - wheel == set()


def test_the_wheel_holds_the_examples_and_nothing_beside_the_packages(built):
    wheel, _, _ = built
    assert {f"silo/{name}" for name in in_tree("config")} - wheel == set()
    assert {name.split("/")[0].split("-")[0] for name in wheel} == {"silo", "silo_tui", "silo_logger"}


def test_the_sdist_holds_tests_documents_and_what_checks_them(built):
    _, sdist, _ = built
    assert {name for name in in_tree("tests", ".docs", ".ci", "config") if "/site/" not in name} - sdist == set()
    assert {"pyproject.toml", "README.md", "LICENSE"} - sdist == set()


def test_the_license_is_an_expression_that_programs_read(built):
    _, _, metadata = built
    assert "License-Expression: BSD-3-Clause" in metadata
    assert "License-File: LICENSE" in metadata


def test_the_extra_all_brings_what_every_other_one_brings_but_those_of_developers(built):
    _, _, metadata = built
    lines = metadata.splitlines()
    own = {"all", "docs", "test", "rerun"}  # the last by its size
    extras = {line.split(": ")[1] for line in lines if line.startswith("Provides-Extra")} - own
    (whole,) = [line for line in lines if line.endswith('extra == "all"')]
    assert set(whole.partition("[")[2].partition("]")[0].split(",")) == extras
