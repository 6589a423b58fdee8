"""Pending edits: undo, rebase on what others changed, and what is sent."""

import math
import os
import stat
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry, Table
from silo_tui.model.table.changes import cost_of, groups_of
from silo_tui.model.table.fields import Field, values_of
from silo_tui.model.table.state import TableState
from silo_tui.screens.table import TableScreen
from silo_tui.sessions import kept
from silo_tui.sessions.kept import lives
from silo_tui.unforeseen import log_file

TORQUE = "/log/legs/LF/HAA/torque"

COUNT = 4
option_values = {
    Field.ENABLED: st.integers(0, 1),
    Field.DIVIDER: st.integers(1, 4),
    Field.ACTION: st.integers(0, 2),
    Field.BUFFER: st.integers(0, 2),
    Field.SIZE: st.integers(1, 4),
}
options = st.builds(
    ElementOptions,
    enabled=st.booleans(),
    divider=st.integers(1, 4),
    action=st.sampled_from(Action),
    buffer=st.sampled_from(BufferType),
    size=st.integers(1, 4),
)
one_edit = st.sampled_from(Field).flatmap(
    lambda field: st.tuples(st.lists(st.integers(0, COUNT - 1), unique=True), st.just(field), option_values[field])
)


one_option = st.one_of(
    st.fixed_dictionaries({"enabled": st.booleans()}),
    st.fixed_dictionaries({"divider": st.integers(1, 4)}),
    st.fixed_dictionaries({"action": st.sampled_from(Action)}),
    st.fixed_dictionaries({"buffer": st.sampled_from(BufferType)}),
    st.fixed_dictionaries({"size": st.integers(1, 4)}),
)


def table(revision: int, *given: ElementOptions) -> Table:
    elements = [
        ElementInfo(f"/log/e{row}", "-", "scalar", (), (Entry("", "<f8"),), each) for row, each in enumerate(given)
    ]
    return Table(revision, elements)


def fresh(*given: ElementOptions) -> TableState:
    state = TableState()
    state.load(table(1, *(given or [ElementOptions()] * COUNT)))
    return state


def picture(state: TableState) -> bytes:
    return state.values.tobytes() + state.pending.tobytes()


def test_a_step_is_called_by_all_fields_that_it_changes_of_how_many_elements():
    state = fresh()
    wanted = state.values[:, [0, 1]].copy()
    wanted[Field.DIVIDER, 0], wanted[Field.SIZE, 1] = 3, 2
    assert state.edit_all([0, 1], wanted) == 2
    assert (state.undo(), state.redo()) == ("divider, size of 2 elements",) * 2


@given(st.lists(one_edit, max_size=12))
def test_undoing_everything_gives_the_first_table(edits):
    state = fresh()
    before = picture(state)
    for rows, field, value in edits:
        state.edit(rows, field, value)
    while state.undo():
        pass
    assert picture(state) == before


@given(st.lists(one_edit, max_size=12), st.integers(0, 12))
def test_redo_takes_every_undo_back(edits, steps):
    state = fresh()
    for rows, field, value in edits:
        state.edit(rows, field, value)
    before = picture(state)
    undone = sum(state.undo() is not None for _ in range(steps))
    for _ in range(undone):
        assert state.redo()
    assert picture(state) == before


@given(st.lists(one_edit, max_size=8), st.lists(options, min_size=COUNT, max_size=COUNT))
def test_rebase_keeps_every_wanted_value_and_every_other_value_is_the_loggers(edits, theirs):
    state = fresh()
    for rows, field, value in edits:
        state.edit(rows, field, value)
    wanted, pending = state.values, state.pending
    state.load(table(2, *theirs))
    server = np.array([values_of(each) for each in theirs]).T
    assert np.array_equal(state.values, np.where(pending, wanted, server))
    assert np.array_equal(state.pending, pending & (wanted != server))


@given(st.lists(one_edit, max_size=8), st.lists(options, min_size=COUNT, max_size=COUNT))
def test_a_conflict_is_a_pending_edit_whose_field_the_logger_has_otherwise_now(edits, theirs):
    state = fresh()
    for rows, field, value in edits:
        state.edit(rows, field, value)
    before = state.server.copy()
    state.load(table(2, *theirs))
    assert np.array_equal(state.conflicts, state.pending & (state.server != before))


