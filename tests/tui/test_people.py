"""Who did what, who is connected, who has control: as the screens tell it."""

import time

from silo.core.elements import Present
from silo.core.quantities.writing import since_text, wall_clock
from silo_tui.model.words.people import head_words, people_words


async def test_the_head_says_who_else_has_control_and_how_many_are_there(fake, opened):
    fake.clients = [
        Present("anna (proven) from desk2, silo-tui 2", 1, "anna"),
        Present("me@here silo-tui 1", 2, "@local me"),
    ]
    async with opened(fake, size=(160, 50)) as screen:
        fake.somebody_takes_control("anna")
        await screen.shows("anna has control")
        await screen.shows("1 other client")
        await screen.shows("control taken (anna (proven) from desk2, silo-tui 2)")


async def test_control_that_is_handed_to_us_is_renewed_from_then_on(fake, screen):
    fake._controlled_by("me@here silo-tui 1", "@local me")
    fake.publish(fake.kinds.CONTROL, "control given to me@here silo-tui 1", by="anna (proven) from desk2, silo-tui 2")
    await screen.until(lambda: ("take_control", False) in fake.calls)


async def test_events_say_whether_a_name_is_proven(fake, opened):
    fake.happen("stopped", "stopped", fake.now_ns, who="anna (proven) from desk2, silo-tui 2")
    fake.happen("started", "started", fake.now_ns, who="bob (says so) from desk3, silo 3")
    async with opened(fake, size=(100, 30)) as screen:
        await screen.do("events", shows="anna (proven)")
        await screen.shows("bob (says so)")


def test_words_of_who_is_there(fake):
    fake.clients = [Present("anna (proven) from desk2, silo-tui 2", 1, "anna"), Present("bob@desk3 silo 3", 2)]
    told = people_words(fake.status(), "anna", "anna@desk2 silo-tui 2")
    assert told == "nobody has control; connected: anna (proven) (this one), bob@desk3 looks"
    assert head_words(fake.status(), "anna", "anna@desk2 silo-tui 2") == ("", "1 other client")


def test_two_programs_of_one_user_are_told_apart(fake):
    one, other = "root@vm silo-tui 7", "root@vm silo-tui 8"
    fake.clients = [Present(one, 1, "@local root"), Present(other, 1, "@local root")]
    assert people_words(fake.status(), "@local root", one).endswith(f"connected: {one} (this one), {other}")
    fake._controlled_by(other, "@local root")
    assert head_words(fake.status(), "@local root", one)[0] == "you have control in silo-tui 8"
    assert head_words(fake.status(), "@local root", other)[0] == "you have control"
    assert f"{other} has control since" in (told := people_words(fake.status(), "@local root", one))
    assert ", and you with it, as the same user; connected" in told


async def test_control_is_given_to_who_is_connected_tab_names_them_and_a_word_that_is_none_is_told(fake, opened):
    fake.clients = [
        Present("anna (proven) from desk2, silo-tui 2", 1, "anna"),
        Present("me@here silo-tui 1", 2, "@local me"),
        Present("bob@desk3 silo 3", 3),
    ]
    async with opened(fake) as screen:
        complete = screen.app.context.runner.complete
        assert complete(":control give ") == ["control give anna", "control give me"]
        assert complete(":control give a") == ["control give anna"]
        assert complete(":control take ") == []
        assert complete(":control g") == ["control give"]
        await screen.do("control", shows=":control give NAME hands it over (anna")
        await screen.press("t", shows="you have control")
        await screen.enter(":control tkae", shows="control: there is no 'tkae'; did you mean 'take'?")
        assert not list(screen.app._notifications), "they lie over what was answered"


def test_since_when_something_is_so_is_told_by_the_clock_with_the_date_of_another_day():
    now_ns = time.time_ns()
    assert since_text(now_ns) == wall_clock(now_ns)
    assert since_text(now_ns - 3 * 86_400 * 10**9) == wall_clock(now_ns - 3 * 86_400 * 10**9, date=True)
