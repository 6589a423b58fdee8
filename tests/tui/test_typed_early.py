"""Keys typed before what they are meant for is there: they go there, or nowhere."""

import asyncio
import threading

import pytest
from textual import events

from silo_tui.gate import Holding
from silo_tui.model.table.fields import Field
from silo_tui.screens.dialogs.questions import Prompt, Question
from tests.tui.conftest import character_of
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app


def burst(screen, keys):
    for key in keys.split():
        screen.app.post_message(events.Key(key, character_of(key)))


@pytest.fixture(params=[Question, Prompt])
def slow_to_mount(request, monkeypatch):
    """Lets a kind of dialog be made only when a test says so."""
    may_mount, begun = asyncio.Event(), asyncio.Event()
    mount = request.param.on_mount if "on_mount" in vars(request.param) else None

    async def late(dialog):
        begun.set()
        await may_mount.wait()
        if mount is not None:
            mount(dialog)

    monkeypatch.setattr(request.param, "on_mount", late, raising=False)
    return request.param, may_mount, begun


async def test_an_answer_typed_before_its_dialog_is_made_is_for_the_dialog(slow_to_mount, fake, opened):
    kind, may_mount, begun = slow_to_mount
    async with opened(fake) as screen:
        burst(screen, "e d 5 enter" if kind is Question else "M h i enter")
        await begun.wait()
        assert not screen.app.gate.free
        may_mount.set()
        if kind is Question:
            await screen.until(lambda: screen.value("/log/base/orientation", Field.DIVIDER) == "5")
        else:
            await screen.until(lambda: any(call[0] == "mark" and "hi" in str(call) for call in fake.calls))


async def test_who_spells_out_what_one_letter_chose_gives_no_commands_by_the_rest(screen):
    burst(screen, "o v a l u e")
    await screen.shows("e: left out, v alone chose it")
    assert screen.session.rows.sort == "value"
    assert screen.app.screen.scope == "table"
    burst(screen, "o c o d o n t")  # neither a box that is opened again nor what spells nothing is left out
    await screen.until(lambda: screen.value("/log/base/orientation", Field.ENABLED) == "off")
    assert screen.session.rows.sort == "tree"


async def test_a_word_typed_after_a_while_is_commands(screen):
    for at_s, key in enumerate("odi"):
        typed = events.Key(key, key)
        typed.time = float(at_s)
        screen.app.post_message(typed)
    await screen.until(lambda: screen.session.rows.sort == "div")
    await screen.until(lambda: screen.app.screen.inspector_wanted, "i was a command")


async def test_a_question_that_loses_something_takes_no_answer_from_before(fake, screen, ran_s=20):
    burst(screen, "t a D")
    await screen.until(lambda: isinstance(screen.app.screen, Question), "the question")
    await screen.shows("were dropped")
    await screen.until(lambda: screen.app.gate.free)
    assert isinstance(screen.app.screen, Question)
    assert not any(call[0] == "apply" for call in fake.calls)
    await screen.press("D")
    await screen.until(lambda: any(call[0] == "apply" for call in fake.calls))


@pytest.mark.parametrize("slow_to_mount", [Question], indirect=True)
@pytest.mark.parametrize(("keys", "done"), [("t a enter", ["cut"]), ("t a j enter", []), ("t a D enter", [])])
async def test_enter_may_come_early_where_it_loses_nothing_unless_it_was_meant_for_another_choice(
    keys, done, slow_to_mount, fake, opened
):
    _, may_mount, begun = slow_to_mount
    async with opened(fake.run(20)) as screen:
        burst(screen, keys)
        await begun.wait()
        may_mount.set()
        await screen.until(lambda: screen.app.gate.free)
        await screen.shows("it goes on" if done else "were dropped")
        assert [call[0] for call in fake.calls if call[0] in ("cut", "apply")] == done


async def test_a_key_typed_early_over_a_question_without_an_answer_is_no_mistake(fake, opened):
    fake.files.clear()
    async with opened(fake) as screen:
        burst(screen, "L enter")
        await screen.until(lambda: isinstance(screen.app.screen, Question), "the list of scripts")
        await screen.until(lambda: screen.app.gate.free)
        assert "mistake" not in screen.text


async def test_what_loses_nothing_may_be_answered_blind(fake, screen, ran_s=20):
    burst(screen, "S y")
    await screen.until(lambda: any(call[0] == "stop" for call in fake.calls))


async def test_esc_lets_go_what_never_comes(fake, opened):
    async def never():
        await asyncio.Event().wait()

    async with opened(fake) as screen:
        screen.app.context.run_flow(never())
        await screen.until(lambda: isinstance(screen.app.screen, Holding))
        burst(screen, "j j y escape")
        await screen.until(lambda: not isinstance(screen.app.screen, Holding) and screen.app.gate.free)
        assert screen.session.rows.position == 0
        await screen.press("j")
        assert screen.session.rows.position == 1
        screen.app.workers.cancel_group(screen.app, "flow")


async def test_what_is_typed_while_an_answer_is_awaited_is_for_the_dialog_it_brings(fake, opened, monkeypatch):
    answered, scripts = threading.Event(), fake.scripts
    monkeypatch.setattr(fake, "scripts", lambda: answered.wait(DEADLINE_S) and scripts())
    async with opened(fake) as screen:
        burst(screen, "L")
        await screen.until(lambda: isinstance(screen.app.screen, Holding))
        burst(screen, "x t u enter")  # the first is no letter of it, nor what goes on behind it
        await screen.pilot.pause()
        assert isinstance(screen.app.screen, Holding)
        assert not screen.app.gate.free
        answered.set()
        await screen.until(lambda: screen.app.gate.free)
        await screen.shows("nothing to load")  # Enter, in the list of scripts
        assert screen.session.table.pending_count == (0, 0)
        assert screen.session.rows.position == 0
