"""What a client of a logger does, whether a helper process answers it or the fake of silo-tui's tests."""

import numpy as np
import pytest

from silo.core.elements import BufferType, Edit, ElementOptions, FileType, Sought, State
from silo.errors import ConnectionLostError, RefusedError
from silo.expressions.search import Looking, places
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy
from tests.stand_ins.fake_signals import HZ, START_NS
from tests.waiting import wait_until

X, Q, GAIT, WORD, KEPT = "/log/x", "/log/q", "/log/gait", "/log/word", "/log/kept"
SCRIPT = "log_elements:\n  - name: /log/x\n    enabled: true\n    divider: 7\n  - name: /log/old\n    enabled: true\n"
COLUMN_NS = 10_000_000


def refusal(call, *arguments, **named):
    with pytest.raises(RefusedError) as error:
        call(*arguments, **named)
    return error.value


def options(client, name):
    return next(element.options for element in client.table().elements if element.name == name)


# ----------------------------------------------------------------------------------------------------- reading


def test_a_new_logger_says_who_it_is_and_that_nothing_is_logged_and_has_the_elements_as_they_were_added(client):
    hello = client._hello()
    assert (hello.status.logger, hello.may_edit) == ("robot", True)
    assert hello.status.helper_pid != hello.status.pid
    status = client.status()
    assert (status.state, status.ticks, status.lost, status.started_ns) == (State.STOPPED, 0, 0, 0)
    assert (status.elements, status.enabled, status.entries) == (5, 5, 7)
    assert status.frequency_hz == HZ
    table = client.table()
    assert [element.name for element in table.elements] == [X, Q, GAIT, WORD, KEPT]
    assert [len(element.entries) for element in table.elements] == [1, 3, 1, 1, 1]
    assert table.revision == client.status().revision


# ----------------------------------------------------------------------------------------------------- editing


def test_edits_change_the_table_and_its_revision_and_one_that_changes_nothing_is_not_counted(client, edit):
    before = client.table().revision
    applied = client.apply([edit(client, X, divider=4), edit(client, Q, enabled=False)], before)
    assert applied.changed == 2
    assert (options(client, X).divider, options(client, Q).enabled) == (4, False)
    assert client.table().revision == applied.revision > before
    assert client.status().enabled == 4
    assert client.apply([edit(client, X), edit(client, Q, divider=2)], -1).changed == 1


def test_edits_and_scripts_on_an_old_table_conflict_and_change_nothing(side, client, edit):
    side.add_script("a.yaml", SCRIPT)
    old = client.table().revision
    side.somebody_edits(X, divider=3)
    assert refusal(client.apply, [edit(client, X, divider=9)], old).why is RefusedWhy.CONFLICT
    assert refusal(client.load_script, "a.yaml", old).why is RefusedWhy.CONFLICT
    assert options(client, X).divider == 3


def test_a_running_logger_takes_no_edits_and_no_script(side, client, edit):
    side.add_script("a.yaml", SCRIPT)
    client.start()
    error = refusal(client.apply, [edit(client, X, divider=4)], -1)
    assert (error.why, "stop it" in str(error)) == (RefusedWhy.RUNNING, True)
    assert refusal(client.load_script, "a.yaml").why is RefusedWhy.RUNNING
    assert options(client, X).divider == 1


def test_one_wrong_edit_refuses_all_and_names_the_field_or_the_element_that_is_not_there(client, edit):
    error = refusal(client.apply, [edit(client, Q, divider=2), edit(client, X, divider=0)], -1)
    assert error.why is RefusedWhy.INVALID
    assert [(problem.name, problem.field) for problem in error.problems] == [(X, "divider")]
    assert f"'{X}': divider must be a whole number from 1 to 2147483647, got 0; nothing was changed" in str(error)
    error = refusal(client.apply, [edit(client, Q, divider=2), Edit("/log/nix", ElementOptions())], -1)
    assert (error.why, [problem.name for problem in error.problems]) == (RefusedWhy.INVALID, ["/log/nix"])
    assert "the table has no such element" in str(error)
    assert options(client, Q).divider == 1


