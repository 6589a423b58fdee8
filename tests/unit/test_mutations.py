"""The small faults that `.bench/long/mutations.py` draws are one change each, and their results add up over days."""

import ast
import shutil
import subprocess
import sys

import mutations
import pytest
from mutations import Fault, Places

TEXT = '''
def held(rows, most: int = 4):
    """Return what fits."""
    with lock:
        if len(rows) >= most and not rows[0]:
            rows.clear()
    return rows[-1] if rows else most + 1
'''
FAULTS = Places("held.py", TEXT).found


def changed(fault: Fault) -> str:
    return TEXT[: fault.start] + fault.after + TEXT[fault.start + len(fault.before) :]


def test_each_fault_is_a_module_that_differs_in_one_place():
    assert {one.kind for one in FAULTS} == {
        "constant", "lock", "condition", "compare", "and/or", "not", "call left out", "sign",
    }  # fmt: skip
    trees = [ast.dump(ast.parse(changed(fault))) for fault in FAULTS]
    assert len({*trees, ast.dump(ast.parse(TEXT))}) == len(FAULTS) + 1


def test_the_same_seed_draws_the_same_faults_and_a_larger_count_draws_on(monkeypatch, tmp_path):
    monkeypatch.setattr(mutations, "ROOT", tmp_path)
    (tmp_path / "held.py").write_text(TEXT)
    all_of_them = list(mutations.drawn(["held.py"], 1000, "seed"))
    assert sorted(all_of_them, key=str) == sorted(FAULTS, key=str)
    assert all_of_them != list(mutations.drawn(["held.py"], 1000, "another"))
    for count in (3, 5):
        assert list(mutations.drawn(["held.py"], count, "seed")) == all_of_them[:count]


def test_what_was_tried_is_known_until_its_module_changes(tmp_path):
    out = tmp_path / "results.jsonl"
    assert mutations.recorded(out) == mutations.recorded(None) == {}
    mutations.record(out, FAULTS[0], "killed")
    with out.open("a") as file:
        file.write('\n{"module": "held.py", "li')  # its writer was killed
    mutations.record(out, FAULTS[1], "survived")
    assert mutations.recorded(out) == {FAULTS[0]: "killed", FAULTS[1]: "survived"}
    assert not set(mutations.recorded(out)) & set(Places("held.py", TEXT + "\n# more\n").found)


HELD = """MOST = 4


def fits(n):
    def inner():
        return n < MOST

    return inner()


def untested(n):
    return n > 0


def endless(n):
    while n > 0:
        n -= 1
    return n
"""
TESTS = """import pytest
from held import endless, fits, untested

def test_it_fits():
    assert fits(3) and not fits(4) and not fits(5)

def test_it_ends():
    assert endless(3) == 0

@pytest.mark.slow
def test_slowly():
    assert untested(1)
"""


@pytest.mark.slow
def test_a_fault_is_noticed_wherever_it_is_run_and_what_no_test_holds_survives(tmp_path):
    driver, out = tmp_path / ".bench" / "long" / "mutations.py", tmp_path / "out.jsonl"
    for path, text in ((driver, ""), (tmp_path / "held.py", HELD), (tmp_path / "tests" / "test_held.py", TESTS)):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    shutil.copy(mutations.__file__, driver)
    constant, _, untested, *_ = Places("held.py", HELD).found
    mutations.record(out, constant, "hung")  # it isn't tried again
    mutations.record(out, untested, mutations.LEFT)  # this one is
    ran = subprocess.run([sys.executable, driver, "held.py", "--out", out], capture_output=True, text=True, check=False)
    assert ran.returncode == 1, ran.stderr
    assert {(one.line, one.kind): result for one, result in mutations.recorded(out).items()} == {
        (1, "constant"): "hung", (6, "compare"): "killed", (12, "compare"): "survived", (12, "constant"): "killed",
        (16, "compare"): "killed", (16, "constant"): "killed", (17, "constant"): "killed",
    }  # fmt: skip
