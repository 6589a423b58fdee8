"""The two layers of keys: the first, the menus over it, and the table that both are made from."""

import itertools
import string

import pytest
from msgspec.structs import replace
from textual import events

from silo_tui import keymap
from silo_tui.actions import BY_ID, COMMANDS, commands_for, key_of, key_text
from silo_tui.keymap import BASES, OPENERS, TWO_LAYERS, clashes, in_menu, use_keys, where, why_no_use
from silo_tui.menus import MenuLines
from silo_tui.model.table.columns import NAME, TREE
from silo_tui.model.table.fields import Field
from silo_tui.screens.dialogs.questions import Question
from silo_tui.settings.options import Settings
from silo_tui.settings.reading import read
from tests.tui.test_conditions import FALL, HOT
from tests.tui.test_typed_early import burst

SCOPES = sorted({scope for command in COMMANDS for scope in command.scopes} - {"any"})


def drawn(screen):
    lines = screen.app.screen.query(MenuLines)
    return lines.first().content.plain if lines else ""


# ------------------------------------------------------------------------------------------------------- the table


@pytest.mark.parametrize("base", BASES)
def test_no_key_stands_twice(base):
    assert list(clashes(base, {})) == []


def test_a_key_that_is_given_holds_on_all_screens_that_have_the_same_where_it_is_free():
    try:
        use_keys("two-layer", {"mark_shown": "M"})
        assert (key_of("mark_shown"), key_of("list_mark_all")) == ("M", "M")
        use_keys("classic", {"mark_shown": "F"})  # recordings, on lists
        assert (key_of("mark_shown"), key_of("list_mark_all")) == ("F", "*")
        for keymap_of_user in BASES:
            use_keys(keymap_of_user, {"monitor": "f9"})  # on a table, on that of a file, over parameters
            assert why_no_use("m", "table") == "m is no key here; Plot is F9"
            assert [key_of(each) for each in ("monitor", "plot_conditions")] == ["F9", "F9"]
        use_keys("two-layer", {"monitor": "M", "delete_recording": "X"})
        assert [key_of(each) for each in ("plot", "plot_conditions", "alarm_remove")] == ["M", "M", "D"]
        assert why_no_use("m", "file") == "m is no key here; Plot is M"
        assert why_no_use("m", "settings") == "m is no key here; Plot is M, a key of table"
    finally:
        use_keys("two-layer", {})


@pytest.mark.parametrize("scope", ["table", "parameters"])
def test_a_capital_turns_undo_round(scope):
    use_keys("two-layer", {})
    assert [keymap.command_of(key, scope).id for key in ("u", "U", "ctrl+r")] == ["undo", "redo", "redo"]


def check():
    """Refuse a table in which something stands twice, or nowhere."""
    eaten = ("ctrl+h", "ctrl+i", "ctrl+j", "ctrl+m", "ctrl+enter", "alt+")
    for base in BASES:
        for mine, theirs, key, scope in clashes(base, {}):
            raise ValueError(f"{base}: {key_text(key)} is {mine} and {theirs} ({scope})")
    for command in COMMANDS:
        if command.id not in keymap.TWO_LAYERS and command.keys:
            raise ValueError(f"{command.id} has no place in the two layers")
    for keys, commands in keymap._TABLE:
        if keymap.DESTROYS in keys.split(",") and keys != keymap.DESTROYS:
            raise ValueError(f"what {keys} destroys has another key: {commands}")
        for key in keys.split(","):
            menu, _, letter = key.rpartition(" ")
            if (menu and (menu not in OPENERS or letter == keymap.DESTROYS)) or key.startswith(eaten):
                raise ValueError(f"{key} of {commands} is no key that can be")


def test_the_table_has_no_conflict():
    check()


def test_every_command_has_its_place_on_every_screen_where_it_has_a_key():
    use_keys("classic", {})
    classic = {scope: {command.id for command in commands_for(scope)} for scope in SCOPES}
    use_keys("two-layer", {})
    for scope in SCOPES:
        assert classic[scope] <= {command.id for command in commands_for(scope)}