# ------------------------------------------------------------------------------------------- starting, stopping


def test_what_runs_counts_its_ticks_and_is_not_started_again_and_what_is_stopped_keeps_them(side, client):
    assert client.stop().state is State.STOPPED
    assert client.start().state is State.RUNNING
    side.ticks(7)
    status = client.status()
    assert (status.state, status.ticks, status.saved) == (State.RUNNING, 7, False)
    assert status.started_ns >= START_NS
    assert refusal(client.start).why is RefusedWhy.RUNNING
    assert (client.status().state, client.status().ticks) == (State.RUNNING, 7)
    client.stop()
    side.ticks(5)
    assert (client.status().state, client.status().ticks) == (State.STOPPED, 7)


def test_a_start_over_unsaved_data_is_refused_unless_it_is_told_what_becomes_of_it(side, client):
    client.start()
    side.ticks(5)
    assert refusal(client.restart).why is RefusedWhy.UNSAVED
    assert (client.restart("discard").state, client.status().ticks) == (State.RUNNING, 0)
    side.ticks(5)
    client.stop()
    assert refusal(client.start).why is RefusedWhy.UNSAVED
    assert (client.status().state, client.status().ticks) == (State.STOPPED, 5)
    assert client.start("discard").ticks == 0


# ----------------------------------------------------------------------------------------------------- events


def test_what_a_client_does_is_told_to_all_with_its_name_and_the_new_status_as_is_what_others_do(side, client):
    revision = client.status().revision
    side.somebody_edits(X, divider=2)
    side.heard.event(EventKind.EDITED)
    assert client.status().revision > revision
    client.start()
    client.stop()
    events = [side.heard.event(kind) for kind in (EventKind.EDITED, EventKind.STARTED, EventKind.STOPPED)]
    assert all(event.by and event.text for event in events)
    assert [event.number for event in events] == sorted(event.number for event in events)
    assert [event.status.state for event in events[1:]] == [State.RUNNING, State.STOPPED]


# ----------------------------------------------------------------------------------------------------- saving


def test_a_save_reports_that_it_began_and_which_files_it_wrote_or_that_there_is_nothing_to_write(side, client):
    assert refusal(client.save, [FileType.SILO]).why is RefusedWhy.FAILED
    assert side.heard.event(EventKind.SAVE_FAILED).text
    client.start()
    side.ticks(20)
    job = client.save([FileType.SILO, FileType.CSV], "walk")
    saved = side.heard.event(EventKind.SAVED)
    began = next(event for event in side.heard.events if event.kind is EventKind.SAVING and event.job == job)
    assert (began.job, saved.job, saved.progress) == (job, job, 1.0)
    assert [file.type for file in saved.files] == [FileType.SILO, FileType.CSV]
    assert all("walk" in file.path and file.size_bytes > 0 for file in saved.files)
    assert client.status().saved
    assert len({job, client.save([FileType.SILO]), client.save([FileType.SILO])}) == 3  # each has its number


# ---------------------------------------------------------------------------------------------------- scripts


def test_scripts_are_listed_and_read_as_they_stand_and_none_that_is_not_there_or_wrong(side, client):
    side.add_script("b.yaml", SCRIPT)
    side.add_script("a.yaml", SCRIPT)
    scripts = client.scripts()
    assert scripts.names == ["a.yaml", "b.yaml"]
    assert scripts.current == "robot.yaml"
    text = client.read_script("a.yaml")
    assert (text.text, text.path) == (SCRIPT, f"{client.scripts().folder}/a.yaml")
    for what in (client.read_script, client.diff_script, client.load_script):
        assert refusal(what, "nix.yaml").why is RefusedWhy.NOT_FOUND
    side.add_script("bad.yaml", SCRIPT.replace("7", "0"))
    error = refusal(client.load_script, "bad.yaml")
    assert error.why is RefusedWhy.INVALID
    assert "bad.yaml:4" in str(error)


