"""The list of loggers: how each stands, the worst first, and what is asked of many at once."""

from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from silo.core.elements import State
from silo.errors import RefusedError
from silo.fleet.member import Member, Stands
from silo.net.found import LoggerAddress
from silo.rpc.published import Summary
from silo_tui.model.lists import fleet
from silo_tui.model.lists.ordering import arranged
from silo_tui.screens.lists.loggers import LoggersScreen
from silo_tui.sessions.live import NO_STATUS


class Listed(LoggersScreen):
    """Beside a logger that is open."""

    context: Any = None


NOW_S, NOW_NS = 1000.0, 1_790_000_400 * 10**9
FINE = Summary(
    state=State.RUNNING, frequency_hz=400.0, measured_hz=400.0, ticks=118_024, started_ns=NOW_NS - 330 * 10**9,
    saved=False, disk_free_bytes=40 * 10**9, disk_bytes=256 * 10**9, clients=["ann@desk silo-tui 7", "ann@desk silo 8"],
)  # fmt: skip


UNKNOWN = Member(LoggerAddress("x", 0, "", ""))


def member(name: str = "anymal", host: str = "rob3", *, here: bool = True, since_s: float = 0.0, **told) -> Member:
    found = LoggerAddress(name, 0, "", "", "lab", host, id="aaaa000001")
    return Member(found, msgspec.structs.replace(FINE, **told), here, since_s=since_s, seen_s=since_s)


def line(one: Member, answer: str = "") -> fleet.FoundLogger:
    found = one.found
    return fleet.FoundLogger(found.name, 0, "", one.key, one, host=found.host, addresses=("lab",), answer=answer)


def shown(one: Member, width: int = 80, answer: str = "") -> str:
    return fleet.row(line(one, answer), 16, width, NOW_S, NOW_NS)


# ------------------------------------------------------------------------------------------------------------- words


@pytest.mark.parametrize(
    ("one", "stands", "sign"),
    [
        (member(), Stands.FINE, ""),
        (member(state=State.STOPPED), Stands.FINE, ""),
        (member(lost=3), Stands.LOST, "XX"),
        (member(measured_hz=300.0), Stands.SLOW, "<<"),
        (member(measured_hz=0.5), Stands.SLOW, "<<"),
        (member(measured_hz=380.0), Stands.FINE, ""),  # 95 % of what it is to be
        (member(measured_hz=0.0), Stands.FINE, ""),  # not measured yet
        (member(alarm="H", alarms=2), Stands.YELLOW, "H"),
        (member(disk_free_bytes=10**9), Stands.FULL, "##"),
        (member(disk_free_bytes=5, disk_bytes=100), Stands.FULL, "##"),
        (member(disk_free_bytes=6, disk_bytes=100), Stands.FINE, ""),
        (member(alarm="LL", alarms=1, lost=3, measured_hz=300.0), Stands.RED, "LL"),
        (member(here=False), Stands.SILENT, "~~"),
        (member(state=State.DEAD), Stands.DEAD, ""),
        (member(state=State.DEAD, here=False), Stands.DEAD, ""),
        (member(here=False, closed=True), Stands.CLOSED, ""),
        (Member(LoggerAddress("x", 0, "", ""), problem="no answer"), Stands.MUTE, "~~"),
    ],
)
def test_the_worst_of_a_logger_is_its_sign(one, stands, sign) -> None:
    assert (one.stands, one.sign) == (stands, sign)


def test_the_worst_stands_first_and_equals_by_name() -> None:
    found = [member("b"), member("a"), member("c", lost=1), member("d", here=False), member("e", state=State.DEAD)]
    ordered = arranged(map(line, found), fleet.ORDERS[0], turned=False)
    assert [one.member.found.name for one in ordered] == ["e", "d", "c", "a", "b"]


def test_a_line_says_state_time_rate_losses_disk_alarms_and_who_is_there() -> None:
    words = shown(member(alarm="HH", alarms=3, lost=12)).split()
    assert words == ["rob3/anymal", "●", "RUNNING", "05:30", "400.0", "12", "84%", "HH", "3", "now", "ann@desk"]
    assert "84% 40 GB" in shown(member(), width=160)


def test_there_is_a_rate_of_what_runs_alone_and_the_room_that_is_left_where_lines_are_wide() -> None:
    assert "400.0" not in shown(member(state=State.STOPPED))
    assert ["GB" in shown(member(), width=width) for width in (109, 110)] == [False, True]