@given(st.lists(one_edit, max_size=8))
def test_the_edits_that_are_sent_make_the_table_what_the_screen_shows(edits):
    state = fresh()
    for rows, field, value in edits:
        state.edit(rows, field, value)
    wanted = {edit.name: edit.options for edit in state.edits()}
    applied = [wanted.get(info.name, info.options) for info in state.elements]
    shown = state.values
    state.load(table(2, *applied))
    assert np.array_equal(state.values, shown)
    assert state.pending_count == (0, 0)


class Edited(RuleBasedStateMachine):
    """Edits, others' changes, settled conflicts and undo in any order, beside a book of values and their grounds."""

    def __init__(self):
        super().__init__()
        self.state = fresh()
        self.theirs = [ElementOptions()] * COUNT
        self.book = {}  # (field, row) -> (wanted, the logger's value that it was wanted instead of)
        self.steps = []  # the book of the rows of each step, before it; what was told, at which revision

    def server(self, cell):
        return int(self.state.server[cell])

    def beyond(self):
        """The cells in conflict: the logger's value isn't the one that the edit was made on."""
        return {
            cell for cell, (wanted, ground) in self.book.items() if self.server(cell) not in {wanted, ground}
        }  # fmt: skip

    def remember(self, rows, change):
        told, label = self.state.changes(), len(self.state._undo)
        before = {cell: each for cell, each in self.book.items() if cell[1] in rows}
        change()
        if len(self.state._undo) > label:
            self.steps.append((rows, before, told, self.state.revision))

    @rule(edit=one_edit)
    def edit(self, edit):
        rows, field, value = edit
        cells = [(field, row) for row in rows if int(self.state.values[field, row]) != value]
        self.remember({row for _, row in cells}, lambda: self.state.edit(rows, field, value))
        for cell in cells:
            ground = self.book[cell][1] if cell in self.book else self.server(cell)
            self.book.pop(cell, None)
            if value != self.server(cell):
                self.book[cell] = value, ground

    @rule(row=st.integers(0, COUNT - 1), mine=st.booleans())
    def settle(self, row, mine):
        cells = [cell for cell in self.beyond() if cell[1] == row]
        self.remember({row}, lambda: self.state.resolve([row], keep_mine=mine))
        for cell in cells:
            wanted, _ = self.book.pop(cell)
            if mine:
                self.book[cell] = wanted, self.server(cell)

    @rule(row=st.integers(0, COUNT - 1), theirs=one_option)
    def somebody_else_changes_it(self, row, theirs):
        # one option of one element: conflicts come of it as of more, and it is made up in less time
        self.theirs[row] = msgspec.structs.replace(self.theirs[row], **theirs)
        self.state.load(table(self.state.revision + 1, *self.theirs))
        self.book = {cell: each for cell, each in self.book.items() if each[0] != self.server(cell)}

    @rule()
    def undo(self):
        assert (self.state.undo() is not None) == bool(self.steps)
        if self.steps:
            rows, before, told, revision = self.steps.pop()
            self.book = {cell: each for cell, each in self.book.items() if cell[1] not in rows} | before
            if revision == self.state.revision:
                assert self.state.changes() == told

    @invariant()
    def a_conflict_is_a_ground_that_moved(self):
        assert {(Field(int(field)), int(row)) for field, row in np.argwhere(self.state.conflicts)} == self.beyond()

    @invariant()
    def what_is_pending_is_what_is_wanted(self):
        wanted = {cell: each[0] for cell, each in self.book.items() if each[0] != self.server(cell)}
        found = {(Field(int(field)), int(row)) for field, row in np.argwhere(self.state.pending)}
        assert {cell: self.state.value(*cell) for cell in found} == wanted
        assert all(self.state.values[cell] == value for cell, value in wanted.items())


TestEdited = Edited.TestCase


def in_conflict():
    """An edit of a divider that somebody else changed meanwhile."""
    state = fresh()
    state.edit([1], Field.DIVIDER, 5)
    theirs = [ElementOptions(divider=7 if row == 1 else 1) for row in range(COUNT)]
    state.load(table(state.revision + 1, *theirs))
    assert np.argwhere(state.conflicts).tolist() == [[Field.DIVIDER, 1]]
    return state


def test_undo_of_keep_mine_brings_the_conflict_back_and_redo_settles_it():
    state = in_conflict()
    told = state.changes()
    state.resolve([1], keep_mine=True)
    assert not state.conflicts.any()
    state.undo()
    assert state.conflicts.any()
    assert state.changes() == told
    state.redo()
    assert not state.conflicts.any()


