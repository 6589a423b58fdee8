"""Puts small faults into the code, one at a time, and looks whether the nearest tests notice.

    python .bench/long/mutations.py silo/judging silo/history/pins.py --count 100 [--seed TEXT]
    python .bench/long/mutations.py silo silo_tui --count 2000 --out FILE [--fast] [--minutes 30]

A fault is a comparison that is off by one, a sign, a constant, a condition turned round, a lock that isn't taken, a
call left out. The places are drawn by a seed, that of the commit if no other is given, from all places of the modules
that were named. The nearest tests are those of the files that import the module, or speak of its folder, and of those
for other modules, as those that go through all screens and words: first those of the fast tier that run its line, as
many as take `BUDGET_S`; where these notice nothing, the slow ones of its own files. A fault after which they hang is
counted apart. Exit status 1 where some survive.

Which tests run which lines is looked up once for each state of the code and the tests, and kept: of all some 15 minutes
of processor time. Tests are loaded once: a fault within a function is put into a fork of that process, any other into
one that has loaded no silo yet.

With `--out` each result is a line of JSON that is written as soon as it is there, and what stands in the file already
isn't tried again while its module is the same: a run that was ended goes on, those of several days add up, and the
table is that of the whole file. With `--fast` no slow test is run: a run without tries what is left to them.
"""

import argparse
import ast
import functools
import gc
import hashlib
import importlib
import itertools
import json
import os
import pickle
import random
import re
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FrameType, FunctionType

import pytest

ROOT = Path(__file__).resolve().parents[2]
MOST_FILES = 12  # of nearest tests
MEMORY = Path("/dev/shm")
THROUGH_ALL = ["tests/files/test_sessions.py", "tests/tui/test_walks.py"]  # they go through most modules
QUICK = "not slow or through_all"  # the tests that are loaded once
BUDGET_S = 10.0  # of processor time, of the tests that a fault is tried on
CHEAP_S = 0.02
MOST_BYTES = 8 << 30  # of memory: some faults are lists without an end
MOST_FILE_BYTES = 1 << 30  # or files that fill the memory which they stand in
PASSED, NOTICED, NO_TESTS, BROKE = 0, 1, 5, 70  # exit statuses; pytest's others tell of modules that can't be loaded
LEFT = "left to slow"
# what tests load that is none of ours
PRELOADED = (
    "numpy", "zenoh", "msgspec", "yaml", "click", "psutil", "mcap.writer", "mcap.reader", "hypothesis.stateful",
    "textual.app", "textual.widgets", "textual.pilot", "polars", "pyarrow.parquet",
)  # fmt: skip
Reached = dict[str, tuple[float, dict[str, int]]]  # test -> its seconds, and the lines of each module as bits
COMPARED = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
WRITTEN = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
    ast.Is: "is", ast.IsNot: r"is\s+not", ast.In: "in", ast.NotIn: r"not\s+in",
}  # fmt: skip
SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "//"), ast.FloorDiv: ("//", "*")}
KEPT = {"strict", "frozen"}  # of zip and of structs: promises of who wrote it, that no program sees kept
TALK = {"log", "logging", "warnings", "click", "echo"}  # whose calls say something and do nothing


@dataclass(frozen=True)
class Fault:
    """One small change: `before` at `start` of a file becomes `after`."""

    module: str
    line: int
    kind: str
    start: int
    before: str
    after: str
    text: str  # of its module: the digest of what was there when it was drawn

    @property
    def told(self) -> str:
        """It in a line."""
        return f"{self.module}:{self.line} {self.kind}: {self.before[:60]!r} -> {self.after[:60]!r}"


