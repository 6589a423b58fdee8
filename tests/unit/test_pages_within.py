"""The pages on what silo is made of: files, threads, locks and endings that they name are there, and they name all."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from silo.core import runtime
from silo.helper import dead_robot
from silo.helper.lanes import Lane
from silo.net import session

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / ".docs"
THREADS = (PAGES / "threads.md").read_text()
FOLDER = (PAGES / "runtime-folder.md").read_text()
NAMES_FILES = [
    PAGES / "architecture.md",
    PAGES / "life-of-a-request.md",
    PAGES / "promises.md",
    PAGES / "runtime-folder.md",
    PAGES / "threads.md",
    ROOT / ".github" / "CONTRIBUTING.md",
]


def calls_of_threading(*names: str) -> Iterator[tuple[str, ast.Call]]:
    """Where something of `threading` is made: file and call."""
    for path in sorted((ROOT / "silo").rglob("*.py")):
        if "programs" in path.parts:
            continue
        text = path.read_text()
        if not any(name in text for name in names):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and ast.unparse(node.func).removeprefix("threading.") in names:
                yield str(path.relative_to(ROOT)), node


def thread_names() -> set[str]:
    """Names that threads are given in the code; those of lanes, each."""
    given = {
        keyword.value.value
        for _, call in calls_of_threading("Thread")
        for keyword in call.keywords
        if keyword.arg == "name" and isinstance(keyword.value, ast.Constant)
    }
    pools = (call.args[1] for _, call in calls_of_threading("ThreadPoolExecutor") if len(call.args) > 1)
    given |= {str(name.value) for name in pools if isinstance(name, ast.Constant)}
    return given | {f"lane {lane.name.lower()}" for lane in Lane}


@pytest.mark.parametrize("page", NAMES_FILES, ids=lambda path: path.stem)
def test_each_file_that_a_page_names_is_there(page: Path) -> None:
    named = set(re.findall(r"\bsilo(?:_tui)?/(?:\w+/)*\w+\.py\b", page.read_text()))
    assert named or page.stem == "architecture"
    assert [one for one in sorted(named) if not (ROOT / one).is_file()] == []


def test_each_folder_that_a_page_names_is_there() -> None:
    for page in NAMES_FILES:
        named = set(re.findall(r"`(silo(?:_tui)?/(?:\w+/)*)`", page.read_text()))
        assert [one for one in sorted(named) if not (ROOT / one).is_dir()] == [], page


def test_the_page_of_threads_has_each_thread_of_the_code() -> None:
    assert [name for name in sorted(thread_names()) if f"`{name}`" not in THREADS] == []


def test_each_thread_on_the_page_is_in_the_code() -> None:
    rows = [line.split("|")[1] for line in THREADS.splitlines() if line.count("|") == 4]
    told = {name for row in rows for name in re.findall(r"`([^`]+)`", row) if "/" not in name}
    assert told - thread_names() == set()


def test_the_page_of_threads_has_each_file_that_makes_a_lock() -> None:
    files = {path for path, _ in calls_of_threading("Lock", "RLock", "Condition")}
    assert [one for one in sorted(files) if f"`{one}`" not in THREADS] == []


def test_the_page_of_the_runtime_folder_has_each_ending() -> None:
    endings = {value for name, value in vars(runtime).items() if name.endswith("_SUFFIX")}
    endings |= {session.SOCKET_SUFFIX, *(session.SOCKET_SUFFIX + one.value for one in session.Beside)}
    assert [one for one in sorted(endings) if f"{one}`" not in FOLDER] == []


def test_the_page_says_how_long_the_helper_of_a_dead_program_stays() -> None:
    assert f"**{dead_robot.WITHOUT_CLIENTS_S:.0f} s**" in FOLDER
    assert f"**{dead_robot.WITH_CLIENTS_S:.0f} s**" in FOLDER