def test_a_second_edit_of_a_field_in_conflict_is_in_conflict_still():
    state = in_conflict()
    state.edit([1], Field.DIVIDER, 9)
    assert np.argwhere(state.conflicts).tolist() == [[Field.DIVIDER, 1]]
    (change,) = state.changes()
    assert (change.old, change.theirs, change.new) == ("1", "7", "9")


def test_undo_wants_back_what_was_before_it_was_applied():
    state = fresh()
    state.edit([1, 2], Field.DIVIDER, 5)
    state.edit([2], Field.ENABLED, 0)
    kept = state.kept()
    applied = [ElementOptions(divider=5 if row in {1, 2} else 1, enabled=row != 2) for row in range(COUNT)]
    state.load(table(state.revision + 1, *applied))
    state.note_applied(kept)
    assert state.undo() == "what was applied to 2 elements"
    told = [(change.name, change.field, change.old, change.new, change.theirs) for change in state.changes()]
    names = state.names
    assert told == [
        (names[1], "divider", "5", "1", None),
        (names[2], "logging", "off", "on", None),
        (names[2], "divider", "5", "1", None),
    ]
    assert state.undo() is None  # the edits before that are what was applied
    state.redo()
    assert state.pending_count == (0, 0)


def test_what_was_undone_before_others_were_applied_is_not_done_again():
    state = fresh()
    state.edit([1], Field.DIVIDER, 5)
    state.edit([2], Field.DIVIDER, 7)
    state.undo()
    kept = state.kept()
    state.load(table(state.revision + 1, *(ElementOptions(divider=5 if row == 1 else 1) for row in range(COUNT))))
    state.note_applied(kept)
    assert state.redo() is None
    assert state.pending_count == (0, 0)


def test_undo_goes_on_where_others_came_and_went():
    """A signal that was derived is one more row: what could be taken back before can be still."""
    old, new = ElementOptions(divider=1), ElementOptions(divider=5)
    state = TableState()
    state.load(table(0, old, old, old))
    state.edit([0, 2], Field.DIVIDER, 5)
    edits = state.kept()
    state.load(table(1, new, old, new))
    state.note_applied(edits)
    state.edit([1], Field.SIZE, 7)
    more = table(2, new, old, new)
    first = ElementInfo("/log/a", "-", "scalar", (), (Entry("", "<f8"),), ElementOptions())
    state.load(Table(3, [first, *more.elements[:2]]))  # one came before them, and the last is gone
    assert state.undo() == "size of 1 element"
    assert state.undo() == "what was applied to 2 elements"
    assert [(edit.name, edit.options.divider) for edit in state.edits()] == [("/log/e0", 1)]
    state.load(Table(4, [first]))
    assert not state.undoes
    assert state.redo() is None


def test_undo_goes_back_to_what_was_applied_before_too():
    state = fresh()
    for at, divider in enumerate((5, 9)):
        state.edit([1, 1 + at], Field.DIVIDER, divider)
        kept = state.kept()
        state.load(table(2 + at, *(ElementOptions(divider=int(each)) for each in state.values[Field.DIVIDER])))
        state.note_applied(kept)
    assert state.undo() == "what was applied to 2 elements"
    state.edit([3], Field.DIVIDER, 7)
    state.undo()
    assert state.undo() == "what was applied to 1 element"
    told = [(change.name, change.old, change.new, change.theirs) for change in state.changes()]
    assert told == [(state.names[1], "9", "1", None), (state.names[2], "9", "1", None)]
    assert state.undo() is None
    state.redo()
    assert [(change.old, change.new) for change in state.changes()] == [("9", "5"), ("9", "1")]
    state.redo()
    assert state.pending_count == (3, 3)  # the 7, too


def test_what_somebody_else_set_since_it_was_applied_is_a_conflict_as_it_is_wanted_back():
    state = fresh()
    state.edit([1, 2], Field.DIVIDER, 5)
    kept = state.kept()
    state.load(table(2, *(ElementOptions(divider=5 if row in {1, 2} else 1) for row in range(COUNT))))
    state.note_applied(kept)
    state.load(table(3, *(ElementOptions(divider={1: 5, 2: 7}.get(row, 1)) for row in range(COUNT))))
    state.undo()
    told = [(change.name, change.old, change.new, change.theirs) for change in state.changes()]
    assert told == [(state.names[1], "5", "1", None), (state.names[2], "5", "1", "7")]


def test_a_bulk_edit_is_one_undo_step_and_editing_back_to_the_loggers_value_is_not_pending():
    state = fresh()
    state.edit([0, 1, 2], Field.DIVIDER, 5)
    state.undo()
    assert state.pending_count == (0, 0)
    state.edit([0], Field.DIVIDER, 5)
    state.edit([0], Field.DIVIDER, 1)
    assert state.pending_count == (0, 0)


