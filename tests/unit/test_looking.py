"""What a logger, its elements and a recording say when they are looked at."""

import numpy as np
import pytest

import silo
from silo.cli.common import show_rows
from silo.logger.null import NullLogger


@pytest.fixture
def log(new_logger):
    made = new_logger()
    q = made.array("q", 3, group="joints", unit="rad", size=4)
    made.array("mode", dtype=int, divider=2, action="both")
    made.array("<b>", buffer="fixed", size=2)
    made.array("big", buffer="fixed", size=100)
    made.update()
    made.q = q
    return made


def turned(log, count):
    log.start()
    for tick in range(count):
        log.q[:] = tick
        log.collect()
    log.stop()
    return log


def test_a_logger_tells_its_name_size_state_and_what_it_holds(log):
    assert log.name == "test"
    assert len(log) == 4
    assert repr(log) == "<Logger test: 4 elements, 100 Hz, stopped>"
    assert "7 ticks, not saved" in repr(turned(log, 7))
    log.close()
    assert "closed" in repr(log)


def test_a_logger_without_elements_is_still_a_logger(new_logger):
    empty = new_logger()
    assert len(empty) == 0
    assert empty
    assert NullLogger()


def test_a_logger_gives_its_names_in_order(log):
    assert list(log) == ["/log/joints/q", "/log/mode", "/log/<b>", "/log/big"]
    assert "joints/q" in log
    assert "/log/joints/q" in log
    assert "joints" not in log
    assert 5 not in log


def test_an_element_tells_options_newest_value_and_samples_held(log):
    element = turned(log, 7)["joints/q"]
    assert (element.name, element.unit, element.shape) == ("/log/joints/q", "rad", (3,))
    assert element.options.size == 4
    assert element.newest.tolist() == [6, 6, 6]
    assert element.held == 4
    assert repr(element) == "<Element /log/joints/q [rad] save, looping 4, 4 held, newest [6., 6., 6.]>"


def test_a_divided_element_and_a_full_one_tell_their_own_newest(log):
    turned(log, 7)
    assert (log["mode"].held, log["<b>"].held, log["big"].held) == (4, 2, 7)
    begin = log["<b>"].time_ns
    assert begin < log["mode"].time_ns == log["big"].time_ns


def test_an_element_without_samples_says_so(log):
    assert log["joints/q"].newest is None
    assert "newest none" in repr(log["joints/q"])


def test_an_element_that_is_off_holds_nothing_of_this_run(log):
    log.set("mode", enabled=False)
    off = turned(log, 7)["mode"]
    assert (off.held, off.lost, off.failures, off.newest, off.time_ns) == (0, 0, 0, None, None)


def test_an_unknown_name_is_told_with_the_nearest(log):
    with pytest.raises(silo.ElementError, match="no element 'joint/q'; did you mean '/log/joints/q'"):
        log["joint/q"]
    with pytest.raises(silo.ElementError, match="name must be a text, got 0"):
        log[0]


def test_notebooks_see_a_table_in_which_names_are_escaped(log):
    html = turned(log, 3)._repr_html_()
    assert "<td>/log/joints/q</td>" in html
    assert "&lt;b&gt;" in html


def test_a_recording_is_told_in_a_line_and_a_table(log):
    recording = turned(log, 3).snapshot()
    assert repr(recording).startswith("<Recording test: 4 elements, 3 ticks, ")
    html = recording._repr_html_()
    assert "<td>/log/joints/q</td><td>rad</td>" in html
    assert html.count("<td></td></tr>") == 4  # nothing of them was lost


def test_new_values_say_how_many_they_are(log):
    new = turned(log, 3).read_new_values("joints/q")
    assert len(new) == 3
    assert repr(new) == "<NewValues 3 of float64 (3,)>"


def test_the_logger_that_does_nothing_can_be_looked_at_too():
    null = NullLogger()
    null.array("q", 3)  # what was not added it doesn't invent
    assert null["q"].newest is None
    assert list(null) == ["/log/q"]
    assert "logs nothing" in repr(null)


def test_what_programs_meet_is_exported():
    for home, names in {
        silo: "Client Edit connect",
        silo.types: "Serving SavedFile NewValues LoggedElement",
        silo.errors: "ArgumentError",
    }.items():
        for name in names.split():
            assert getattr(home, name).__name__ == name


def test_arrays_made_of_a_look_are_copies(log):
    element = turned(log, 2)["joints/q"]
    element.newest[:] = 9
    assert np.all(log["joints/q"].newest == 1)


def test_no_cell_of_a_table_moves_the_cursor(capsys):
    show_rows([("LOGGER", "WHY"), ("bot", "\x1b[2Jgone\n\x07")])
    assert capsys.readouterr().out == "LOGGER  WHY\nbot     \\x1b[2Jgone\\x0a\\x07\n"
