"""Who may import whom stands in `pyproject.toml`; `.ci/run` checks it, and here damaged copies are refused."""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # in processes of their own: import-linter silences the loggers of its process

ROOT = Path(__file__).resolve().parents[2]
LINT = "from importlinter.cli import lint_imports_command as lint; lint(['--no-logo', '--no-cache'])"


def lint(house: Path) -> tuple[bool, str]:
    """Whether the contracts of a house are kept, and what is said of it."""
    environment = dict(os.environ, PYTHONPATH=str(house), COLUMNS="300")
    done = subprocess.run(
        [sys.executable, "-c", LINT], cwd=house, env=environment, check=False, capture_output=True, text=True
    )
    return done.returncode == 0, done.stdout + done.stderr


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A copy of the program to be damaged."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in ("silo", "silo_tui"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def rename(old: str, new: str) -> Callable[[Path], None]:
    def damage(house: Path) -> None:
        (house / old).rename(house / new)

    return damage


def add_folder(name: str) -> Callable[[Path], None]:
    def damage(house: Path) -> None:
        (house / name).mkdir()
        (house / name / "__init__.py").write_text('"""A room."""\n')

    return damage


def declare(line: str) -> Callable[[Path], None]:
    """Add an exception that nobody needs."""

    def damage(house: Path) -> None:
        path = house / "pyproject.toml"
        head, circles = path.read_text().split('name = "no circles"')
        circles = circles.replace("ignore_imports = [", f"ignore_imports = [\n    {line!r},")
        if "ignore_imports" not in circles:
            circles = circles.rstrip() + f"\nignore_imports = [{line!r}]\n"
        path.write_text(head + 'name = "no circles"' + circles)

    return damage


def test_a_copy_of_the_house_keeps_them_too(house: Path) -> None:
    kept, said = lint(house)
    assert kept, said


DAMAGES = {
    "a renamed folder": (rename("silo/segment", "silo/memory"), "segment"),
    "a renamed folder of silo_tui": (rename("silo_tui/model", "silo_tui/models"), "model"),
    "a renamed module": (rename("silo/version.py", "silo/edition.py"), "version"),
    "a folder without a storey": (add_folder("silo/extra"), "silo.extra"),
    "an exception that nobody needs": (declare("silo.version -> silo.errors"), "silo.version -> silo.errors"),
}
TYPES_ALONE = "if TYPE_CHECKING:\n    from silo.logger.logger import Logger"
# what is inserted where, and what is said of it: each of them, where all are in one house
IMPORTS = {
    "zenoh in the loop": ("silo/loop/plan.py", "import zenoh", "silo.loop.plan -> zenoh"),
    "zenoh within a function": (
        "silo/files/saving.py",
        "def f() -> None:\n    import zenoh",
        "silo.files.saving -> zenoh",
    ),
    "zenoh at second hand": (
        "silo_tui/model/words/text.py",
        "import silo.net.session",
        "silo_tui.model.words.text -> silo.net.session",
    ),
    "a logger for type checkers": ("silo/files/saving.py", TYPES_ALONE, "silo.files.saving -> silo.logger.logger"),
    "the public names": ("silo/loop/plan.py", "from silo import Logger", "silo.loop.plan -> silo ("),
    "a terminal": ("silo/cli/loggers/watch.py", "import silo_tui.app", "silo.cli.loggers.watch -> silo_tui.app"),
    "the helper within the robot program": (
        "silo/logger/registrations.py",
        "import silo.helper.saver",
        "silo.logger.registrations -> silo.helper.saver",
    ),
    "upstairs": ("silo/net/keys.py", "import silo.settings.script", "silo.net.keys -> silo.settings.script"),
    "a circle of siblings": (
        "silo/files/atomic.py",
        "import silo.files.optional_packages",
        "No cycles are allowed in silo.files",
    ),
    "a circle far below": (
        "silo/programs/demo/gait.py",
        "import silo.programs.demo.robot",
        "No cycles are allowed in silo.programs.demo",
    ),
}


@pytest.mark.parametrize("case", DAMAGES)
def test_a_damaged_house_is_refused(case: str, house: Path) -> None:
    damage, word = DAMAGES[case]
    damage(house)
    kept, said = lint(house)
    assert not kept
    assert word in " ".join(said.split())


def test_each_import_that_a_contract_forbids_is_told(house: Path) -> None:
    for file, code, _ in IMPORTS.values():
        with (house / file).open("a") as module:
            module.write(f"\n\n{code}\n")
    kept, said = lint(house)
    assert not kept
    told = " ".join(said.split())
    assert [case for case, (_, _, word) in IMPORTS.items() if word not in told] == []


def test_a_public_class_has_a_name_of_its_own() -> None:
    where: dict[str, list[str]] = {}
    for package in ("silo", "silo_tui"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.parse(path.read_text()).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    where.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert len(where) > 500
    assert {name: files for name, files in where.items() if len(files) > 1} == {}
