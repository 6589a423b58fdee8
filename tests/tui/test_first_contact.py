"""What somebody meets who opens silo-tui for the first time, and types faster than it was thought."""

import threading

import msgspec
import pytest
from textual import events

from silo.core.elements import FileType, State
from silo.rpc.published import EventKind
from silo_tui.model.table.fields import Field
from silo_tui.settings.options import Settings
from silo_tui.widgets import messages
from tests.stand_ins.fake_logger import FakeClient
from tests.stand_ins.fake_signals import scalar
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

FIRST = "/log/base/orientation"


def burst(screen, *keys):
    """Keys in one piece, as a slow link or `tmux send-keys` brings them."""
    names = {" ": "space", "/": "slash", ":": "colon", "*": "asterisk"}
    for key in keys:
        char = key if len(key) == 1 else None
        screen.app.post_message(events.Key(names.get(key, key), char))


async def test_filters_corrections_and_keys_behind_them_are_taken_whole_where_they_come_in_one_piece(screen):
    await screen.press("slash")
    burst(screen, *"LF torque unit:Nm", "enter")
    await screen.shows("/LF torque unit:Nm: 3 of 72")
    burst(screen, *"/LFx", "backspace", *" torqe", "left", "u", "enter")
    await screen.shows("/LF torque: 3 of 72")
    burst(screen, *"/RF torque", "enter", "*")
    await screen.until(lambda: screen.session.rows.marked_count)
    assert screen.session.rows.marked_count == 3


async def test_the_save_dialog_is_walked_through_left_and_ticked_by_letters_that_are_letters_in_the_name(
    fake, screen, size=(100, 30)
):
    await screen.press("w", shows="nothing was logged yet, so there is nothing to save; S starts")
    fake.run()
    await screen.until(lambda: screen.session.running)
    await screen.press("w")
    await screen.shows(f"{fake.status().held_samples:,}".replace(",", " ") + " samples, 10 s at most")
    await screen.shows("> [x] silo")
    await screen.press("j", shows="> [ ] csv")
    seen = []
    for key in ("j", "j", "down", "down", "down"):
        await screen.press(key)
        seen.append(screen.app.focused.id)
    assert seen == ["type-bag", "form-name", "save-go", "save-no", "type-silo"]
    await screen.press("escape", shows="nothing was saved")
    await screen.press("w", "c", "s", "up", "up", "up", *"bcs", "enter")
    await screen.until(lambda: fake.calls)
    assert fake.calls == [("save", [FileType.CSV], "bcs")]


async def test_how_many_are_marked_is_said_at_once_and_stays_before_how_the_order_is_left(screen, ran_s=12):
    await screen.press(*"ov")
    await screen.enter("/LF torque")
    await screen.press("*", shows="marked all 3 that are shown")
    screen.app.screen.info.say("")  # it stood long enough
    assert "3 marked │ /LF torque: 3 of 72 │ by value ↓" in screen.app.screen.info.words().plain
    await screen.press("*", shows="unmarked all 3 that are shown")
    for unmark in ([*":unmark", "enter"], ["space"]):  # what was said is no longer so
        await screen.press("*")
        await screen.until(lambda: screen.session.rows.marked_count == 3)
        await screen.press(*unmark)
        await screen.until(lambda: "marked all" not in screen.text)


async def test_the_save_dialog_says_the_name_that_a_part_of_a_run_that_was_cut_gets(fake, opened):
    fake.run(20)
    fake.part = 2
    async with opened(fake, size=(80, 24)) as screen:
        await screen.press("w", "c", shows="robot_…_part2.silo, robot_…_part2.csv: ")
        await screen.shows("each part before it goes to")
        fake.part = 3
        await screen.press("up", "up", "up", *"runa.silo", shows="runa_part3.silo, runa_part3.csv: ")
        fake.part = 0
        await screen.press("backspace", shows="runa.sil.silo, runa.sil.csv: ")
        assert "each part" not in screen.text


async def test_a_name_that_can_be_no_file_is_said_at_once_and_stays_to_be_mended(fake, opened):
    fake.run(20)
    async with opened(fake) as screen:
        await screen.press("w", "up", "up", "up", "a", "/", "b", shows="contains '/'")
        await screen.press("enter", shows="contains '/'")
        assert not fake.calls
        await screen.press("left", "backspace", shows="ab.silo: ")
        await screen.press("enter", shows="o Opens it")
        assert fake.calls == [("save", [FileType.SILO], "ab")]


async def test_set_knows_the_words_of_the_shell_and_a_key_that_steps_goes_on_from_what_is_marked(screen):
    await screen.enter(":set divider=5 buffer=growing action=save size=10s off", shows="5 fields changed")
    row = screen.session.table.row(FIRST)
    assert list(screen.session.table.values[:, row]) == [0, 5, 1, 2, 800]
    await screen.press("space", "space")  # the cursor is on the third row now, which isn't marked
    values = []
    for letter in "fgl":
        await screen.do("next_buffer", letter)
        values.append(screen.value(FIRST, Field.BUFFER))
    assert values == ["fixed", "growing", "looping"]


