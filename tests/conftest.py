"""For all tests: a runtime folder of their own, so that they meet no logger of this computer and leave none behind.

Tests of the slow tier are marked `slow`. Whatever uses a fixture of `SLOW_FIXTURES` or stands in a folder of
`SLOW_FOLDERS` is so by itself; a test that starts a process and is not marked fails, so that the fast tier stays fast.

Tests marked `sampled` try some of their cases, others with each commit (`drawn`). `SILO_CASES=all` tries all, as
`.ci/run` does; any other word of it draws as that word says.
"""

import contextlib
import functools
import gc
import marshal
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from _pytest.assertion import rewrite

from silo.core.runtime import shared_memory_root
from tests.examples import load_profile
from tests.waiting import wait_until
from tests.warm import ADDRESS, COLD, HEAD, HOME, Nursery, WarmPopen
from tests.watchdog import pytest_timeout_set_timer  # noqa: F401

SLOW_FIXTURES = {"bench", "robots"}  # they start helper processes
SLOW_FOLDERS = {"crash"}


ROOM_BYTES = 4 << 30  # all folders of failed tests, and those of four tests that write much


def pytest_configure(config: pytest.Config) -> None:
    root = shared_memory_root()
    if not hasattr(config, "workerinput"):
        os.environ["SILO_TEST_ROOM"] = tempfile.mkdtemp(prefix="silo-test-", dir=root)
        Path(os.environ["SILO_TEST_ROOM"]).chmod(0o1777)  # as that which it lies in
        os.environ[HEAD] = str(os.getpid())
    if "PYTEST_DEBUG_TEMPROOT" not in os.environ and shutil.disk_usage(root).free > ROOM_BYTES:
        # a file that is written anew goes to the disk as it is closed: half of the time of those that do so often
        os.environ["PYTEST_DEBUG_TEMPROOT"] = str(root)
    if paths := os.environ.get("PYTHONPATH"):
        # `PYTHONPATH=.` is this folder for processes that start in another one as well: else they find an installed
        # silo in place of this one, and none starts warm
        absolute = [path and str(Path(path).absolute()) for path in paths.split(os.pathsep)]
        os.environ["PYTHONPATH"] = os.pathsep.join(absolute)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell's background job: programs would not hear
        signal.signal(signal.SIGINT, signal.default_int_handler)
    load_profile(fast=config.option.markexpr == "not slow")


# Also where the environment says otherwise: the suite starts some 800 processes, and each would compile a hundred
# modules of silo for itself, 0.2 s of processor time.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


# What is collected stays to the end: to look through it again and again for garbage takes a third of the time of
# collection, and a tenth of that of the tests.
gc.disable()


# pytest hands the file to `marshal.load`, which calls it for each number and word: of a worker that reads 400 modules
# a twentieth of what it takes to collect.
rewrite.marshal = SimpleNamespace(dumps=marshal.dumps, load=lambda file: marshal.loads(file.read()))  # type: ignore[attr-defined]


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    gc.freeze()
    gc.set_threshold(50_000, 10, 10)
    gc.enable()


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Three workers per processor, as the slow tests wait for processes; one for each GB of memory at most.

    Those of the fast tier wait for nothing: one per processor, as each takes seven seconds and more for itself, in
    which it collects all tests and loads what they use. None where tests are named by their file, as they begin sooner
    without.
    """
    if any(".py" in argument for argument in config.args):
        return 0
    memory_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 30
    processors = len(os.sched_getaffinity(0))
    per_processor = 1 if config.option.markexpr == "not slow" else 3
    workers = min(per_processor * processors, max(1, memory_gb))
    if workers > 1:
        _compile_tests(processors)
    return workers


def _compile_tests(processes: int) -> None:
    """Have each module of a fresh clone compiled once: else every worker does so, for eight seconds of a processor."""
    folders = [path for path in Path(__file__).parent.iterdir() if path.is_dir() and list(path.glob("test_*.py"))]
    fresh = [path for path in folders if not (path / "__pycache__").exists()]
    fresh.sort(key=lambda path: sum(file.stat().st_size for file in path.iterdir()), reverse=True)
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-n0", "-p", "no:cacheprovider"]
    shares = [share for share in (fresh[number::processes] for number in range(processes)) if share]
    compiling = [
        subprocess.Popen([*command, *share], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for share in shares
    ]
    for one in compiling:
        one.wait()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Tell of a phase that went well without the names of all that it is in: a third of what a worker hands on."""
    report = (yield).get_result()  # type: ignore[misc]
    if report.passed and hasattr(item.config, "workerinput"):
        report.keywords = {}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if SLOW_FIXTURES & set(getattr(item, "fixturenames", ())) or item.path.parent.name in SLOW_FOLDERS:
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("slow"):
            item.user_properties.append(("tier", "slow"))  # so that a JUnit report tells what each tier took