@pytest.mark.slow
async def test_a_letter_that_is_no_key_of_a_screen_says_so_and_no_more(fake, opened, tmp_path):
    fake.logs = tmp_path
    async with opened(fake.run(), size=(100, 30)) as screen:
        scopes = set()
        for way in ("", "m", "m enter", "g e", "g t", "g a", "g r", "g p", "g l", "f2"):
            await screen.press(*way.split())
            scope = screen.app.context.upper_screen.scope
            known = {key for command in commands_for(scope) for key in command.keys.split(",")}
            for letter in sorted({*string.ascii_letters, *string.digits} - known):
                await screen.press(letter)
                assert (screen.app.context.upper_screen.scope, screen.app.unforeseen.errors) == (scope, []), letter
            scopes.add(scope)
            await screen.do("go_home", at="table")
        assert len(scopes) == 10


def test_a_letter_of_a_menu_has_one_meaning_on_every_screen():
    use_keys("two-layer", {})
    for opener in OPENERS.values():
        for scope in SCOPES:
            assert list(in_menu(opener, scope)) == list(in_menu(opener, "table"))
            for commands in in_menu(opener, scope).values():
                here = [each for each in commands if scope in each.scopes]
                assert len(here) <= 1, (scope, here)


def test_what_destroys_shares_its_key_with_nothing():
    assert {command for command, keys in TWO_LAYERS.items() if "D" in keys.replace(",", " ").split()} == {
        "delete_recording", "trigger_remove", "alarm_remove", "forget_derived",
    }  # fmt: skip


def test_sentences_and_keys_of_before_name_the_new_place():
    use_keys("two-layer", {"recordings": "F"})
    assert (key_of("toggle"), key_of("recordings"), BY_ID["toggle"].key_text) == ("e t", "F", "t")
    for key, scope, told in (
        ("t", "table", "On/Off is e t"), ("b", "monitor", "Cursor B is p b"), ("x", "detail", "X-Y is p x"),
        ("f", "table", "Fold is v f"), ("d", "monitor", "Divider is e d, a key of table"),
    ):  # fmt: skip
        assert why_no_use(key, scope) == f"{key} is no key here; {told}"
    use_keys("two-layer", {"zero": "f9"})
    assert why_no_use("f9", "settings") == (
        "F9 (Zero) has no use here: it is a key of table (g h), plots (g h, then m)"
    )


def test_own_keys_may_be_paths_and_conflicts_cost_their_line():
    text = "keys:\n  edit_divider: [d, e d]\n  edit_size: e d\n  toggle: e\nkeymap: two-layer\n"
    settings, problems = read(text)
    assert settings.keymap == "two-layer"
    assert settings.keys == {"edit_divider": "d,e d"}
    assert [problem.line for problem in problems] == [3, 4]
    assert read("keys: {recordings: e d f}")[0].keys == {}


@pytest.mark.parametrize(
    ("base", "own", "letter"),
    [("two-layer", {}, "t"), ("classic", {}, "t"), ("two-layer", {"toggle": "e J"}, "J"),
     ("classic", {"toggle": "e J"}, "J"), ("two-layer", {"toggle": "f9"}, "t")],
)  # fmt: skip
def test_a_command_stands_in_its_menu_by_the_path_that_the_user_gave_it_else_by_its_own(base, own, letter):
    use_keys(base, own)
    found = in_menu("menu_edit", "table")
    assert [key for key, commands in found.items() if BY_ID["toggle"] in commands] == [letter]


def test_ids_of_before_still_work():
    assert read("keymap: two-layer\nkeys: {next_logger: J}\n")[0].keys == {"list_down": "J"}


# ------------------------------------------------------------------------------------------------------- the reader


@pytest.mark.slow
async def test_what_is_typed_on_goes_there_and_no_menu_is_drawn(screen):
    burst(screen, "g e")
    await screen.until(lambda: screen.app.screen.scope == "events" and screen.app.gate.free)
    assert not drawn(screen)
    await screen.press("escape")
    burst(screen, "e d 5 enter j full_stop")
    await screen.until(lambda: screen.session.table.pending_count == (2, 2), "the edit and the same again")
    burst(screen, "u u")
    await screen.until(lambda: screen.session.table.pending_count == (0, 0))


@pytest.mark.slow
async def test_a_menu_is_drawn_while_the_one_before_goes(screen):
    reader = screen.app.reader
    for menu in ("menu_go", "menu_edit"):  # which takes longer on a busy computer than until the next is drawn
        reader.open(menu)
        reader._timer.stop()
        reader.draw()
    await screen.until(lambda: "Divider: 1" in drawn(screen))
    await screen.press("escape", "space", "space", "e")
    await screen.until(lambda: drawn(screen).startswith("e  Edit: 2 marked elements"))
    await screen.press("escape", "m", "p")
    await screen.until(lambda: drawn(screen).startswith("p  Plots: /base/orientation_x  "))
    assert all(each in drawn(screen) for each in (" +  Zoom ", " -  Zoom out", " PgUp  Earlier", " PgDn  Later"))


