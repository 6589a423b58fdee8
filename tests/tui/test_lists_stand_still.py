"""New lines never move what is under the cursor, in any list; keys typed before a list is there are for it."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus, TriggerWord
from silo.core.conditions import TriggerOptions
from silo.core.elements import LoggedEvent
from silo.core.tuning.parameters import ParameterInfo, ParameterKind
from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from silo.recordings.requests import SavedRecording
from silo.run_index.facts import RunFacts
from silo.run_index.listed import ListedRun
from silo_tui.actions import COMMANDS
from silo_tui.context import Message
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.screens.lists.alarms import AlarmsScreen
from silo_tui.screens.lists.events import EventsScreen
from silo_tui.screens.lists.loggers import LoggersScreen
from silo_tui.screens.lists.messages import MessagesScreen
from silo_tui.screens.lists.parameters import ParametersScreen
from silo_tui.screens.lists.recordings import RecordingsScreen
from silo_tui.screens.lists.runs import RunsScreen
from silo_tui.screens.lists.triggers import TriggersScreen
from tests.tui.test_typed_early import burst

pytestmark = pytest.mark.slow  # each walks through the whole app

S_NS = 10**9
Y_NS = 1_790_000_000 * S_NS


def trigger(at):
    return TriggerStatus(TriggerOptions(f"t{at}", "x > 1"), TriggerWord.ARMED, fires=at, last_ns=at)


def limit(at):
    return LimitStatus(f"/log/x{at}", f"x{at}", LimitWord.RED_HIGH, "", 2.0, 1.0, at, count=at, since_ns=at)


def logger(at):
    return FoundLogger(f"robot{at}", at, "", f"k{at}", Member(LoggerAddress(f"robot{at}", at, f"k{at}", "")))


# of each list: how it is made, a line of a number (larger: newer), what is typed to go there
LISTS = {
    EventsScreen: (EventsScreen, lambda at: LoggedEvent("mark", f"m{at}", at * S_NS, at, number=at), "g e"),
    TriggersScreen: (TriggersScreen, trigger, "g t"),
    AlarmsScreen: (AlarmsScreen, limit, "g a"),
    ParametersScreen: (ParametersScreen, lambda at: ParameterInfo(f"p{at}", ParameterKind.FLOAT, 1.0), "g p"),
    RecordingsScreen: (RecordingsScreen, lambda at: SavedRecording(f"r{at:05}", [], Y_NS + at, at, f"why {at}"), "g r"),
    RunsScreen: (
        lambda session: RunsScreen("runs"),
        lambda at: ListedRun(RunFacts(f"r{at}.silo", begun_ns=at * S_NS, span_s=at), Path("runs")),
        "f3",
    ),
    MessagesScreen: (lambda session: MessagesScreen(), lambda at: Message(at, f"said {at}", at % 2 == 0), "g m"),
    LoggersScreen: (
        lambda session: LoggersScreen(lambda one: None),
        logger,
        "g l",
    ),
}  # fmt: skip


def test_each_list_whose_lines_come_and_go_has_its_case():
    marked = next(each for each in COMMANDS if each.id == "list_down").scopes
    assert {kind.scope for kind in LISTS} == set(marked) - {
        "settings",
        "file_events",
        "comparison",
    }  # whose lines never change


async def test_new_lines_never_move_what_is_under_the_cursor(screen, monkeypatch):
    for kind, (make, line, _) in LISTS.items():
        there = list(range(100, 200, 2))
        monkeypatch.setattr(kind, "all", property(lambda self, line=line, there=there: [line(at) for at in there]))
        shown = make(screen.session)
        screen.app.push_screen(shown)
        await screen.until(lambda shown=shown: shown.is_there and len(shown.shown) == 50, "the lines")
        for order in shown.orders:
            shown._by(order.name)
            shown.move(20)
            await screen.pilot.pause()
            key, row = shown.chosen_key, shown.lines.highlighted - shown.lines.scroll_offset.y
            for new in ([90, 92], [300, 302], [121, 141, 161]):
                there[:] = sorted({*there, *new})
                shown.show()
                await screen.pilot.pause()
                now = shown.chosen_key, shown.lines.highlighted - shown.lines.scroll_offset.y
                assert now == (key, row), (kind, order)
            there[:] = range(100, 200, 2)
            shown.show()
        await screen.leave()


async def test_keys_typed_before_a_list_is_there_move_in_it_and_not_below(screen, monkeypatch):
    for kind, (_, line, keys) in LISTS.items():
        monkeypatch.setattr(kind, "all", property(lambda self, line=line: [line(at) for at in range(100, 150)]))
        burst(screen, f"{keys} down down")
        await screen.until(lambda kind=kind: type(screen.app.screen) is kind and screen.app.gate.free, "the list")
        await screen.until(lambda: screen.app.screen.lines.highlighted == 2, f"the third line of {kind}")
        assert screen.session.rows.position == 0, kind
        await screen.do("go_home", at="table")


async def test_lines_stand_as_they_were_seen_whatever_becomes_of_them(fake, opened, monkeypatch):
    """The next line is the one that a person saw below the cursor, until that person has them ordered anew."""
    over = {at: limit(at) for at in (1, 2, 3)}
    quiet = replace(limit(4), word=LimitWord.OK, count=0)
    there = [*over.values(), quiet]
    monkeypatch.setattr(AlarmsScreen, "all", property(lambda self: there))
    async with opened(fake) as screen:
        shown = AlarmsScreen(screen.session)
        screen.app.push_screen(shown)
        await screen.until(lambda: shown.is_there and len(shown.shown) == 4, "the lines")
        there[:] = [over[3], over[1], over[2], quiet]  # the worst first, which is another one now
        shown.show()
        assert shown.shown_keys == ["/log/x1", "/log/x2", "/log/x3", "/log/x4"]
        await screen.shows("^l orders anew")
        there[:] = [
            limit(4),
            limit(5),
            over[3],
            over[1],
            over[2],
        ]  # one that was always within its limits, and a new one
        shown.show()
        assert shown.shown_keys == ["/log/x4", "/log/x5", "/log/x1", "/log/x2", "/log/x3"]
        await screen.press("ctrl+l")
        await screen.until(lambda: shown.shown_keys[2] == "/log/x3", "the list, read again")
        there[:] = there[::-1]
        shown.show()
        assert shown.shown_keys[0] == "/log/x4"
        shown.filter_by("x")
        assert shown.shown_keys[0] == "/log/x2"


async def test_the_key_that_orders_loggers_anew_is_named(screen):
    await screen.do("loggers", at="loggers")
    screen.app.screen._stands_otherwise = True
    screen.app.screen.show_words()
    await screen.shows("^l orders anew")