class Places(ast.NodeVisitor):
    """Finds every place of a module where a small fault can be put in."""

    def __init__(self, module: str, text: str) -> None:
        self._module, self._text = module, text
        self._lines = [0]
        for line in text.encode().splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))
        self._bytes = text.encode()
        self._digest = hashlib.sha256(self._bytes).hexdigest()[:12]
        self.found: list[Fault] = []
        self.visit(ast.parse(text))

    def _at(self, line: int, column: int) -> int:
        return self._lines[line - 1] + column

    def _span(self, node: ast.AST) -> tuple[int, int]:
        assert isinstance(node, ast.expr | ast.stmt)
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)

    def _add(self, kind: str, start: int, end: int, after: str) -> None:
        line = self._bytes[:start].count(b"\n") + 1
        self.found.append(Fault(self._module, line, kind, start, self._bytes[start:end].decode(), after, self._digest))

    def _between(self, left: ast.AST, right: ast.AST, pattern: str, kind: str, after: str) -> None:
        start, end = self._span(left)[1], self._span(right)[0]
        found = re.search(pattern, self._bytes[start:end].decode())
        if found:
            self._add(kind, start + found.start(), start + found.end(), after)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
            kind = type(operator)
            self._between(left, right, WRITTEN[kind], "compare", COMPARED[kind])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        texts = [one for one in (node.left, node.right) if isinstance(one, ast.JoinedStr)]
        texts += [
            one for one in (node.left, node.right) if isinstance(one, ast.Constant) and isinstance(one.value, str)
        ]
        if type(node.op) in SIGNS and not texts:
            sign, other = SIGNS[type(node.op)]
            self._between(node.left, node.right, re.escape(sign), "sign", other)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        word, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._between(left, right, rf"\b{word}\b", "and/or", other)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not):
            self._add("not", self._span(node)[0], self._span(node.operand)[0], "")
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg not in KEPT:
            self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        start, end = self._span(node)
        if isinstance(node.value, bool):
            self._add("constant", start, end, str(not node.value))
        elif isinstance(node.value, int):
            self._add("constant", start, end, f"({self._bytes[start:end].decode()} + 1)")

    def _condition(self, test: ast.expr) -> None:
        start, end = self._span(test)
        self._add("condition", start, end, f"not ({self._bytes[start:end].decode()})")

    def visit_If(self, node: ast.If) -> None:
        if not (isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"):
            self._condition(node.test)
            self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._condition(node.test)
        self.generic_visit(node)

    def visit_With(self, node: ast.With) -> None:
        held = ast.unparse(node.items[0].context_expr)
        if "lock" in held.lower() and len(node.items) == 1:
            start, end = self._span(node.items[0].context_expr)
            self._add("lock", start, end, "__import__('contextlib').nullcontext()")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            whose = ast.unparse(node.value.func).split(".")
            if not TALK & set(whose):
                self._add("call left out", *self._span(node), "pass")
            self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """What is told has words of its own tests."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        for default in (*node.args.defaults, *(one for one in node.args.kw_defaults if one is not None)):
            self.visit(default)
        for statement in node.body:
            self.visit(statement)

    visit_AsyncFunctionDef = visit_FunctionDef


def modules_of(names: list[str]) -> list[str]:
    """Return the modules below what was named, from the root."""
    found: list[str] = []
    for name in names:
        path = ROOT / name
        paths = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        found += [str(one.relative_to(ROOT)) for one in paths]
    return found


@functools.cache
def nearest(module: str) -> list[str]:
    """Return the test files that hold a module: those that import it, or that speak of its folder where none does."""
    dotted = module.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    package, _, name = dotted.rpartition(".")
    own, others = re.escape(dotted), re.escape(package)
    patterns = [rf"^\s*(from {own} import|import {own}\b|from {others} import .*\b{name}\b)"]
    patterns += [rf"\b{re.escape(str(folder)).replace('/', '.')}\b" for folder in Path(module).parents[:-1]]
    for pattern in patterns:
        found = [path for path, text in _texts().items() if re.search(pattern, text, re.MULTILINE)]
        if found:
            found.sort(key=lambda path: (name not in path.name, path.stat().st_size))
            return [str(path.relative_to(ROOT)) for path in found[:MOST_FILES]]
    return []


@functools.cache
def _texts() -> dict[Path, str]:
    return {path: path.read_text() for path in sorted((ROOT / "tests").rglob("test_*.py"))}


def forked(work: Callable[[], int], limit_s: float | None = None) -> int | None:
    """Do something in a fork of this process, and return its exit status; None where it doesn't end."""
    pid = os.fork()
    if not pid:
        status = BROKE
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
            resource.setrlimit(resource.RLIMIT_FSIZE, (MOST_FILE_BYTES, MOST_FILE_BYTES))
            for descriptor in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
            status = work()
        finally:
            os._exit(status)
    end = os.pidfd_open(pid)
    ended = select.select([end], [], [], limit_s)[0]
    os.close(end)
    with suppress(ProcessLookupError):  # what it started as well
        os.killpg(pid, signal.SIGKILL)
    status = os.waitpid(pid, 0)[1]
    return os.waitstatus_to_exitcode(status) if ended else None


def tested(paths: Sequence[str], tier: str, plugin: "Some") -> int:
    """Run, or load, tests of a tier in this process."""
    options = [*plugin.options, "-q", "-n", "0", "-p", "no:cacheprovider", "-o", "timeout=0", "-m", tier]
    return int(pytest.main([*options, *paths], plugins=[plugin]))


class Some:
    """Of the tests that pytest has found, those that are wanted, or all; a property's example is not made small."""

    options: Sequence[str] = ("-x",)

    def __init__(self, wanted: Iterable[str] = ()) -> None:
        self._wanted = set(wanted)

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        from hypothesis import Phase, settings

        phases = [phase for phase in Phase if phase not in {Phase.shrink, Phase.explain}]
        settings.register_profile("unshrunk", settings.default, phases=phases)
        settings.load_profile("unshrunk")

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        if self._wanted:
            items[:] = [item for item in items if item.nodeid in self._wanted]


class Warm(Some):
    """All tests of the fast tier, loaded once; tries faults that it is sent in forks of its process."""

    options = ()

    def __init__(self, control: Connection, kept: Path) -> None:
        super().__init__()
        self._control, self._kept = control, kept
        self._root, self._failed = f"{Path.cwd()}/", False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._failed |= report.failed

    def _passes(self, item: pytest.Item, after: pytest.Item | None) -> bool:
        self._failed = False
        item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
        return not self._failed

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        session.config.pluginmanager.unregister(name="terminalreporter")  # which would show what each fault fails
        gc.unfreeze()
        self._live: dict[tuple[str, int, str], list[FunctionType]] = {}
        self._caches = []
        for one in gc.get_objects():
            if isinstance(one, functools._lru_cache_wrapper) and str(one.__module__).startswith("silo"):
                self._caches.append(one)
            if isinstance(one, FunctionType) and one.__code__.co_filename.startswith(self._root):
                self._live.setdefault(_place(one.__code__), []).append(one)
        gc.freeze()
        if not self._kept.exists():
            self._look(session.items)
        self._control.send(None)
        items = {item.nodeid: item for item in session.items}
        while asked := self._control.recv():
            *fault, tests, limit_s = asked
            self._control.send(forked(functools.partial(self._try, *fault, [items[one] for one in tests]), limit_s))
        return True

    def _try(self, module: str, before: str, after: str, items: list[pytest.Item]) -> int:
        codes = [compile(text, self._root + module, "exec", dont_inherit=True) for text in (before, after)]
        if not self._put(*codes):
            return BROKE
        for cache in self._caches:
            cache.cache_clear()
        passed = (self._passes(*pair) for pair in zip(items, [*items[1:], None], strict=True))
        return PASSED if all(passed) else NOTICED

    def _put(self, old: CodeType, new: CodeType) -> bool:
        """Put what differs of two codes into the functions that are there; False where that is run at import."""
        inner = [[one for one in code.co_consts if isinstance(one, CodeType)] for code in (old, new)]
        if not all(self._put(*pair) for pair in zip(*inner, strict=True)):
            return False
        if not old.co_flags & 1:  # of a module or a class
            return _own(old) == _own(new)
        for function in self._live.get(_place(old), ()):
            function.__code__ = new
        return True

    def _look(self, items: Sequence[pytest.Item]) -> None:
        """Find which tests run which lines; those that don't pass are none."""
        shares = len(os.sched_getaffinity(0))
        parts = [self._kept.with_suffix(f".{share}") for share in range(shares)]
        groups = [items[len(items) * n // shares : len(items) * (n + 1) // shares] for n in range(shares)]
        with ThreadPoolExecutor(shares) as pool:
            list(pool.map(lambda of: forked(lambda: self._traced(*of)), zip(groups, parts, strict=True)))
        reached: Reached = {}
        for part in parts:
            reached |= pickle.loads(part.read_bytes())
            part.unlink()
        self._kept.write_bytes(pickle.dumps(reached))

    def _traced(self, items: Sequence[pytest.Item], to: Path) -> int:
        lines: dict[str, set[int]] = {}  # of each module, those of the first call of each function
        seen: set[CodeType] = set()

        def line(frame: FrameType, event: str, argument: object) -> object:
            lines[frame.f_code.co_filename].add(frame.f_lineno)
            return line

        def called(frame: FrameType, event: str, argument: object) -> object:
            code = frame.f_code
            if code in seen:
                return None
            seen.add(code)
            if not code.co_filename.startswith(self._root) or code.co_filename.startswith(f"{self._root}tests/"):
                return None
            lines.setdefault(code.co_filename, set()).add(code.co_firstlineno)
            return line

        reached: Reached = {}
        for item, after in zip(items, [*items[1:], None], strict=True):
            lines.clear()
            seen.clear()
            begin_s = time.process_time()
            threading.settrace(called)
            sys.settrace(called)
            passed = self._passes(item, after)
            sys.settrace(None)
            if passed:
                masks = {name[len(self._root) :]: sum(1 << at for at in found) for name, found in lines.items()}
                reached[item.nodeid] = time.process_time() - begin_s, masks
        to.write_bytes(pickle.dumps(reached))
        return PASSED


def _place(code: CodeType) -> tuple[str, int, str]:
    return code.co_filename, code.co_firstlineno, code.co_name


def _own(code: CodeType) -> tuple[object, ...]:
    """What a code does apart from those within it."""
    return code.co_code, code.co_names, repr([one for one in code.co_consts if not isinstance(one, CodeType)])


class Trial:
    """A copy of the tree in which faults are put in one after the other."""

    def __init__(self, folder: Path, tests: Sequence[str], *, slow: bool) -> None:
        self.root, self._slow = folder / "main", slow
        self._limits: dict[tuple[str, ...], float] = {}
        ignored = shutil.ignore_patterns("__pycache__", ".git", ".venv", ".mypy_cache", ".ruff_cache", "build")
        shutil.copytree(ROOT, self.root, ignore=ignored, symlinks=True)
        shared = ROOT.parent / "shared"
        if shared.is_dir():
            (folder / "shared").symlink_to(shared)
        self._tests = folder / "tests"  # where they write
        os.environ.update(PYTHONPATH=str(self.root), PYTEST_DEBUG_TEMPROOT=str(self._tests), SILO_DEADLINE_S="30")
        os.chdir(self.root)
        sys.path.insert(0, str(self.root))
        for name in PRELOADED:
            with suppress(ImportError):
                importlib.import_module(name)
        state = hashlib.sha256(repr(tests).encode())
        for path in sorted(Path().glob("[!.]*/**/*.py")):
            state.update(path.read_bytes())
        kept = Path(tempfile.gettempdir()) / f"silo-reached-{state.hexdigest()[:16]}"
        self._warm, control = Pipe()
        self._tests.mkdir()
        self._pid = os.fork()
        if not self._pid:
            os.dup2(2, 1)
            tested(tests, QUICK, Warm(control, kept))
            os._exit(0)
        self._number = itertools.count(1)
        control.close()
        self._warm.recv()
        self._reached: Reached = pickle.loads(kept.read_bytes())

    def end(self) -> None:
        """End the process that has loaded the tests."""
        self._warm.send(None)
        os.waitpid(self._pid, 0)

    def chosen(self, module: str, line: int = 0, function: int = 0) -> list[str]:
        """Return tests of the fast tier that run a line, then those that run its function; without, any of a module.

        First come those of the nearest that take no time, then of each kind one case before the next ones.
        """
        near, turns = set(nearest(module)), Counter[str]()
        found = []
        for test, (seconds, lines) in sorted(self._reached.items(), key=lambda one: one[1][0]):
            mask, far = lines.get(module, 0), test.partition("::")[0] not in near
            if (mask >> line | mask >> function) & 1 if line else mask or not far:
                kind = test.partition("[")[0]
                turn = 0 if not far and seconds < CHEAP_S else turns[kind]
                found.append((turn, not mask >> line & 1, far, seconds, test))
                turns[kind] += 1
        found.sort()
        spent = itertools.accumulate((seconds for *_, seconds, _ in found), initial=0.0)
        return [test for (*_, test), spent_s in zip(found, spent, strict=False) if spent_s < BUDGET_S]

    @contextmanager
    def _put_in(self, fault: Fault) -> Iterator[tuple[str, str]]:
        """Have a fault in the copy; yields the text of its module without and with it."""
        path = self.root / fault.module
        before, known = path.read_bytes(), path.stat()
        after = before[: fault.start] + fault.after.encode() + before[fault.start + len(fault.before.encode()) :]
        try:
            path.write_bytes(after)
            os.utime(path, (stamp := next(self._number), stamp))  # so that no byte code of another fault is taken
            yield before.decode(), after.decode()
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(known.st_atime_ns, known.st_mtime_ns))
            for left in self._tests.iterdir():
                shutil.rmtree(left, ignore_errors=True)

    def of(self, fault: Fault) -> str:
        """Return what became of a fault after the tests of all tiers: killed, survived, hung or no code."""
        with self._put_in(fault) as texts:
            try:
                ast.parse(texts[1])
            except SyntaxError:
                return "no code"
            status = self._of_fast(fault, *texts)
        if status in (PASSED, NO_TESTS):
            if not self._slow:
                return LEFT
            files = tuple(nearest(fault.module))
            limit_s = self._limit(files)
            with self._put_in(fault):
                status = forked(lambda: tested(files, "slow", Some()), limit_s) if limit_s else PASSED
        return "hung" if status is None else "survived" if status in (PASSED, NO_TESTS) else "killed"

    def _of_fast(self, fault: Fault, before: str, after: str) -> int | None:
        nodes = [one for one in ast.walk(ast.parse(before)) if getattr(one, "lineno", sys.maxsize) <= fault.line]
        line = max(one.lineno for one in nodes if isinstance(one, ast.stmt))
        defs = [one for one in nodes if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef)]
        inside = [one for one in defs if fault.line <= (one.end_lineno or 0)]
        function = max((min([one.lineno, *(of.lineno for of in one.decorator_list)]) for one in inside), default=line)
        tests = self.chosen(fault.module, line, function)
        self._warm.send((fault.module, before, after, tests, self._patience(tests)))
        status = self._warm.recv()
        if status != BROKE:
            return status
        tests = self.chosen(fault.module)  # it is run at import
        files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
        return forked(lambda: tested(files, QUICK, Some(tests)), self._patience(tests))

    def _patience(self, tests: Iterable[str]) -> float:
        """How long tests may take, on a machine that others use, too."""
        return 60 + 30 * sum(self._reached[test][0] for test in tests)

    def _limit(self, files: tuple[str, ...]) -> float:
        """How long the slow tests of files may take; 0 where they don't pass without any fault."""
        if files not in self._limits:
            begin_s = time.monotonic()
            passed = forked(lambda: tested(files, "slow", Some()), 900) == PASSED
            self._limits[files] = 4 * (time.monotonic() - begin_s) + 20 if passed else 0.0
        return self._limits[files]


def drawn(modules: list[str], count: int, seed: str) -> Iterator[Fault]:
    """Draw faults from all places, whatever their module's size; a larger count goes on where a smaller one ended."""
    places = [fault for module in modules for fault in Places(module, (ROOT / module).read_text()).found]
    random.Random(seed).shuffle(places)
    yield from places[:count]


def main() -> int:
    """Return 1 where a fault survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="+", help="files or folders, from the root")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", default="")
    parser.add_argument("--out", type=Path, help="the result of each fault, as JSON lines; what is there is kept")
    parser.add_argument("--fast", action="store_true", help="the fast tier's tests alone")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no fault after these")
    wanted = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    seed, out = wanted.seed or commit.stdout.strip(), wanted.out and wanted.out.absolute()
    results = recorded(out)
    known = {fault for fault, result in results.items() if wanted.fast or result != LEFT}
    faults = [fault for fault in drawn(modules_of(wanted.modules), wanted.count, seed) if fault not in known]
    print(f"{len(faults)} faults, seed {seed}, {len(results)} tried before", flush=True)
    end_s = time.monotonic() + 60 * wanted.minutes
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        through_all = {one for one in THROUGH_ALL if (ROOT / one).exists()}
        tests = sorted(through_all | {path for fault in faults for path in nearest(fault.module)})
        trial = Trial(Path(folder), tests, slow=not wanted.fast)
        for fault in itertools.takewhile(lambda _: time.monotonic() < end_s, faults):
            result = results[fault] = trial.of(fault)
            print(f"{result:12} {fault.told}", flush=True)
            if out:
                record(out, fault, result)
        trial.end()
        os.chdir(ROOT)
    print(_table(results))
    return int(bool({"survived", LEFT} & set(results.values())))


def record(path: Path, fault: Fault, result: str) -> None:
    """Write what became of a fault; the line before may have been cut off, so that each begins its own."""
    with path.open("a") as file:
        file.write(f"\n{json.dumps({**asdict(fault), 'result': result})}")


def recorded(path: Path | None) -> dict[Fault, str]:
    """Return what was tried before; a line that was cut off isn't."""
    found: dict[Fault, str] = {}
    for line in path.read_text().splitlines() if path and path.exists() else ():
        try:
            fields = json.loads(line)
        except ValueError:
            continue
        result = fields.pop("result")
        found[Fault(**fields)] = result
    return found


def _table(results: Mapping[Fault, str]) -> str:
    """Return how many were killed, by folder."""
    counts: dict[str, Counter[str]] = {}
    for fault, result in results.items():
        for where in (str(Path(fault.module).parent), "all"):
            counts.setdefault(where, Counter())[result] += 1
    lines = [f"{'':28} {'killed':>7} {'hung':>5} {'survived':>9} {'score':>6}"]
    for where in sorted(counts, key=lambda one: (one == "all", one)):
        found = counts[where]
        judged = found["killed"] + found["survived"] + found[LEFT]
        score = f"{100 * found['killed'] / judged:.0f} %" if judged else "-"
        lines.append(f"{where:28} {found['killed']:7} {found['hung']:5} {judged - found['killed']:9} {score:>6}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
