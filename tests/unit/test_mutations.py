"""The small faults that `.bench/long/mutations.py` draws are one change each, and their results add up over days."""

import ast

import mutations
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
