"""Puts small faults into the code, one at a time, and looks whether the nearest tests notice.

    python .bench/long/mutations.py silo/judging silo/history/pins.py --count 100 [--seed TEXT] [--jobs 2]
    python .bench/long/mutations.py silo silo_tui --count 2000 --out FILE [--fast] [--minutes 30]

A fault is a comparison that is off by one, a sign, a constant, a condition turned round, a lock that isn't taken, a
call left out. The places are drawn by a seed, that of the commit if no other is given, from all places of the modules
that were named. The nearest tests are those that import the module, and those of `NEAREST` for what none imports: first
those of the fast tier, then the slow ones where these notice nothing. A fault after which they hang is counted apart.
Exit status 1 where some survive.

With `--out` each result is a line of JSON that is written as soon as it is there, and what stands in the file already
isn't tried again while its module is the same: a run that was ended goes on, those of several days add up, and the
table is that of the whole file.
"""

import argparse
import ast
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).resolve().parents[2]
# what few tests import by name is held by these
NEAREST = {
    "silo/core": ["tests/unit"],
    "silo/segment": ["tests/unit"],
    "silo/journal": ["tests/unit", "tests/property/test_journal.py"],
    "silo/loop": ["tests/unit", "tests/property/test_buffers.py"],
    "silo/expressions": ["tests/judging"],
    "silo/judging": ["tests/judging"],
    "silo/conditions": ["tests/judging"],
    "silo/recorder": ["tests/recorder"],
    "silo/recovery": ["tests/crash"],
    "silo/helper": ["tests/ipc"],
    "silo/state": ["tests/ipc"],
    "silo/live": ["tests/ipc"],
    "silo/history": ["tests/ipc"],
    "silo/recordings": ["tests/ipc"],
    "silo/control": ["tests/ipc"],
    "silo/scripts": ["tests/ipc"],
    "silo/verify": ["tests/ipc"],
    "silo/rpc": ["tests/ipc"],
    "silo/requests": ["tests/ipc"],
    "silo/net": ["tests/ipc"],
    "silo/fleet": ["tests/ipc"],
    "silo/client": ["tests/ipc"],
    "silo/link": ["tests/ipc", "tests/unit/test_handover.py"],
    "silo/logger": ["tests/unit"],
    "silo/settings": ["tests/unit"],
    "silo/files": ["tests/files"],
    "silo/analysis": ["tests/files"],
    "silo/datasets": ["tests/files/test_datasets.py", "tests/files/test_episodes.py"],
    "silo/guards": ["tests/files/test_guards.py"],
    "silo/parameters": ["tests/parameters"],
    "silo/run_index": ["tests/files/test_runs.py", "tests/files/test_query.py"],
    "silo/bridges": ["tests/ipc/test_foxglove.py", "tests/ipc/test_ros2.py"],
    "silo/cli": ["tests/ipc", "tests/files"],
    "silo/programs": ["tests/unit/test_demo_robot.py", "tests/unit/test_host_probes.py"],
    "silo": ["tests/unit"],
    "silo_tui": ["tests/tui"],
}
MOST_FILES = 12  # of nearest tests
TIERS = ("not slow", "slow")
NO_TESTS = 5  # the exit status where a tier has none
COMPARED = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
WRITTEN = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
    ast.Is: "is", ast.IsNot: r"is\s+not", ast.In: "in", ast.NotIn: r"not\s+in",
}  # fmt: skip
SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "//"), ast.FloorDiv: ("//", "*")}
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


def nearest(module: str) -> list[str]:
    """Return the test files that hold a module."""
    dotted = module.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    package, _, name = dotted.rpartition(".")
    own, others = re.escape(dotted), re.escape(package)
    pattern = re.compile(rf"^\s*(from {own} import|import {own}\b|from {others} import .*\b{name}\b)", re.MULTILINE)
    tests = [path for path in sorted((ROOT / "tests").rglob("test_*.py")) if pattern.search(path.read_text())]
    tests.sort(key=lambda path: (name not in path.name, path.stat().st_size))
    found = [str(path.relative_to(ROOT)) for path in tests[:MOST_FILES]]
    if found:
        return found
    folder = next(folder for folder in (*Path(module).parents,) if str(folder) in NEAREST)
    return NEAREST[str(folder)]