def test_a_total_says_how_many_are_in_which_state_as_far_as_it_is_known() -> None:
    lines = [line(member("a")), line(member("b")), line(member("c", state=State.STOPPED)), line(UNKNOWN)]
    assert fleet.total(lines) == "4 loggers: 2 running, 1 stopped"
    assert fleet.total(lines[3:]) == "1 logger"


@pytest.mark.parametrize(
    ("one", "unsaved", "says"),
    [
        (member(), True, []),
        (member(saved=True), False, []),
        (member(ticks=0), False, []),
        (member(state=State.STOPPED, reason="by ann"), True, ["by ann"]),
        (member(here=False), True, ["silent since ", "118 024 ticks, not saved"]),
        (member(measured_hz=300.0), True, ["slow: 300 of 400 Hz"]),  # the sign of its column in words
        (member(lost=3), True, ["ticks were lost"]),
        (member(alarm="LL", alarms=2), True, ["LL 2 alarms: a value is below its red limit"]),
        (member(alarm="==", alarms=1), True, ["1 alarm: a value is frozen"]),
        (member(alarm="H", alarms=1), True, ["H 1 alarm: a value is above its yellow limit"]),
    ],
)
def test_below_the_list_stands_what_its_columns_do_not_say(one, unsaved, says) -> None:
    assert fleet.is_unsaved(line(one)) is unsaved
    words = fleet.details(line(one)).split(" │ ")
    told = [word for word in words if word not in ("rob3/anymal: lab", "40 GB of 256 GB free")]
    assert len(words) == len(told) + 2
    assert all(word.startswith(begin) for word, begin in zip(told, says, strict=True))


def test_the_fastest_stands_first_and_what_is_gone_or_unknown_has_no_rate() -> None:
    found = [member("gone", here=False), member("slow", measured_hz=100.0), UNKNOWN, member("fast")]
    by_rate = next(order for order in fleet.ORDERS if order.name == "rate")
    names = [one.member.found.name for one in arranged(map(line, found), by_rate, turned=False)]
    assert names[:2] == ["fast", "slow"]


def test_what_was_denied_stands_in_the_line_and_below() -> None:
    assert "DENIED 3" in shown(member(denied=3), width=160)
    assert "3 denied within the last hour" in fleet.details(line(member(denied=3)))
    assert "enied" not in fleet.details(line(member()))


def test_one_that_is_gone_says_since_when_and_keeps_what_was_known() -> None:
    words = shown(member(here=False, since_s=NOW_S - 14)).split()
    assert words == ["rob3/anymal", "○", "SILENT", "was", "●", "400.0", "0", "84%", "old", "14", "s"]


def test_who_has_control_stands_first() -> None:
    one = member(clients=["ann@desk silo-tui 7", "bob@lab silo 8"], control="bob@lab silo 8")
    assert one.people == ["bob@lab*", "ann@desk"]


@pytest.mark.parametrize("width", [80, 120, 160])
def test_a_line_fits_its_screen_and_its_columns_stand_below_their_heads(width) -> None:
    lines = [line(member(clients=[])), line(member(host="a-robot-with-a-very-long-name-of-its-own"))]
    names = fleet.name_width(lines, width)
    head = fleet.head(names, width)
    row = fleet.row(lines[0], names, width, NOW_S, NOW_NS)
    assert len(row.rstrip()) <= width
    for title, value in (("state", "●"), ("lost", "0"), ("seen", "now")):
        begin, end = head.index(title), head.index(title) + len(title)
        assert value in row[begin - 3 : end + 3], title
    alike = line(member(host="a-robot-with-a-very-long-name-of-its-very-own"))
    addresses = tuple(each.address for each in (*lines, alike))
    shown = [fleet.row(each, names, width, NOW_S, NOW_NS, addresses)[: 2 + names] for each in (lines[1], alike)]
    assert len(set(shown)) == 2


def test_a_question_names_each_with_what_it_has_not_saved() -> None:
    words = fleet.asked_line(line(member()), NOW_NS)
    assert words.split() == ["rob3/anymal", "running", "05:30,", "118", "024", "ticks", "not", "saved"]
    assert fleet.asked_line(line(member(here=False)), NOW_NS).endswith(": left alone")


# ------------------------------------------------------------------------------------------------------------ screen


@pytest.fixture
def robots(new_fake, new_finder, monkeypatch):
    """Three loggers, with how they stand."""
    monkeypatch.setattr("silo_tui.screens.lists.loggers.time.time_ns", lambda: NOW_NS)
    fakes = [new_fake(name=name) for name in ("arm", "base", "legs")]
    monkeypatch.setattr(new_finder, "find", _with_members(new_finder.find))
    return fakes