def test_taking_theirs_drops_only_the_field_in_conflict():
    state = fresh()
    state.edit([0], Field.DIVIDER, 5)
    state.edit([0], Field.SIZE, 7)
    state.load(table(2, ElementOptions(divider=3), *[ElementOptions()] * 3))
    state.resolve([0], keep_mine=False)
    assert (int(state.values[Field.DIVIDER, 0]), int(state.values[Field.SIZE, 0])) == (3, 7)


def test_keeping_mine_settles_the_conflict_and_stays_pending():
    state = fresh()
    state.edit([0], Field.DIVIDER, 5)
    state.load(table(2, ElementOptions(divider=3), *[ElementOptions()] * 3))
    state.resolve([0], keep_mine=True)
    assert (bool(state.conflicts.any()), state.pending_count) == (False, (1, 1))


def test_edits_follow_their_element_by_name_when_the_robot_program_was_started_again_or_go_with_it():
    state = fresh()
    state.edit([0, 2], Field.DIVIDER, 5)
    again = table(1, *[ElementOptions()] * COUNT)
    state.load(msgspec.structs.replace(again, elements=again.elements[1:]))
    assert [(change.name, change.new) for change in state.changes()] == [("/log/e2", "5")]
    assert state.pending_count == (1, 1)


def test_a_change_reads_old_new_and_theirs():
    state = fresh()
    state.edit([1], Field.BUFFER, int(BufferType.FIXED))
    state.load(table(2, ElementOptions(), ElementOptions(buffer=BufferType.GROWING), *[ElementOptions()] * 2))
    change = state.changes()[0]
    assert (change.field, change.old, change.new, change.theirs) == ("buffer", "looping", "fixed", "growing")


@pytest.mark.parametrize(
    ("answer", "alive"), [(None, True), (PermissionError, True), (ProcessLookupError, False), (OverflowError, True)]
)
def test_a_process_lives_of_whomever_it_is(monkeypatch, answer, alive):
    asked = []

    def kill(pid, signal):
        asked.append(signal)
        if answer is not None:
            raise answer

    monkeypatch.setattr("os.kill", kill)
    assert lives(os.getpid() + 1) is alive
    assert asked == [0]
    assert not lives(os.getpid()), "ours has just begun with its logger"


def test_kept_edits_whose_ground_changed_meanwhile_are_conflicts(robot):
    table = TableState()
    table.load(Table(1, robot))
    assert (
        table.take_up(
            [kept.KeptEdit("/log/base/orientation", int(Field.DIVIDER), 3, 7), kept.KeptEdit("/gone", 1, 1, 2)]
        )
        == 1
    )
    assert int(table.conflicts.sum()) == 1