class Copy:
    """A copy of the tree in which faults are put in one after the other."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "main"
        ignored = shutil.ignore_patterns("__pycache__", ".git", ".venv", ".mypy_cache", ".ruff_cache", "build")
        shutil.copytree(ROOT, self.root, ignore=ignored, symlinks=True)
        shared = ROOT.parent / "shared"
        if shared.is_dir():
            (folder / "shared").symlink_to(shared)

    def passes(self, tests: Iterable[str], tier: str, limit_s: float) -> bool | None:
        """Run the tests of a tier; None where they don't end."""
        options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", tier]
        command = [sys.executable, "-m", "pytest", *options, *tests]
        environment = {**os.environ, "PYTHONPATH": str(self.root), "PYTHONDONTWRITEBYTECODE": "1"}
        process = subprocess.Popen(
            command, cwd=self.root, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        try:
            return process.wait(limit_s) in (0, NO_TESTS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.wait()
            return None

    def tried(self, fault: Fault, limits: Mapping[str, float]) -> str:
        """Return what became of a fault after the tests of all tiers: killed, survived, hung or no code."""
        path = self.root / fault.module
        text = path.read_bytes()
        end = fault.start + len(fault.before.encode())
        changed = text[: fault.start] + fault.after.encode() + text[end:]
        try:
            ast.parse(changed)
        except SyntaxError:
            return "no code"
        try:
            path.write_bytes(changed)
            for tier, limit_s in limits.items():
                passed = self.passes(nearest(fault.module), tier, limit_s)
                if not passed:
                    return "hung" if passed is None else "killed"
        finally:
            path.write_bytes(text)
        return "survived"


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
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="the result of each fault, as JSON lines; what is there is kept")
    parser.add_argument("--fast", action="store_true", help="the fast tier's tests alone")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no fault after these")
    wanted = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    seed = wanted.seed or commit.stdout.strip()
    results = recorded(wanted.out)
    faults = [fault for fault in drawn(modules_of(wanted.modules), wanted.count, seed) if fault not in results]
    print(f"{len(faults)} faults, seed {seed}, {len(results)} tried before", flush=True)
    end_s = time.monotonic() + 60 * wanted.minutes
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(wanted.jobs) as pool:
        trial = Trial(Path(folder), wanted.jobs, TIERS[:1] if wanted.fast else TIERS, end_s)
        for fault, result in zip(faults, pool.map(trial.of, faults), strict=True):
            if result:
                results[fault] = result
                print(f"{result:9} {fault.told}", flush=True)
                if wanted.out:
                    record(wanted.out, fault, result)
    print(_table(results))
    return int("survived" in results.values())


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


class Trial:
    """Tries one fault in each of some copies at a time."""

    def __init__(self, folder: Path, jobs: int, tiers: Sequence[str], end_s: float) -> None:
        self._tiers, self._end_s = tiers, end_s
        self._limits: dict[tuple[str, ...], dict[str, float]] = {}
        self._copies: SimpleQueue[Copy] = SimpleQueue()
        for number in range(jobs):
            made = folder / str(number)
            made.mkdir()
            self._copies.put(Copy(made))

    def of(self, fault: Fault) -> str:
        """Return what became of a fault; nothing where time is over."""
        copy = self._copies.get()
        try:
            if time.monotonic() >= self._end_s:
                return ""
            tests = tuple(nearest(fault.module))
            if tests not in self._limits:  # two threads may both measure: they find the same
                self._limits[tests] = self._measured(copy, tests)
            limits = self._limits[tests]
            return copy.tried(fault, limits) if limits else "no test passes without it"
        finally:
            self._copies.put(copy)

    def _measured(self, copy: Copy, tests: tuple[str, ...]) -> dict[str, float]:
        """Return how long the tests of each tier may take, of those that pass without a fault."""
        found = {}
        for tier in self._tiers:
            begin_s = time.monotonic()
            if copy.passes(tests, tier, 900):
                found[tier] = 4 * (time.monotonic() - begin_s) + 20
            else:
                print(f"these fail without any fault: -m '{tier}' {' '.join(tests)}", flush=True)
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
        judged = found["killed"] + found["survived"]
        score = f"{100 * found['killed'] / judged:.0f} %" if judged else "-"
        lines.append(f"{where:28} {found['killed']:7} {found['hung']:5} {found['survived']:9} {score:>6}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