@pytest.mark.parametrize("theme", ["dark", "16"])
async def test_without_many_colours_nothing_untyped_looks_as_if_it_were_typed(theme, fake, opened, monkeypatch):
    if theme == "dark":
        monkeypatch.setenv("NO_COLOR", "1")
    async with opened(fake.run(), settings=Settings(theme=theme)) as screen:
        await screen.do("save_data", shows="(empty: date, time and run number)")


@pytest.mark.parametrize("theme", ["NO_COLOR", "16", "dark", "light", "contrast"])
async def test_what_a_line_may_become_stands_in_brackets_with_the_key_that_takes_it(theme, fake, opened, monkeypatch):
    if theme == "NO_COLOR":
        monkeypatch.setenv("NO_COLOR", "1")
    async with opened(fake.run(), settings=Settings(theme="dark" if theme == "NO_COLOR" else theme)) as screen:
        await screen.type("/unit:N", shows="unit:N[m] Tab")
        assert "unit:Nm" not in screen.text
        await screen.press("tab", shows="unit:Nm")
        assert "] Tab" not in screen.text


async def test_for_one_logger_alone_no_list_is_made(fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.commands.opening.AT_ONCE_S", DEADLINE_S)  # a busy machine takes longer
    monkeypatch.setattr("silo_tui.commands.opening.Opener._list", lambda *_: pytest.fail("a list was made"))
    async with opened(fake) as screen:
        assert screen.app.screen.scope == "table"


async def test_of_two_loggers_of_one_name_those_two_are_offered(new_fake, opened):
    fakes = [new_fake(name="arm"), new_fake(name="legs"), new_fake(name="legs")]
    fakes[2].pid = 4712
    async with opened(*fakes, name="legs", ready=False) as screen:
        await screen.shows("2 loggers are called 'legs'")
        await screen.shows("legs.4712")
        assert "pid 4711" in screen.text
        assert " arm " not in screen.text


async def test_a_logger_is_named_with_its_pid(new_fake, opened):
    one, two = new_fake(name="legs"), new_fake(name="legs")
    two.pid = 4712
    async with opened(one, two, name="legs.4712") as screen:
        await screen.until(lambda: screen.session.status.pid == 4712)


async def test_a_narrow_screen_leaves_columns_out_and_cuts_no_number(new_fake, robot, opened):
    long = msgspec.structs.replace(robot[0], options=msgspec.structs.replace(robot[0].options, size=30000))
    async with opened(new_fake([long]), size=(60, 24)) as screen:
        await screen.shows(" 30000 ")
        await screen.shows(" size ")
        assert " buf " not in screen.text
        assert "/base/position" in screen.text


async def test_a_field_that_is_not_shown_can_be_edited_all_the_same(screen, size=(40, 24)):
    await screen.do("edit_size", *"77", "enter", "next_buffer", "f")
    assert screen.value(FIRST, Field.SIZE) == "77"
    assert screen.value(FIRST, Field.BUFFER) == "fixed"


async def test_without_a_link_no_dialog_opens(fake, screen, ran_s=12):
    await screen.do("toggle")
    fake.cut()
    await screen.shows("NO LINK")
    for key in "SRwaLW":
        screen.app.screen.say("")
        assert "no link to robot;" not in screen.text
        await screen.press(key, shows="no link to robot; r tries now")
        assert not screen.app.screen.is_modal


async def test_r_tries_the_link_now_and_the_head_says_since_when_and_what_it_was(fake, screen, ran_s=12):
    scopes = {"": "table", "m": "monitor", "E": "events", "A": "alarms", "T": "triggers", "F": "recordings"}
    for to, scope in scopes.items():
        await screen.press(*to)
        await screen.until(lambda scope=scope: screen.app.screen.scope == scope, scope)
        fake.cut()
        await screen.shows("~ NO LINK")
        screen.session.lost_since -= 3 * 3600
        await screen.shows("~ NO LINK 3 h, was RUNNING")
        await screen.shows("r tries now")
        await screen.shows(" r Try now")
        await screen.press("r", shows="trying now")
        assert fake.calls.pop() == ("try_now",)
        fake.mend()
        await screen.until(lambda: screen.session.connected and "NO LINK" not in screen.text, "the link")
        await screen.press("escape", at="table")


async def test_after_an_apply_fill_counts_against_the_buffers_of_the_recording(fake, opened):
    fake.run()
    fake.state = State.STOPPED
    fake.saved = True
    async with opened(fake, size=(120, 24)) as screen:
        await screen.shows("100%")
        await screen.do("edit_size", *"40k", "enter", "a", "enter", shows="applied to 1 element")
        await screen.shows("40000 100%")
        await screen.press("S", shows="40000   0%")


async def test_edits_of_marked_rows_say_that_they_are_not_of_the_row_under_the_cursor(screen, size=(120, 24)):
    await screen.do("mark", "mark", "next_buffer", shows="buffer of 2 marked elements, not of velocity")
    await screen.press("escape")
    await screen.until(lambda: not screen.app.screen.is_modal)
    await screen.do("edit_divider", shows="divider of 2 marked elements, not of velocity")
    await screen.press("7", "enter", shows="divider: 2 changed")


async def test_an_open_editor_says_what_to_type_which_keys_count_and_whole_what_is_wrong(screen):
    await screen.do("asterisk", "toggle", "edit_size")
    await screen.shows("size of 72 marked elements, now 4000, 100, e.g. 1000 10k 10s *2 /2 +10")
    await screen.shows("Enter sets it")
    assert "│ 72 marked" not in screen.text
    await screen.press("escape", shows="space Mark")
    await screen.shows("72 marked")
    await screen.do("edit_size", *"abc", "enter")
    await screen.shows("? size must be 1 to 2147483647, 10k, 10s, *2, /2 or +10, got abc")
    await screen.press(*["backspace"] * 3, "9", "enter")
    assert screen.value(FIRST, Field.SIZE) == "9"


async def test_a_logger_that_is_back_and_slow_to_answer_is_asked_once_until_it_has_answered(fake, screen, ran_s=12):
    fake.cut()
    await screen.shows("~ NO LINK")
    answers, asked, hello = threading.Event(), [], fake._hello

    def slow_hello():
        asked.append(len(asked))
        assert answers.wait(DEADLINE_S)
        return hello()

    fake._hello = slow_hello
    fake.mend()
    await screen.until(lambda: asked)
    for _ in range(5):
        screen.app._second()
        await screen.pilot.pause()
    answers.set()
    await screen.until(lambda: screen.session.connected)
    await screen.until(lambda: all(one.is_finished for one in screen.app.workers if one.group == "regain"))
    assert asked == [0]


async def test_a_logger_without_elements_and_no_logger_at_all_say_what_to_write_into_the_program(opened):
    empty = FakeClient([])
    async with opened(empty, ready=False) as screen:
        await screen.shows("robot has no elements yet")
        await screen.shows('q = log.array("q", 6, unit="rad")')
        await screen.shows("log.collect()")
        empty.elements = [scalar("/log/base/tilt")]
        empty.somebody_edits("/log/base/tilt", divider=2)
        await screen.shows("tilt")
        assert "has no elements" not in screen.text
    async with opened(ready=False) as screen:
        await screen.shows('log = silo.Logger("arm", frequency=500)')
        await screen.shows("log.serve()")


@pytest.mark.parametrize("keys", [(), ("m",), ("T",), ("m", "enter", "c")])
async def test_news_of_the_robot_and_the_answer_to_a_key_have_a_line_each(fake, opened, monkeypatch, keys):
    monkeypatch.setattr(messages, "READ_S", 3600.0)
    async with opened(fake.run(), size=(120, 30)) as screen:
        await screen.press(*keys)
        screen.app.context.upper_screen.say("an answer to a key")
        fake.publish(EventKind.BLIND, "gripper is blind", by="bob@lab")
        fake.somebody_edits(FIRST, divider=7)
        await screen.until(lambda: 7 in screen.session.table.server[Field.DIVIDER], "the edit of somebody else")
        await screen.shows("edited (bob@lab) (1 more: :messages)")
        assert "an answer to a key" in screen.text
        await screen.press("backslash", "escape")
        assert "bob@lab" in screen.text  # it may not have been read yet
        monkeypatch.setattr(messages, "READ_S", 0.0)
        await screen.press("backslash", "escape")
        await screen.until(lambda: "bob@lab" not in screen.text and "an answer to a key" not in screen.text)


async def test_what_one_trigger_tells_again_counts_up_in_its_place_and_hides_nothing_of_another(
    fake, screen, ran_s=12, size=(120, 30)
):
    for about, tick in (("hot", 1), ("fall", 2), ("hot", 3), ("hot", 4)):
        fake.publish(EventKind.TRIGGERED, f"trigger '{about}' fired at tick {tick}", about=about)
    await screen.shows("trigger 'fall' fired at tick 2 (1 more: :messages)")
    for number in (1, 2):
        fake.publish(EventKind.CAPTURED, f"capture {number} of 'hot' saved", about="hot")
    await screen.shows("capture 2 of 'hot' saved (2 ×) (2 more: :messages)")


LONG = " ".join(f"word{number}" for number in range(30))


async def test_news_and_an_answer_take_three_rows_at_most_and_say_where_the_rest_is(screen, ran_s=12):
    screen.app.context.hear(LONG)
    screen.app.context.say(LONG)
    await screen.until(lambda: screen.text.count("… (:messages)") == 2, "the beginning of both")
    assert screen.app.screen.info.size.height == 3


@pytest.mark.parametrize("keys", [(), ("m",), ("T",)])
async def test_a_long_answer_wraps_and_stays_among_all_that_was_said(screen, keys, ran_s=12):
    await screen.press(*keys)
    screen.app.context.say(LONG)
    await screen.shows("word29")
    screen.app.context.hear("the gripper is blind")
    await screen.shows("‣ ")
    screen.app.context.say("short")
    await screen.until(lambda: "word29" not in screen.text)
    screen.app.command_messages()
    await screen.shows("robot  the gripper is blind")
    await screen.press("j", "j", shows="word29")
    await screen.press("escape")
    await screen.until(lambda: screen.app.screen.scope != "messages")