def test_a_difference_says_what_loading_would_change_and_loading_does_it_and_tells_what_nobody_knows(side, client):
    side.add_script("a.yaml", SCRIPT)
    diff = client.diff_script("a.yaml")
    assert [(change.name, change.field, change.old, change.new) for change in diff.changes] == [
        (X, "divider", "1", "7")
    ]
    assert (diff.unknown, options(client, X).divider) == (["/log/old"], 1)
    before = client.table().revision
    loaded = client.load_script("a.yaml")
    assert (loaded.changed, loaded.unknown, options(client, X).divider) == (1, ["/log/old"], 7)
    assert client.table().revision == loaded.revision > before
    assert side.heard.event(EventKind.SCRIPT_LOADED).by
    side.add_script("b.yaml", SCRIPT + "colour: red\n")
    (warned,) = client.diff_script("b.yaml").warnings
    assert "colour" in warned
    assert client.load_script("b.yaml").warnings == [warned]


TRIGGERS = "triggers:\n  - name: high\n    when: x > 3\n    pre_s: 2\n"


def test_a_difference_in_triggers_alone_is_told_and_loaded(side, client):
    side.add_script("a.yaml", client.read_script().text + TRIGGERS)
    diff = client.diff_script("a.yaml")
    assert not diff.changes
    assert [(change.name, change.field, change.old, change.new) for change in diff.conditions] == [
        ("trigger high", "", "none", "x > 3, pre 2 s")
    ]
    client.load_script("a.yaml")
    assert client.diff_script("a.yaml").conditions == []
    side.add_script("b.yaml", client.read_script().text.replace("pre: 2s", "pre: 3s"))
    diff = client.diff_script("b.yaml").conditions
    assert [(change.field, change.old, change.new) for change in diff] == [("pre", "2 s", "3 s")]


def test_a_script_that_is_there_is_replaced_only_when_that_is_meant(side, client):
    side.add_script("a.yaml", SCRIPT)
    assert refusal(client.save_script, "a.yaml").why is RefusedWhy.EXISTS
    assert client.read_script("a.yaml").text == SCRIPT
    assert "a.yaml" in client.save_script("a.yaml", True)
    assert client.read_script("a.yaml").text != SCRIPT


def test_a_saved_script_is_what_runs_is_listed_told_and_changes_nothing_when_loaded(side, client, edit):
    client.apply([edit(client, X, divider=5)], -1)
    assert "divider: 5" in client.read_script().text
    client.save_script("new.yaml")
    assert side.heard.event(EventKind.SCRIPT_SAVED).text
    assert "new.yaml" in client.scripts().names
    assert client.diff_script("new.yaml").changes == []


# ------------------------------------------------------------------------------------------------ values, history


def frame_with(view, fact):
    """The first frame for which `fact` holds. The helper process sends them by its own clock."""
    return wait_until(lambda: (frame := view.frame()) is not None and fact(frame) and frame)


def test_a_frame_has_the_values_fills_and_columns_that_were_asked_for_and_says_what_is_missing(side, client):
    client.start()
    view = client.view([X, Q, KEPT], [X], 10.0, COLUMN_NS)
    side.ticks(8)
    frame = frame_with(view, lambda frame: frame.tick >= 8)
    assert (frame.elements, frame.plots, frame.column_ns) == ((X, Q, KEPT), (X,), COLUMN_NS)
    assert frame.entries == (X, f"{Q}_x", f"{Q}_y", f"{Q}_z", KEPT)
    assert (frame.unpublished, frame.missing) == (frozenset(), frozenset())
    assert (frame.running, len(frame.newest), len(frame.held), frame.held[0]) == (True, 5, 3, 8)
    assert np.isfinite(frame.newest).all()
    assert frame.low.shape == frame.high.shape == (1, frame.low.shape[1])
    view.close()
    side.ticks(8)
    assert view.frame() is None
    other = client.view([X, WORD, "/log/nix"], [], 10.0, COLUMN_NS)
    side.ticks(8)
    frame = frame_with(other, lambda frame: frame.tick >= 24)
    assert (frame.texts, frame.missing, len(frame.newest), len(frame.held)) == ({1: "hans"}, {"/log/nix"}, 2, 3)


