"""What a menu holds and does, without an app: letters, what is drawn, why not now, once more and the other way."""

from types import SimpleNamespace

import pytest
from textual import events

from silo_tui.actions import BY_ID
from silo_tui.gate import STRAY
from silo_tui.keymap import OPENERS, in_menu, use_keys
from silo_tui.menus import DRAWN_AFTER_S, DRAWN_AFTER_THIN_S, MenuReader
from silo_tui.screens.dialogs.questions import OrderDialog, Question
from silo_tui.screens.table import TableScreen
from silo_tui.widgets.inputs import Fleeting
from tests.stand_ins.desk import Plain, Sheet


class Asked(Sheet):
    """A screen that keeps which commands it was asked for; its plots can't be joined now."""

    context = property(lambda self: self.desk)
    focused, subject = None, ""

    def action_command(self, command_id, typed=None):
        self.told.append(command_id)
        if command_id in BY_ID and command_id.startswith("menu"):
            self.desk.reader.open(command_id)

    def why_not_now(self, command_id):
        return "one plot alone" if command_id == "join_plots" else ""

    def value_now(self, command_id):
        return "12" if command_id == "edit_divider" else ""

    def mount(self, lines):
        self.lines = lines
        lines.remove = lambda: self.told.append("the menu goes")

    def cover_messages(self, covered):
        self.covered = covered

    def read_said(self):
        self.has_read = True

    def show_keys(self, instead):
        self.in_bar = instead


class Reading(Plain):
    """A desk with a reader of keys."""

    kind = Asked

    def __init__(self, fake):
        super().__init__(fake)
        self.sheet.desk = self
        self.size, self.timer = SimpleNamespace(width=80), None
        self.reader = MenuReader(self, lambda: True)
        self.gate, self.refusals = SimpleNamespace(refused=self.refused), 0

    def refused(self):
        self.refusals += 1

    def set_timer(self, after_s, do):
        self.timer = SimpleNamespace(after_s=after_s, do=do, stop=lambda: None)
        return self.timer

    def typed(self, *keys):
        return [self.reader.takes(events.Key(key, key if len(key) == 1 else None)) for key in keys]


@pytest.fixture
def reading(fake):
    return Reading(fake)


def test_a_letter_behind_another_is_one_command_and_no_menu_is_drawn(reading):
    assert reading.typed("e", "t", "j") == [True, True, True]
    assert reading.sheet.told == ["menu_edit", "keys", "toggle", "down"]
    assert reading.timer.after_s == DRAWN_AFTER_S
    reading.timer.do()
    assert not hasattr(reading.sheet, "lines")


def test_a_menu_is_drawn_once_and_later_where_the_link_is_slow(reading):
    reading.reader._is_fast = lambda: False
    reading.typed("e")
    assert reading.timer.after_s == DRAWN_AFTER_THIN_S
    reading.timer.do()
    first = reading.sheet.lines
    reading.timer.do()
    assert reading.sheet.lines is first


def test_esc_leaves_a_menu_and_does_no_more(reading):
    reading.typed("e", "escape")
    assert reading.sheet.told == ["menu_edit", "keys"]
    reading.typed("escape")
    assert reading.sheet.told[-1] == "back"


def test_a_key_that_ends_the_program_ends_it_in_a_menu_too(reading):
    reading.typed("e", "ctrl+q")
    assert reading.sheet.told[-1] == "quit_now"


def test_a_letter_that_is_in_no_menu_leaves_it_open(reading):
    reading.typed("e", "Q")
    assert reading.refusals == 1
    assert reading.sheet.told[-1] == "Q is not in the menu; Esc leaves it"
    reading.typed("down")
    assert reading.sheet.told[-1] == "↓ is not in the menu; Esc leaves it", "nothing of it was refused"
    assert reading.sheet.lines and reading.sheet.covered, "one row of what is said stays"
    assert reading.sheet.in_bar == "a letter Does what stands behind it  Esc Leaves the menu"
    reading.typed("t")
    assert (reading.sheet.told[-3:], reading.sheet.in_bar) == (["the menu goes", "keys", "toggle"], "")
    assert not reading.sheet.covered


def test_the_key_of_another_menu_opens_that_one_where_it_is_no_letter_of_this(reading):
    reading.typed("v")
    reading.timer.do()
    reading.typed("g")
    assert "menu_go" in reading.sheet.told, "one that is open, and was refused something, is no trap"
    reading.typed("g")  # a letter of that menu: to the top
    assert reading.sheet.told[-1] == "top"


@pytest.mark.parametrize(("key", "does"), [("plus", "closer"), ("minus", "wider"), ("pageup", "earlier")])
def test_a_key_that_moves_the_window_is_done_from_the_menu_of_plots_too(reading, key, does):
    reading.sheet.scope = "monitor"
    reading.typed("p")
    reading.timer.do()
    reading.typed(key)
    assert reading.sheet.told[-3:] == ["the menu goes", "keys", does]