def _with_members(find):
    def found(self):
        for client in self.clients:
            self.members.setdefault(
                client.name, Member(LoggerAddress(client.name, client.pid, client.name, "ann"), FINE)
            )
        return find(self)

    return found


@pytest.mark.slow
async def test_a_command_for_marked_loggers_that_a_filter_hides_is_for_no_other(robots, opened):
    for fake in robots:
        fake.run()
    async with opened(*robots, ready=False, size=(80, 24)) as screen:
        await screen.shows("3 loggers: 3 running")
        await screen.press("space", "slash", *"legs", "enter", shows="/legs: 1 of 3")
        await screen.press("S", shows="the filter leaves out what is marked: Esc ends it; nothing was")
    assert all(fake.state is State.RUNNING for fake in robots)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_marked_loggers_are_stopped_after_a_question_that_names_them_and_each_answers(robots, opened, size):
    arm, _, _ = robots
    for fake in robots:
        fake.run()
    arm.stop = lambda: (_ for _ in ()).throw(RefusedError("ann is a viewer here"))
    async with opened(*robots, ready=False, size=size) as screen:
        await screen.shows("3 loggers: 3 running")
        await screen.press("space", "space", shows="2 marked")
        await screen.press("S", shows="Stop 2 loggers?")
        assert "arm   running 05:30, 118 024 ticks not saved" in screen.text
        assert "legs   running" not in screen.text
        await screen.press("y", shows="! ann is a viewer here")
        await screen.shows("stopped, 4 800 ticks, not saved")
        await screen.shows("stop: 1 did, 1 did not, 0 waiting")
        assert [len(fake.calls) for fake in robots] == [0, 1, 0]
        await screen.press("escape")
        assert "ann is a viewer" not in screen.text
        await screen.shows("2 marked")


@pytest.mark.slow
async def test_a_question_that_is_left_asks_nobody_and_a_script_is_loaded_into_all_that_are_marked(robots, opened):
    async with opened(*robots, ready=False, size=(120, 30)) as screen:
        await screen.shows("3 loggers")
        await screen.press("*", "w", shows="Save 3 loggers?")
        await screen.press("escape")
        assert not any(fake.calls for fake in robots)
        await screen.do("load_into_loggers")
        await screen.shows("Load a script into 3 loggers")
        await screen.enter("quiet")
        await screen.until(lambda: all(("load_script", "quiet.yaml") in fake.calls for fake in robots), "the loads")
        await screen.shows("load: 3 did, 0 did not, 0 waiting")


@pytest.mark.slow
async def test_nothing_is_commanded_read_only(robots, opened):
    async with opened(*robots, ready=False, read_only=True) as screen:
        await screen.shows("3 loggers")
        assert "Start/Stop" not in screen.text
        await screen.press("S", shows="read-only")
        assert not any(fake.calls for fake in robots)


@pytest.mark.slow
async def test_the_list_is_filtered_and_ordered_and_a_line_that_is_gone_is_not_opened(robots, opened):
    async with opened(*robots, ready=False) as screen:
        await screen.shows("3 loggers")
        screen.app._finder.members["legs"] = member("legs", here=False, since_s=0.0)
        await screen.shows("○ SILENT")
        await screen.do("list_top")
        assert screen.app.screen.chosen.address == "legs"  # the worst first
        await screen.press("enter", shows="legs is not there any more")
        await screen.press("o", "n", shows="by logger")
        await screen.press("/")
        await screen.enter("arm", shows="/arm: 1 of 3")
        assert "base" not in screen.text
        await screen.press("/")
        await screen.enter("nothing", shows="No line has 'nothing'. Esc clears the filter.")


@pytest.mark.slow
async def test_who_has_seen_several_is_not_taken_to_the_one_that_is_left(robots, opened):
    async with opened(*robots, ready=False) as screen:
        await screen.shows("3 loggers")
        for name in ("base", "legs"):
            screen.app._finder.members[name] = member(name, here=False)
        await screen.shows("2 silent")
        assert not screen.app.context.has_session


@pytest.mark.slow
async def test_those_that_were_gone_before_we_came_keep_nobody_from_the_only_one(
    robots, opened, new_finder, monkeypatch
):
    find = new_finder.find

    def found(self):
        for name in ("base", "legs"):
            self.members[name] = Member(member(name).found, here=False, problem="it can't be reached")
        return find(self)

    monkeypatch.setattr(new_finder, "find", found)
    async with opened(*robots, ready=False) as screen:
        await screen.until(lambda: screen.app.context.has_session, "the only one")