@pytest.mark.slow
async def test_a_menu_that_waits_is_drawn_and_stays_at_an_unknown_letter(screen):
    await screen.press("e")
    await screen.until(lambda: drawn(screen))
    assert "Divider: 1" in drawn(screen)
    assert "(x) Discard: none waits" in drawn(screen)
    assert "( ) not now: type it for why" in drawn(screen)
    assert drawn(screen).startswith("e  Edit: /base/orientation  ")  # which it may cover
    await screen.press("k", shows="k is not in the menu")
    assert screen.session.rows.position == 0
    await screen.press("x", shows="none waits")
    assert drawn(screen)
    await screen.press("k", shows="k is not in the menu")
    await screen.press("escape")
    assert not drawn(screen)
    assert "in the menu" not in screen.text, "what was said of a letter goes with the menu"
    await screen.press("j")
    assert screen.session.rows.position == 1


@pytest.mark.slow
async def test_enter_plots_the_row_though_others_are_marked_and_all_where_it_is_one_of_them(screen, ran_s=12):
    await screen.press("space", "space", "enter", at="monitor")
    assert [each.element.name for each in screen.app.screen.stack.plots] == ["/log/base/velocity"] * 3
    await screen.press("escape", at="table")
    await screen.press("up", "enter", at="monitor")
    assert {each.element.name for each in screen.app.screen.stack.plots} == {
        "/log/base/orientation", "/log/base/position"
    }  # fmt: skip


async def test_the_key_that_folds_is_called_by_what_it_does_on_the_line_under_the_cursor(screen, size=(160, 50)):
    key, bar = key_of("fold"), lambda: screen.text.splitlines()[-1]
    for order, name, label in (
        (NAME, "imu/temperature", ""), (NAME, "base/position", "Entries"), (TREE, "imu/temperature", "Fold"),
        (TREE, "base/position", "Entries"),
    ):  # fmt: skip
        await screen.enter(f":sort {order}")
        await screen.enter(f":goto {name}")
        await screen.until(lambda name=name: screen.session.table.names[screen.session.rows.row].endswith(name))
        await screen.shows(f" {key} {label}") if label else await screen.settled()
        assert label or f" {key} " not in bar()
    await screen.do("fold", shows=f" {key} Fold ")


async def test_esc_that_has_nothing_to_leave_on_the_table_says_which_keys_lead_on(screen):
    await screen.press("escape")
    await screen.shows(f"nothing to leave here: {key_of('loggers')} the loggers, {key_of('quit')} quits")
    await screen.do("mark")
    await screen.settled()
    assert "nothing to leave" not in screen.text, "a key did something"
    await screen.press("escape")
    await screen.until(lambda: not screen.session.rows.marked_count)
    await screen.press("f9", shows="F9 is no key")
    await screen.press("j")
    await screen.settled()
    assert "F9 is no key" not in screen.text
    assert "nothing to leave" not in screen.text


async def test_enter_on_a_name_space_folds_it_and_on_a_row_plots_it(screen):
    await screen.press("o", "n", "g", "g", shows="Enter Fold")
    await screen.press("enter", shows="Enter Unfold")
    assert screen.session.rows.folded == {screen.session.rows.branch.path}
    await screen.press("enter", "j", "enter", at="monitor")


@pytest.mark.slow
async def test_an_entry_that_can_t_act_says_why(screen, read_only=True):
    await screen.press("e")
    await screen.until(lambda: drawn(screen))
    assert "(d) Divider: read-only" in drawn(screen)
    await screen.press("escape", "r")
    await screen.until(lambda: "Acknowledge" in drawn(screen))
    assert "(k) Acknowledge: alarms" in drawn(screen)
    await screen.press("k", shows="r k (Acknowledge): it is a key of alarms (g a)")
    assert drawn(screen)  # who reads may pick another one


@pytest.mark.slow
async def test_after_an_entry_that_was_typed_at_once_and_can_t_act_keys_are_those_of_the_screen(screen):
    await screen.press("r", "c", "j")
    assert screen.session.rows.position == 1
    await screen.press("r", "k", "j")
    assert screen.session.rows.position == 2
    await screen.shows("r k (Acknowledge): it is a key of alarms (g a)")