def test_a_menu_of_a_screen_that_is_left_is_left_too(reading):
    reading.typed("e")
    other = Asked()
    other.scope, other.desk = "table", reading
    reading.screen_stack.append(other)
    reading.typed("j")
    assert other.told == ["down"]


def test_over_a_dialog_and_before_there_is_a_screen_no_key_is_a_command(reading):
    reading.screen_stack.append(SimpleNamespace())
    assert reading.typed("j") == [False]
    reading.screen_stack.clear()
    assert reading.typed("j") == [False]


def test_what_is_pasted_is_told_with_how_much_it_is(reading):
    assert reading.reader.takes(events.Paste("abc"))
    assert reading.sheet.told == ["3 characters pasted outside a line are no keys: left out"]


@pytest.mark.parametrize("keys", ["j", "e t"])
def test_in_a_line_keys_are_letters_but_for_the_one_that_ends(keys, reading, monkeypatch):
    line = Fleeting.__new__(Fleeting)
    monkeypatch.setattr(Fleeting, "display", True)
    reading.sheet.focused = line
    assert reading.typed(*keys.split(), "ctrl+q") == [*[False] * len(keys.split()), True]
    assert reading.reader.takes(events.Paste("abc")) is False
    monkeypatch.setattr(Fleeting, "display", False)
    assert reading.typed("j") == [True]
    assert reading.sheet.told == ["quit_now", "down"]


@pytest.mark.parametrize(
    ("keys", "repeated"),
    [("e t", "toggle"), ("v c", "columns"), ("p e", ""), ("g a", ""), ("e l", ""), ("e w", ""), ("r d", "")],
)
def test_only_what_edits_or_changes_what_is_shown_is_done_again(keys, repeated, reading):
    reading.typed(*keys.split())
    assert reading.sheet.repeated == repeated
    reading.sheet.told.clear()
    reading.reader.again(turned=False)
    nothing = "nothing to do again yet: it repeats what a menu of edit, view or plots did last"
    assert reading.sheet.told == [repeated or nothing]


@pytest.mark.parametrize(
    ("repeated", "does"),
    [
        ("next_sample", "previous_sample"),
        ("previous_sample", "next_sample"),
        ("toggle", "On/Off has no other way; u takes an edit back"),
    ],
)
def test_what_was_done_last_is_done_the_other_way_round_where_it_has_one(repeated, does, reading):
    reading.sheet.repeated = repeated
    reading.reader.again(turned=True)
    assert reading.sheet.told == [does]


def menu(reading, letter):
    """What stands in a menu, by letter."""
    reading.typed(letter)
    title, *lines = reading.reader.picture(reading.sheet, 78).plain.split("\n")
    width = 78 // max(-(-len(in_menu(OPENERS[letter], reading.sheet.scope)) // 7), 3)
    entries = [line[at : at + width].strip() for line in lines for at in range(0, len(line), width)]
    return title, [entry for entry in entries if entry]


def test_a_menu_has_its_title_the_way_back_and_values(reading):
    title, entries = menu(reading, "e")
    assert title.startswith("e  changes to what the cursor is on ")
    assert (title[-9:], len(title), "( )" in title) == (" Esc back", 78, False)
    assert "d  Divider: 12" in entries
    reading.read_only = True
    title = reading.reader.picture(reading.sheet, 78).plain.split("\n")[0]
    assert title.startswith("e  changes to what the cursor is on  ( ) not now: type it for why  ")


@pytest.mark.parametrize("width", [30, 48, 78])
def test_on_a_narrow_screen_the_title_gives_way_to_the_way_back(width, reading):
    reading.typed("p")
    title, *rows = reading.reader.picture(reading.sheet, width).plain.split("\n")
    assert (len(title), title[-10:]) == (width, "  Esc back")
    told = title.removesuffix("Esc back").rstrip().partition("  ( )")[0].removesuffix("…")
    assert f"{BY_ID['menu_plots'].help} ".removeprefix("the menu of ").startswith(f"{told.partition('  ')[2]} ")
    assert len(rows) == 7
    assert all(len(row) <= width for row in rows)


@pytest.mark.parametrize(
    ("change", "entry"),
    [
        ({"read_only": True}, "(d) Divider: read-only"),
        ({"may_edit": False}, "(d) Divider: read-only"),
        ({"lost_since": 1.0}, "(c) Control: no link"),
        ({}, "d  Divider: 12"),
    ],
)
def test_an_entry_that_can_t_be_done_stands_in_brackets_with_the_reason(change, entry, reading):
    for name, value in change.items():
        setattr(reading if hasattr(reading, name) else reading.session, name, value)
    reading.session.why_not = "this is read-only; bob may, ann may not"
    _, entries = menu(reading, "e")
    assert [each for each in entries if each.startswith(entry)]


def test_a_reason_that_has_no_room_is_left_out_and_no_word_is_cut(reading):
    reading.session.may_edit, reading.session.why_not = False, "its control is with somebody else; g l shows who"
    _, entries = menu(reading, "e")
    assert [each for each in entries if each == "(d) Divider"]
    assert not [each for each in entries if "…" in each]