@pytest.mark.slow
async def test_summaries_rest_while_a_logger_is_open_and_come_again_with_the_list(robots, opened):
    async with opened(*robots, ready=False) as screen:
        await screen.shows("3 loggers")
        await screen.press("enter")
        await screen.until(lambda: screen.app.context.has_session and len(screen.session.table), "the table")
        await screen.until(lambda: not screen.app._finder.attentive)


@pytest.mark.parametrize(("told", "words"), [({"recorders": 2}, "REC 2"), ({"denied": 3}, "DENIED"), ({}, "")])
def test_a_filter_looks_in_what_is_recorded_and_denied_too(told, words) -> None:
    found = fleet.told(line(member(**told)))
    assert ("REC" in found, "DENIED" in found) == ("REC" in words, "DENIED" in words)
    assert words in found
    fleet.told(line(Member(LoggerAddress("x", 0, "", ""), problem="no answer")))  # of which nothing is known


def test_of_the_logger_that_is_open_it_is_told_in_full_why_it_died():
    reason = f"the robot program (process 3833) ended without close(); {'words ' * 40}: /home/ann/logs/arm.silo (9 MB)"
    status = msgspec.structs.replace(NO_STATUS, reason=reason, state=State.DEAD)
    one = line(member(state=State.DEAD, reason=Summary.of(status).reason))
    listed = Listed.__new__(Listed)
    listed.context = SimpleNamespace(logger_session=None)
    assert reason not in listed.about(one)
    listed.context = SimpleNamespace(logger_session=SimpleNamespace(status=status))
    assert reason in listed.about(one)


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_of_two_loggers_of_one_name_the_open_one_is_told_in_a_word_and_by_one_name(new_fake, opened, size):
    dead, mine = new_fake(name="demo"), new_fake(name="demo").run()
    dead.pid, mine.pid = 19149, 19150

    def lines(screen):
        return [line for line in screen.text.splitlines()[1:] if "✖ DEAD" in line or "● RUNNING" in line]

    async with opened(dead, mine, ready=False, size=size) as screen:
        screen.app._finder.members = {
            fake.found.key: Member(fake.found, msgspec.structs.replace(FINE, state=state))
            for fake, state in ((dead, State.DEAD), (mine, State.RUNNING))
        }
        await screen.shows("demo.19150  ● RUNNING")  # the one that lives opens by itself
        await screen.do("loggers", shows="1 dead, 1 running")
        other, here = sorted(lines(screen), key=lambda line: " open " in line)
        assert "demo.19149" in other and "DEAD" in other and " open " not in other
        assert "demo.19150" in here and "RUNNING" in here
        assert screen.app.screen.chosen_key == mine.found.key


@pytest.mark.slow
async def test_a_logger_that_got_a_namesake_is_called_as_in_the_list(new_fake, opened):
    mine, other = new_fake(name="demo").run(), new_fake(name="demo")
    mine.pid, other.pid = 19150, 19149
    async with opened(mine) as screen:
        await screen.shows("anymal/demo  ● RUNNING")
        screen.app._finder.clients.append(other)
        await screen.do("loggers", shows="demo.19149")
        await screen.press("escape", shows="demo.19150  ● RUNNING")


async def test_nothing_is_offered_to_be_asked_of_a_dead_logger(new_fake, opened) -> None:
    dead, mine = new_fake(name="lost"), new_fake(name="demo").run()
    dead.pid, mine.pid = 19149, 19150
    async with opened(dead, mine, ready=False, size=(120, 24)) as screen:
        screen.app._finder.members = {
            fake.found.key: Member(fake.found, msgspec.structs.replace(FINE, state=state))
            for fake, state in ((dead, State.DEAD), (mine, State.RUNNING))
        }
        await screen.shows("demo  ● RUNNING")
        await screen.do("loggers", shows="1 dead, 1 running")
        await screen.shows("S Start/Stop")  # of the one that is open
        screen.app.screen.move(screen.app.screen.shown_keys.index(dead.found.key))
        await screen.until(lambda: "Start/Stop" not in screen.text, "no key")
        await screen.do("start_stop_loggers", shows="lost is dead: start the program again")


def test_the_open_one_is_told_beside_what_it_answered_too() -> None:
    def told(one: fleet.FoundLogger) -> str:
        return fleet.row(one, 16, 80, NOW_S, NOW_NS, is_open=True)

    assert told(line(member(), answer="stopped")).endswith(" open: stopped")
    assert told(line(Member(UNKNOWN.found, problem="no answer"))).endswith(" open: no answer")
    assert told(line(Member(UNKNOWN.found))).endswith(" …         open: no answer yet")  # and not half a line
    assert " open ann" in told(line(member()))