@pytest.mark.parametrize(
    ("letters", "scope", "says"),
    [("p z", "table", "it is a key of large plot (m, then Enter)"), ("r c", "monitor", "triggers (g t), table (g h)"),
     ("p z", "monitor", "large plot (Enter)"), ("e d", "triggers", "table (g h)"),
     ("e d", "file", "a saved file has no logger")],
)  # fmt: skip
def test_a_letter_that_has_no_use_here_says_where_it_has_one_and_how_one_gets_there(letters, scope, says):
    menu, letter = letters.split()
    opener = OPENERS[menu]
    assert says in where(in_menu(opener, scope)[letter], scope)[1]


@pytest.mark.parametrize(
    ("command", "scope", "says"),
    [
        ("list_mark", "table", ("triggers", "it is a key of triggers (g t), alarms (g a), parameters (g p) and "
         "others")),
        ("episode", "settings", ("table", "it is a key of table (g h), plots (g h, then m), large plot (g h, then m, "
         "then Enter) and others")),
        ("plot_conditions", "loggers", ("triggers", "it is a key of triggers, alarms, parameters")),
        ("fold", "loggers", ("table", "it is a key of table (g h)")),
        ("goto", "loggers", ("", "it is a key of ")),
    ],
)  # fmt: skip
def test_of_many_screens_with_a_use_for_a_key_three_are_named(command, scope, says):
    assert where([BY_ID[command]], scope) == says


@pytest.mark.slow
async def test_what_is_pasted_outside_a_line_is_left_out_whole(screen):
    screen.app.post_message(events.Paste("et"))
    await screen.shows("no keys")
    assert screen.session.table.pending_count == (0, 0)


@pytest.mark.slow
async def test_classic_has_the_same_menus_behind_one_key(fake, opened):
    async with opened(fake, settings=Settings(keymap="classic")) as screen:
        burst(screen, "backslash e t")
        await screen.until(lambda: screen.session.table.pending_count == (1, 1))
        assert screen.value(screen.session.table.names[screen.session.rows.row], Field.ENABLED) == "off"


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_menus_have_room_on_every_screen(screen, size):
    for letter in OPENERS:
        await screen.press(letter)
        await screen.until(lambda: drawn(screen))
        lines = drawn(screen).splitlines()
        assert len(lines) <= 8
        assert max(map(len, lines)) <= size[0] - 2
        await screen.press("escape")


# ------------------------------------------------------------------------------------------------------ the key bar


def bar(screen):
    return screen.text.splitlines()[-1]


async def test_the_bar_has_room_for_what_commands_the_logger_and_says_what_waits(screen, ran_s=12):
    assert bar(screen) == " space Mark m Plot / Filter e Edit g Go v View r Rec S Stop w Save ? Help q Quit"
    await screen.do("toggle")
    assert bar(screen) == " space Mark / Filter e Edit g Go a Apply 1 u Undo S Stop w Save    ? Help q Quit"
    await screen.do("down", "edit_divider", "5", "enter")
    assert "a Apply 2 u Undo S Stop" in bar(screen)
    await screen.do("undo", "undo")
    assert "Apply" not in bar(screen)


async def test_with_a_filter_the_bar_has_what_one_does_next_with_them(screen, ran_s=12):
    await screen.do("filter", "b", "enter")
    assert bar(screen).startswith(" / Filter Esc No filter * Mark all m Plot space Mark e Edit S Stop ")
    await screen.do("toggle")
    assert "* Mark all e Edit a Apply 1 " in bar(screen) and "u Undo S Stop" in bar(screen)
    await screen.do("mark_shown")
    assert bar(screen).startswith(" / Filter Esc No filter m Plot e Edit ") and "u Undo" in bar(screen)
    await screen.press("escape")
    assert bar(screen).startswith(" space Mark ")  # where it was: a second click is on it, too


async def test_the_bar_of_a_list_without_a_line_has_no_key_that_is_about_one(screen):
    for scope in ("alarms", "triggers", "recordings"):
        await screen.do(scope)
        await screen.until(lambda scope=scope: screen.app.screen.scope == scope, "the list")
        await screen.until(lambda: bar(screen).startswith((" r n New", " r r Record")), "its bar")
        assert not any(key in bar(screen) for key in ("Enter", "space", "o Order", "D Delete", "r t", "r k"))