@pytest.mark.parametrize("scope", ["triggers", "alarms", "recordings"])
def test_where_edits_are_dropped_elsewhere_the_menu_names_the_key_that_deletes(scope, reading):
    reading.sheet.scope = scope
    _, entries = menu(reading, "e")
    assert "(x) Discard: D deletes" in entries
    reading.typed("x")
    assert reading.sheet.told[-1] == "e x (Discard): D deletes what the cursor is on, or all that are marked"


def test_the_menu_of_plots_names_what_zooms_and_tells_of_a_long_name_what_has_room(reading):
    reading.sheet.scope = "monitor"
    reading.sheet.subject = "/base/acceleration_of_the_left_rear_leg_x"
    title, entries = menu(reading, "p")
    assert {"+  Zoom", "-  Zoom out", "PgUp  Earlier", "PgDn  Later"} <= set(entries)
    assert "rear_leg_x  ( ) not now: type it for why  " in title
    reading.typed("plus")
    assert reading.sheet.repeated == "closer"


def test_no_word_of_an_entry_is_cut(reading):
    for letter in "gevrp":
        reading.typed(letter)
        for width in range(70, 100):
            _, *rows = reading.reader.picture(reading.sheet, width).plain.split("\n")
            cut = [word.rpartition(" ")[2] for row in rows for word in row.split("…")[:-1]]
            labels = {"", *(word for command in BY_ID.values() for word in command.label.replace(":", "").split())}
            assert set(cut) <= labels, (letter, width, cut)
        reading.typed("escape")


def test_a_reason_that_all_have_stands_in_the_title_alone(reading):
    reading.sheet.scope = "file"
    title, entries = menu(reading, "r")
    assert "(now: live only)" in title
    assert not [each for each in entries if ":" in each]


def test_an_entry_that_the_screen_has_no_use_for_now_says_why(reading):
    reading.sheet.scope = "monitor"
    reading.typed("p", "j")
    assert reading.sheet.told[-1] == "p j (Join): one plot alone"
    assert not hasattr(reading.sheet, "lines")  # what follows is for the screen
    reading.typed("p")
    reading.reader.draw()
    reading.typed("j")
    assert reading.reader._menu  # who reads it may pick another


@pytest.mark.parametrize(
    ("width", "told"), [(80, "read-only"), (300, "this is read-only (--read-only, SILO_READ_ONLY")]
)
def test_why_not_is_told_in_the_one_row_that_a_menu_leaves(reading, width, told):
    reading.read_only, reading.size.width = True, width
    reading.typed("e")
    reading.reader.draw()
    reading.typed("t")
    assert reading.sheet.told[-1].startswith(f"e t (On/Off): {told}")
    assert len(reading.sheet.told[-1]) <= width - 2


def test_without_a_logger_an_entry_about_one_says_how_to_open_one(reading):
    reading.take_session(None)
    reading.sheet.scope = "loggers"
    reading.typed("g", "t")
    assert reading.sheet.told[-1].endswith("no logger is open; Enter opens one that is listed")


def test_the_menu_of_edits_and_the_words_typed_call_what_is_saved_a_script(reading):
    _, entries = menu(reading, "e")
    assert {"w  Save script", "l  Load script"} <= {each.strip() for each in entries}
    assert BY_ID["save_script"].typed.help == "save the script"


@pytest.mark.slow
@pytest.mark.parametrize(("typed", "stays"), [("vxtiS", TableScreen), ("oZdi", OrderDialog), ("vvxeS", Question)])
async def test_a_word_typed_where_its_letters_mean_nothing_gives_no_commands_by_the_rest(typed, stays, fake, opened):
    async with opened(fake.run()) as screen:
        await screen.type(typed)
        await screen.shows(STRAY[:30])
        await screen.until(lambda: screen.app.gate.free)
        assert (type(screen.app.screen), screen.session.rows.sort) == (stays, "name")


@pytest.mark.slow
async def test_a_filter_that_is_typed_behind_a_refused_entry_is_a_filter_and_an_arrow_moves_on(fake, opened):
    use_keys("two-layer", {})
    async with opened(fake.run()) as screen:
        await screen.press("v", shows="Esc Leaves the menu")
        await screen.press("u", shows="none marked")
        await screen.press("slash", *"torque", "enter")
        await screen.until(lambda: screen.session.rows.filter.text == "torque", "what was typed as a filter")
        await screen.press("v", shows="Esc Leaves the menu")
        await screen.press("u", shows="none marked")
        await screen.press("down", shows=">LF/HFE/torque")


@pytest.mark.parametrize("ways", [("gs", "gl"), ("gs", "gl", "gm"), ("ge", "gl"), ("gl",)])
async def test_home_is_the_table_whatever_the_loggers_were_listed_over(ways, screen, ran_s=12):
    for each in (*ways, "gh"):
        await screen.press(*each)
    await screen.until(lambda: screen.app.screen.scope == "table", "the table")