def test_history_has_a_column_for_all_that_was_logged(side, client):
    client.start()
    side.ticks(80)
    end = client.status().last_tick_ns
    past = client.history([X, f"{Q}_y"], START_NS, end, COLUMN_NS)
    assert (past.names, past.column_ns, past.low.shape) == ((X, f"{Q}_y"), COLUMN_NS, past.high.shape)
    numbers = past.first + np.flatnonzero(~np.isnan(past.low[0]))
    assert list(numbers) == list(range(START_NS // COLUMN_NS, end // COLUMN_NS + 1))
    assert (past.low[0, ~np.isnan(past.low[0])] <= past.high[0, ~np.isnan(past.low[0])]).all()


# ------------------------------------------------------------------------------------------------------- the link


def test_a_lost_link_is_told_and_calls_say_so(side, client):
    assert client.connected
    side.cut()
    assert side.heard.lost()
    assert not client.connected
    for call in (client.status, client.table, client._hello, client.start):
        with pytest.raises(ConnectionLostError):
            call()


# ---------------------------------------------------------------------------------------------------- raw samples


def test_samples_of_any_enabled_element_have_their_ticks_stamps_and_own_types(side, client):
    error = refusal(client.samples, ["/log/nix"])
    assert (error.why, "/log/nix" in str(error)) == (RefusedWhy.NOT_FOUND, True)
    client.start()
    side.ticks(8)
    found = client.samples([X, Q, f"{Q}_y", GAIT, WORD, KEPT])
    assert {name: (len(some), some.values.dtype.str) for name, some in found.items()} == {
        X: (8, "<f8"), Q: (8, "<f8"), f"{Q}_y": (8, "<f8"), GAIT: (8, "|i1"), WORD: (2, "|S8"), KEPT: (8, "<f8")
    }  # fmt: skip
    assert found[Q].values.shape == (8, 3)
    assert (found[X].ticks.tolist(), found[WORD].ticks.tolist(), found[WORD].divider) == (list(range(8)), [0, 4], 4)
    assert np.diff(found[X].time_ns).tolist() == [round(1e9 / HZ)] * 7
    np.testing.assert_array_equal(found[Q].values[:, 1], found[f"{Q}_y"].values)
    side.ticks(4)  # and they are taken between ticks, rows and times
    stamps = client.samples([X])[X].time_ns
    assert client.samples([X], 3, 6, "tick")[X].ticks.tolist() == [3, 4, 5]
    assert client.samples([WORD], 1, 3, "row")[WORD].ticks.tolist() == [4, 8]
    assert client.samples([X], 10, 99, "tick")[X].ticks.tolist() == [10, 11]
    assert client.samples([X], int(stamps[2]), int(stamps[4]))[X].ticks.tolist() == [2, 3]
    assert client.samples([X], int(stamps[2]) + 1, int(stamps[4]) + 1)[X].ticks.tolist() == [3, 4]


def test_samples_of_an_element_that_is_off_are_none_and_say_why(side, client, edit):
    client.apply([edit(client, KEPT, enabled=False)], -1)
    client.start()
    side.ticks(4)
    found = client.samples([KEPT, X])
    assert (len(found[KEPT]), found[KEPT].why, len(found[X])) == (0, "it is off", 4)


def test_a_pin_keeps_what_the_buffers_overwrite(side, client, edit):
    client.apply([edit(client, X, size=10, buffer=BufferType.LOOPING)], -1)
    client.start()
    side.ticks(2000)
    held = client.samples([X])[X]
    pin = client.pin([X], int(held.time_ns[0]), int(held.time_ns[-1]))
    assert (pin.opened.begin_ns, pin.opened.end_ns) == (held.time_ns[0], held.time_ns[-1])
    side.ticks(4000)
    assert client.samples([X])[X].ticks[0] > held.ticks[-1]
    np.testing.assert_array_equal(client.samples([X], pin=pin)[X].values, held.values)
    np.testing.assert_array_equal(client.samples([X], pin=pin)[X].ticks, held.ticks)
    past = client.history([X], pin.opened.begin_ns, pin.opened.end_ns + 1, COLUMN_NS, pin)
    assert np.nanmax(past.high[0]) == held.values.max()


def test_a_pin_is_no_more_when_it_was_closed(side, client):
    client.start()
    side.ticks(8)
    pin = client.pin([X], 0, 2**61)
    assert client.samples([Q], pin=pin)[Q].why == "it is not in this pin"
    pin.close()
    error = refusal(lambda: client.samples([X], pin=pin))
    assert (error.why, "no more" in str(error)) == (RefusedWhy.NOT_FOUND, True)


def test_moments_are_found_where_the_samples_have_them(side, client):
    client.start()
    side.ticks(300)
    samples = client.samples([X])[X]
    level = float(np.median(samples.values))
    for what in ("highest", "lowest", "crossing", "edge", "peak", "change", "hole", "not finite"):
        found = client.find([X], what, level, 1, around_ns=int(samples.time_ns[150]), most=6)[X]
        wanted = places(Looking(Sought(what), level, 1, period_ns=round(1e9 / HZ)), samples.time_ns, samples.values)
        assert found.total == len(wanted), what
        here = wanted[found.before : found.before + len(found.time_ns)]
        np.testing.assert_array_equal(found.time_ns, samples.time_ns[here])
        np.testing.assert_array_equal(found.values, samples.values[here])
        assert (found.begin_ns, found.end_ns) == (samples.time_ns[0], samples.time_ns[-1])


# --------------------------------------------------------------------------------------------------- measuring


def measured(client, quantity, name):
    return np.frombuffer(client._survey([quantity], [name]).values)[0]


def test_a_survey_is_of_the_whole_table_in_its_order_or_of_names_of_elements_and_entries_saved_or_not(side, client):
    client.start()
    client._survey(["max"])
    side.ticks(50)
    entry = next(element for element in client.table().elements if element.name == Q).entries[1]
    wanted = [X, Q, Q + entry.suffix, KEPT]
    wait_until(lambda: np.isfinite(np.frombuffer(client._survey(["max"], wanted).values)).all())
    assert np.isnan(measured(client, "max", "/log/nix"))
    assert np.isnan(measured(client, "max", WORD))
    survey = client._survey(["held", "signs"])
    assert np.frombuffer(survey.values).reshape(2, -1).shape == (2, 5)
    assert survey.revision == client.table().revision
    assert refusal(client._survey, ["beauty"]).why is RefusedWhy.INVALID


def test_what_is_asked_of_some_beside_all_is_of_the_same_samples(side, client):
    client.start()
    place = [element.name for element in client.table().elements].index(X)
    for _ in range(5):
        side.ticks(7)
        found = client._survey(["value"], some=[X, Q], some_quantities=["value", "max"])
        some = np.frombuffer(found.some).reshape(2, 2)
        assert np.array_equal(np.frombuffer(found.values)[[place]], some[0, :1], equal_nan=True)
    assert refusal(client._survey, ["value"], some=[X], some_quantities=["beauty"]).why is RefusedWhy.INVALID


def test_statistics_begin_when_a_client_asks_first_and_after_its_reset(side, client):
    client.start()
    side.ticks(5)
    first = client._survey(["max"]).since_ns
    side.ticks(5)
    assert client._survey(["max"]).since_ns == first > 0
    assert client._survey(["max"], reset=True).since_ns > first