@pytest.fixture
def small_disk(tmp_path):
    """A log folder on a disk of 8 MB, of which 168 kB are left to others."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=8m", "none", str(folder)], check=False, capture_output=True
    )
    if mounted.returncode:
        pytest.skip("needs the right to mount")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def small_files(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], contextlib.AbstractContextManager[None]]:
    """A block in which no file grows beyond so many bytes; Python compiles none, which it keeps cut off."""

    @contextlib.contextmanager
    def limited(size_bytes: int) -> Iterator[None]:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, before[1]))
        try:
            with monkeypatch.context() as patch:
                patch.setattr(sys, "dont_write_bytecode", True)
                yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limited


_started: list[str] = []


_begin = subprocess.Popen.__init__


def _begin_noted(process: Any, args: Any, *more: Any, **named: Any) -> None:
    program = named.get("executable") or (args if isinstance(args, str | bytes | os.PathLike) else args[0])
    if program == sys.executable:
        _started.append(f"subprocess.Popen {args}")
    _begin(process, args, *more, **named)


# not by an audit hook, which is called whenever a file is opened: a hundredth of what all tests take
subprocess.Popen.__init__ = _begin_noted  # type: ignore[method-assign]
os.register_at_fork(before=lambda: _started.append("os.fork"))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    _started.clear()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    """No fixture, which each test would set up for itself."""
    yield
    if _started and not item.get_closest_marker("slow"):
        pytest.fail(f"a test that starts a process belongs to the slow tier, mark it so: {_started[0]}")


@pytest.fixture(autouse=True)
def runtime_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A private folder for segments and sockets; its path is short, as sockets need it."""
    folder = Path(tempfile.mkdtemp(prefix="", dir=os.environ["SILO_TEST_ROOM"]))
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(folder))
    state = folder.with_name(f"{folder.name}-state")  # made by the first journal, as a user's own
    monkeypatch.setenv("XDG_STATE_HOME", str(state))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder / "no-config"))  # no remotes of this user
    yield folder
    shutil.rmtree(folder, ignore_errors=True)
    for name in os.listdir(folder.parent):  # noqa: PTH208 - a glob compiles an expression for each test
        if name.startswith(f"{folder.name}-"):  # of groups, and of the state of a user
            shutil.rmtree(folder.parent / name, ignore_errors=True)


def pytest_unconfigure(config: pytest.Config) -> None:
    """What a process made again that ended after its test goes as well."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ["SILO_TEST_ROOM"], ignore_errors=True)


@functools.cache
def _word_to_draw_by() -> str:
    """What `SILO_CASES` says, else the commit, so that a run of it tries the same cases again."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    return os.environ.get("SILO_CASES") or subprocess.run(command, capture_output=True, text=True, check=False).stdout


@pytest.fixture
def drawn(request: pytest.FixtureRequest) -> Callable[..., list[Any]]:
    """`drawn(cases, count, block=1)`: so many of them in their order, block by block, or all."""
    assert request.node.get_closest_marker("sampled"), "mark it `sampled`: .ci/run tries all cases of those alone"

    def draw(cases: Sequence[Any], count: int, block: int = 1) -> list[Any]:
        word = _word_to_draw_by()
        if word == "all":
            return list(cases)
        starts = range(0, len(cases), block)
        chosen = random.Random(f"{word} {request.node.nodeid}").sample(starts, min(len(starts), count // block))
        return [case for start in sorted(chosen) for case in cases[start : start + block]]

    return draw


@pytest.fixture
def disk_path() -> Iterator[Path]:
    """A folder on a disk, as `tmp_path` is where memory has no room."""
    with tempfile.TemporaryDirectory(prefix="silo-test-") as folder:
        yield Path(folder)


@pytest.fixture(scope="session")
def nursery() -> Nursery:
    """From where processes start warm."""
    made = WarmPopen.nursery = Nursery(Path(os.environ["SILO_TEST_ROOM"]))
    return made


@pytest.fixture
def warm(nursery: Nursery, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes of Python start warm, and what these start."""
    monkeypatch.setenv(ADDRESS, nursery.name)
    monkeypatch.setattr("subprocess.Popen", WarmPopen)


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch) -> None:
    """The start of processes that users have: what comes of it is looked at."""
    monkeypatch.setenv(COLD, "all")


@pytest.fixture
def cold_children(monkeypatch: pytest.MonkeyPatch) -> None:
    """Helper processes are the parents of what they start, whose names and limits are looked at."""
    monkeypatch.setenv(COLD, "silo.recorder silo.recordings.writing")


@pytest.fixture
def helper_waits(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """`helper_waits("silo.helper.helper", TERM_GRACE_S=0.5)`: so long do those wait that start from now on."""

    def change(module: str, **seconds: float) -> None:
        folder = tmp_path_factory.mktemp("waits")
        put = f"import {module} as of; vars(of).update({seconds})"
        words = f"import sys\nif 'silo.helper' in sys.orig_argv:\n    {put}\n"
        (folder / "sitecustomize.py").write_text(words)
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), HOME]))  # they start cold

    return change


@pytest.fixture
def until() -> Callable[..., object]:
    """Waits for something to become true, and returns it."""
    return wait_until


@pytest.fixture
def new_logger(tmp_path: Path) -> Iterator[Callable[..., "object"]]:
    """Makes loggers that keep their files in `tmp_path`, and closes them when the test ends."""
    from silo.logger.logger import Logger

    made = []

    def make(name: str = "test", **options: object) -> Logger:
        chosen = {"folder": tmp_path, "script": tmp_path / "logger.yaml", **options}
        logger = Logger(name, **chosen)
        made.append(logger)
        return logger

    yield make
    for logger in made:
        logger.close()