async def test_the_bar_of_a_list_says_what_esc_takes_away_first(fake, opened):
    fake.limit_statuses = [HOT]
    async with opened(fake) as screen:
        for scope in ("alarms", "settings"):
            await screen.do(scope)
            await screen.until(lambda: "Esc Back" in bar(screen), "the list")
            assert ("D Delete" in bar(screen)) == (scope == "alarms")
            screen.app.screen.filter_by("e")
            await screen.until(lambda: "Esc No filter" in bar(screen), "its filter")
            await screen.press("escape")
            await screen.until(lambda: "Esc Back" in bar(screen), "all of it")
        await screen.press("escape")
        await screen.do("list_mark")
        await screen.until(lambda: "Esc Unmark" in bar(screen), "the mark")


async def test_enter_is_no_key_of_a_trigger_without_a_capture(fake, opened):
    fake.trigger_statuses = [FALL, replace(FALL, options=replace(FALL.options, name="last"), files=("/r/last_1.silo",))]
    async with opened(fake) as screen:
        await screen.do("triggers")
        await screen.until(lambda: "r t Arm/Off" in bar(screen) and "Open last" not in bar(screen), "its bar")
        assert "D Delete" in bar(screen)
        await screen.press("down")
        await screen.until(lambda: "Enter Open last" in bar(screen), "that of the other")
        assert "D Delete" in bar(screen)


async def test_the_bar_says_what_is_done_again_where_there_is_room(screen, size=(160, 50)):
    assert "again" not in bar(screen) and "S Start" in bar(screen)
    await screen.do("toggle")
    assert ". again: On/Off" in bar(screen)
    await screen.do("filter", *"nosuchelement", "enter")
    assert "again" not in bar(screen)  # there is nothing to do it with
    await screen.press("full_stop", shows=". (On/Off): no element is here")


async def test_the_bar_has_one_order_on_every_screen_and_no_menu_without_an_entry_there():
    use_keys("two-layer", {})
    places = {}
    for scope in SCOPES:
        keys = [command.footer_key for command, _ in keymap.in_bar(scope, read_only=False)]
        menus = {menu: key for key, menu in OPENERS.items()}
        assert len(set(keys)) == len(keys), scope
        for menu, key in menus.items():
            entries = [each for found in in_menu(menu, scope).values() for each in found]
            if key in keys and menu != "menu_go":
                assert any(scope in each.scopes for each in entries), (scope, key)
        places[scope] = [key for key in keys if key in (*OPENERS, "/", "S", "w", "a")]
    order = places["table"]
    assert all(
        [key for key in order if key in keys] == [key for key in keys if key in order] for keys in places.values()
    )


async def test_home_is_the_table_from_wherever_one_is(screen, ran_s=12):
    for steps in (
        ("monitor", "detail"),
        ("events",),
        ("triggers",),
        ("monitor", "alarms"),
        ("loggers",),
        ("loggers", "settings"),
    ):
        await screen.do(*steps)
        await screen.until(lambda: screen.app.screen.scope not in ("table", ""))
        await screen.do("go_home", at="table")


@pytest.mark.slow
async def test_applying_starting_and_stopping_ask_the_same_on_every_screen_of_a_logger_and_come_back_to_it(
    fake, screen, ran_s=20
):
    await screen.do("toggle")
    asked = {}
    ways = {each: [each] for each in ("monitor", "detail", "alarms", "parameters", "recordings", "events")}
    ways = {"table": [], **ways, "triggers": ["triggers"], "scope": ["go_home", "monitor", "catch"]}
    for scope, way in ways.items():
        await screen.do(*way)
        await screen.until(lambda scope=scope: screen.app.screen.scope == scope, scope)
        asked[scope] = []
        for command in ("start_stop", "restart", "apply"):
            await screen.do(command)
            await screen.until(lambda: isinstance(screen.app.screen, Question), command)
            await screen.until(lambda: screen.app.screen.is_mounted, "all that it asks")
            question = screen.app.screen.query("Static")
            asked[scope].append("\n".join(str(each.render()) for each in question))
            await screen.press("escape")
            await screen.until(lambda scope=scope: screen.app.screen.scope == scope, "the screen of before")
    assert "Stop logging?" in asked["table"][0]
    assert "Apply 1 edit" in asked["table"][2]
    in_table = {each: [one.replace(" in the table", "") for one in told] for each, told in asked.items()}
    assert all(told == asked["table"] for told in in_table.values()), in_table
    assert all("w in the table saves it" in told[0] for scope, told in asked.items() if scope != "table")
    await screen.do("apply", "enter")
    await screen.until(lambda: fake.calls, "the edits to be applied")
    await screen.until(lambda: screen.app.screen.scope == "scope", "the plot again")