def test_a_relative_state_home_is_none(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    state = tmp_path / ".local" / "state" / "silo"
    assert (kept.path_of("", "robot").parent, log_file()) == (state / "edits", state / "silo-tui.log")


def test_what_processes_that_are_gone_kept_of_a_logger_is_offered(state_folder, monkeypatch):
    monkeypatch.setattr(kept, "lives", lambda pid: pid == 12)
    edit, mine = kept.KeptEdit("/log/x", int(Field.DIVIDER), 1, 7), kept.path_of("desk", "any mal.1")
    assert mine == state_folder / "silo" / "edits" / f"desk-any_mal_1.{os.getpid()}.json"
    assert kept.path_of("", "robot").name == f"here-robot.{os.getpid()}.json"
    for pid, edits in (("11", [edit]), ("12", [edit]), ("13", []), ("x", [edit])):
        path = mine.with_name(f"desk-any_mal_1.{pid}.json")
        kept.keep(path, [edit])
        path.write_bytes(msgspec.json.encode(kept.KeptEdits(5.0, edits)))
    kept.keep(mine.with_name("desk-any_mal_10.11.json"), [edit])
    mine.with_name("desk-any_mal_1.14.json").write_bytes(b"{")
    found = kept.left_behind("desk", "any mal.1")
    assert {path.name: each.edits for path, each in found.items()} == {"desk-any_mal_1.11.json": [edit]}


def test_what_is_pending_no_more_leaves_no_file(state_folder):
    edit, mine = kept.KeptEdit("/log/x", int(Field.DIVIDER), 1, 7), kept.path_of("desk", "robot")
    kept.keep(mine, [])
    kept.keep(mine, [edit])
    assert kept.read(mine).edits == [edit]
    assert stat.S_IMODE(mine.parent.stat().st_mode) == 0o700
    assert [path.name for path in mine.parent.iterdir()] == [mine.name]
    kept.keep(mine, [])
    assert not mine.exists()


@pytest.mark.parametrize("content", [b"", b"{", b'{"time_s": 1, "edits": [["x"]]}', b"\xff\xfe"])
def test_kept_edits_that_can_t_be_read_are_none(tmp_path, content):
    path = tmp_path / "x.json"
    path.write_bytes(content)
    assert kept.read(path) is None


class Change:
    def __init__(self, name, old="1", new="5"):
        self.name, self.field, self.old, self.new = name, "divider", old, new


def test_groups_keep_names_of_other_depth_or_end_apart_and_begin_with_the_largest():
    changes = [Change(f"/log/{leg}/{joint}/q") for leg in ("LF", "RF") for joint in ("HAA", "KFE")]
    changes += [Change("/log/LF/q"), Change("/log/base/tau")]
    groups = groups_of(changes, "/log")
    assert [(group.count, group.pattern) for group in groups] == [(4, "/*/*/q"), (1, "/LF/q"), (1, "/base/tau")]


def test_a_branch_that_changes_alike_is_one_line():
    battery = [
        Change(f"/log/battery/{name}") for name in ("voltage", "current", "power", "charge", "state", "t1", "t2")
    ]
    apart = [Change("/log/base/tau"), Change("/log/base/q")]
    groups = groups_of(battery + apart, "/log")
    assert [(group.count, group.pattern) for group in groups] == [(7, "/battery/*"), (1, "/base/q"), (1, "/base/tau")]
    legs = [Change(f"/log/legs/{leg}/{name}") for leg in ("LF", "RF") for name in "abcd"]
    assert [(group.count, group.pattern) for group in groups_of(legs, "/log")] == [(8, "/legs/*/*")]


def test_how_long_is_held_is_told_of_what_is_edited(robot):
    table = TableState()
    table.load(Table(1, robot))
    assert cost_of(table.elements, table.values, 400.0).shortest != TORQUE
    table.edit([table.row(TORQUE)], Field.DIVIDER, 20)
    now, after = (cost_of(table.elements, values, 400.0, {TORQUE}) for values in (table.server, table.values))
    assert (now.shortest, after.shortest) == (TORQUE, TORQUE)
    assert after.shortest_s == 20 * now.shortest_s == after.longest_s
    table.edit([table.row(TORQUE)], Field.BUFFER, int(BufferType.GROWING))  # which holds all there is
    grown = cost_of(table.elements, table.values, 400.0, {TORQUE})
    assert (grown.shortest, grown.shortest_s, grown.longest_s) == (TORQUE, math.inf, math.inf)


def test_the_cost_of_a_table_counts_what_is_on(robot):
    table = TableState()
    table.load(Table(1, robot))
    row = table.row(TORQUE)
    values = table.values.copy()
    values[Field.ENABLED] = 0
    values[:, row] = [1, 2, 0, 0, 400]
    cost = cost_of(table.elements, values, 400.0)
    assert (cost.topic_bytes_s, cost.shortest_s, cost.shortest) == (1600.0, 2.0, TORQUE)
    assert cost.recorded_bytes_s == 200 * (8 + 18)
    values[Field.ACTION, row] = int(Action.PUBLISH)
    assert cost_of(table.elements, values, 400.0).recorded_bytes_s == 200 * (8 + 18), "published alone is recorded, too"
    assert cost.memory_bytes == 400 * 8 + 400 * 16
    assert cost_of(table.elements, np.zeros_like(values), 400.0).shortest == ""


@pytest.mark.parametrize(("by", "again"), [("next_buffer", [0, 1]), ("edit", [0])])
def test_what_is_done_again_sets_the_value_that_was_chosen_where_the_cursor_is_now(by, again):
    edits, cursor = [], iter([0, 1])
    table = SimpleNamespace(edit=lambda *given: edits.append(given) or 1)
    rows = SimpleNamespace(targets=lambda: next(cursor), not_here="")
    of = SimpleNamespace(
        repeated=by, repeats=list, session=SimpleNamespace(rows=rows, table=table), _edited=str, _again=lambda do: do()
    )
    of._set = lambda *given: TableScreen._set(of, *given)
    of._set(Field.BUFFER, BufferType.GROWING)
    of.repeats()
    assert edits == [(row, Field.BUFFER, BufferType.GROWING) for row in again]