async def test_stopping_offers_a_restart_and_what_drops_is_answered_by_its_own_letter(fake, screen, ran_s=20):
    await screen.do("start_stop", shows="Stop and save  (s)")
    await screen.press("r", shows="Restart logging?")
    await screen.press("d")
    assert fake.calls == []
    await screen.press("D")
    await screen.until(lambda: fake.calls, "the restart")


@pytest.mark.slow
async def test_what_has_a_form_or_a_list_is_asked_by_it_and_not_by_a_line(fake, screen):
    await screen.press("e", "a")
    await screen.shows("Limits of /base/orientation on")  # the row is the vector: of all its entries
    await screen.shows("HH")
    assert screen.app.screen.fields["signal"] == "base/orientation"
    await screen.press("4", "enter")
    await screen.until(lambda: not screen.app.screen.is_modal, "it is set")
    assert [call[1].name for call in fake.calls if call[0] == "set_limits"] == ["/log/base/orientation"]
    await screen.do("derive", shows="Derive a signal on robot")
    await screen.press("escape")
    await screen.do("theme", "1")
    await screen.until(lambda: screen.app.theme == "silo-16", "its colours")


@pytest.mark.slow
async def test_the_bar_of_a_list_names_what_it_is_for_where_its_key_is_in_a_menu(fake, opened):
    fake.trigger_statuses, fake.limit_statuses = [FALL], [HOT]
    async with opened(fake) as screen:
        for list_key, named in (("triggers", "r t Arm/Off r n New"), ("alarms", "r k Acknowledge r n New")):
            await screen.do(list_key)
            await screen.until(lambda scope=list_key: screen.app.screen.scope == scope, "the list")
            await screen.shows(named)


@pytest.mark.slow
async def test_ways_to_draw_are_one_menu_away_from_the_plots(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await screen.do("monitor", at="monitor")
        await screen.do("mode_spectrum", shows="SPECTRUM")
        await screen.do("mode_time")
        await screen.until(lambda: screen.app.screen.stack.display, "time again")


def test_the_bar_of_parameters_says_at_80_columns_what_turns_them():
    shown = sorted(keymap.in_bar("parameters", read_only=False), key=lambda each: -each[1])
    assert [command.id for command, _ in shown].index("turn_down") < 6


async def test_in_the_palette_what_is_called_so_comes_first_and_is_shown_at_once(screen, ran_s=12, size=(120, 40)):
    for name, keys in itertools.product(("histogram", "spectrum"), (["m", "ctrl+p"], ["ctrl+p"])):
        await screen.press(*keys)  # of the plots, of the table
        await screen.type(name)
        await screen.until(lambda name=name: name.title() in screen.text)
        found = screen.app.screen.query_one("CommandList")
        await screen.until(
            lambda found=found, name=name: (
                found.option_count and str(found.get_option_at_index(0).prompt).startswith(name.title())
            )
        )
        await screen.press("enter")
        await screen.until(lambda name=name: getattr(screen.app.screen, "mode", "") == name, name)
        assert screen.app.screen.scope == "detail"
        await screen.do("go_home", at="table")


async def test_the_bar_of_plots_says_how_to_go_back_and_later_only_where_there_is_something(fake, opened):
    def bar():
        return screen.text.splitlines()[-1]

    async with opened(fake.run(30), settings=Settings(keymap="two-layer"), size=(160, 40)) as screen:
        await screen.enter("/LF/HAA/torque", "enter")
        await screen.curves()
        await screen.until(lambda: "PgUp Earlier" in bar())
        await screen.press("plus", "plus")  # the fake holds ten seconds
        assert "Later" not in bar()
        assert "Newest" not in bar()
        await screen.press("pageup")
        await screen.until(lambda: "PgDn Later" in bar() and "End Newest" in bar())
        await screen.press("end")
        await screen.until(lambda: "Later" not in bar())
        assert "PgUp Earlier" in bar()
        await screen.press("home")
        await screen.until(lambda: "PgUp" not in bar() and "PgDn Later" in bar())
