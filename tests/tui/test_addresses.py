"""`silo-tui host/name`: which logger is meant, or which file, and what is said of it."""

import math
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from msgspec.structs import replace

from silo.core.elements import State
from silo.errors import ConnectionLostError, LogNotFoundError, VersionError
from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from silo.rpc.published import Summary
from silo_tui.cli import command
from silo_tui.commands.opening import Opener
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.sessions.finder import FIRST_LOOK_S, OLD_S, ClientFinder, Found
from silo_tui.sessions.target import also_a_file, file_meant

FAR = ("anymal", "robot3/anymal", "robot3~3fa977b2e0/anymal")


def test_an_address_of_a_logger_that_runs_wins_over_a_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("robot3").mkdir()
    Path("robot3/anymal").mkdir()
    assert file_meant("robot3/anymal", lambda: FAR) is None
    assert also_a_file("robot3/anymal") == (
        "robot3/anymal is the logger; there is a file of that path, too: silo-tui ./robot3/anymal"
    )
    assert also_a_file("robot4/anymal") == ""


def test_a_path_that_begins_with_a_dot_is_never_an_address(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogNotFoundError):
        file_meant("./robot3/anymal", lambda: FAR)


def test_one_waits_for_an_address_where_there_is_no_such_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert file_meant("robot3/anymal", lambda: ()) is None
    Path("logs").mkdir()
    with pytest.raises(LogNotFoundError):
        file_meant("logs/anymal", lambda: ())


def test_an_ending_always_means_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LogNotFoundError):
        file_meant("robot3/anymal.silo", lambda: ("robot3/anymal.silo",))


def test_a_url_means_its_logger_and_one_of_an_element_is_refused(monkeypatch):
    meant = []
    monkeypatch.setattr("silo_tui.cli._serve", lambda given, port, control: meant.append(given))
    assert CliRunner().invoke(command, ["--serve", "silo://robot3/anymal"]).exit_code == 0
    assert CliRunner().invoke(command, ["--serve", "silo:///anymal"]).exit_code == 0
    assert meant == [["robot3/anymal"], ["anymal"]]
    refused = CliRunner().invoke(command, ["--serve", "silo://robot3/anymal/log/x"])
    assert refused.exit_code == 1
    assert "this is for a whole logger: silo://robot3/anymal" in refused.output


ALIVE = Member(LoggerAddress("robot", 0, "", ""))
HERE = FoundLogger("robot", 7, "ann", "robot.7", ALIVE, addresses=("robot", "here/robot", "robot.7"))
THERE = FoundLogger("robot", 0, "lab", "there~1/robot", ALIVE, host="there", addresses=FAR)


@pytest.mark.parametrize(
    ("logger", "address", "where"),
    [
        (HERE, "robot", "pid 7  ann"),
        (replace(HERE, alike=True), "here/robot", "pid 7  ann"),
        (replace(HERE, alike=True, addresses=("robot",)), "robot", "pid 7  ann"),
        (replace(HERE, alike=True, addresses=()), "robot", "pid 7  ann"),
        (THERE, "there/robot", "robot3~3fa977b2e0/anymal"),
        (replace(THERE, alike=True), "robot3~3fa977b2e0/anymal", "robot3~3fa977b2e0/anymal"),
        (replace(THERE, addresses=()), "there/robot", "there"),
    ],
)
def test_a_logger_is_called_by_what_tells_it_from_others(logger, address, where):
    assert (logger.address, logger.where) == (address, where)


@pytest.mark.parametrize(
    ("wanted", "meant"),
    [("", True), ("robot", True), ("robot.7", True), ("here/robot", True), ("robot.8", False), ("there/robot", False)],
)
def test_a_name_an_address_or_nothing_means_a_logger(wanted, meant):
    assert HERE.is_meant_by(wanted) is meant


def stands(*, here, seen=True):
    return SimpleNamespace(here=here, dead=False, summary=object() if seen else None)


DEAD = replace(HERE, pid=8, key="robot.8", member=replace(ALIVE, found=replace(ALIVE.found, dead=True)))
OTHER = replace(HERE, name="arm", pid=9, key="arm.9", addresses=("arm",))
SEEN = replace(HERE, member=stands(here=True))
GONE, UNSEEN = (replace(OTHER, key=f"gone{seen}", member=stands(here=False, seen=seen)) for seen in (True, False))


@pytest.mark.parametrize(
    ("wanted", "found", "chosen"),
    [
        ("", [], None), ("", [HERE], HERE), ("", [HERE, OTHER], None), ("arm", [HERE, OTHER], OTHER),
        ("leg", [HERE, OTHER], None), ("", [HERE, DEAD], HERE), ("", [DEAD], DEAD), ("robot", [HERE, THERE], None),
        ("", [SEEN], SEEN), ("", [UNSEEN], None), ("", [HERE, UNSEEN], HERE),
        ("", [HERE, GONE], None), ("robot", [HERE, GONE], HERE),
    ],
)  # fmt: skip
def test_the_only_logger_that_is_meant_is_opened_without_asking(wanted, found, chosen):
    opener = Opener(SimpleNamespace(app=None), None, wanted, None, 5.0)
    assert opener._choice(found) is chosen
    if chosen is not None:
        opener._again_s[chosen.key] = math.inf  # it could not be opened
        assert opener._choice(found) is None


def test_of_a_demo_only_its_own_logger_is_opened():
    demo = SimpleNamespace(owns=lambda pid: pid == 9)
    opener = Opener(SimpleNamespace(app=None), None, "", demo, 5.0)
    assert [opener._choice(found) for found in ([HERE], [HERE, OTHER, DEAD])] == [None, OTHER]


class Members:
    """A fleet of three loggers, two of which are alike, that notes what is asked of it."""

    def __init__(self, config):
        self.asked = [config]
        each = [
            SimpleNamespace(name=name, pid=pid, user=user, host=host, addresses=(key,))
            for name, pid, user, host, key in
            [("robot", 7, "ann", "desk", "a"), ("robot", 0, "", "desk", "b"), ("robot", 0, "lab", "far", "c")]
        ]  # fmt: skip
        self.found = SimpleNamespace(
            members=[SimpleNamespace(found=one, key=one.addresses[0], dead=one.pid == 7) for one in each],
            near=SimpleNamespace(
                forbidden=[
                    SimpleNamespace(owner="bob", loggers=["arm", "leg"], advice="ask bob"),
                    SimpleNamespace(owner="eve", loggers=[], advice="ask eve"),
                ],
                down=[],
            ),
            unreachable={},
            routers=[SimpleNamespace(words="a router is old")],
        )

    def __getattr__(self, name):
        def note(*words, **named):
            self.asked.append((name, *words, *named.values()))
            return self.found

        return note


def test_a_look_around_waits_once_and_tells_which_are_alike_and_which_are_closed(monkeypatch):
    monkeypatch.setattr("silo.fleet.fleet.Fleet", Members)
    finder = ClientFinder("lab.json5")
    for nothing_yet in (finder.rest, finder.look_again, finder.close):
        nothing_yet()
    found = finder.find()
    assert finder.own_name
    assert [(one.key, one.user, one.alike, one.member.dead) for one in found.loggers] == [
        ("a", "ann", True, True), ("b", "desk", True, False), ("c", "lab", False, False)
    ]  # fmt: skip
    assert found.advice == (
        "bob runs arm, leg, closed to you: ask bob", "eve runs a logger, closed to you: ask eve", "a router is old"
    )  # fmt: skip
    assert finder.find() == found
    for then in (finder.rest, finder.look_again, finder.close):
        then()
    assert finder._fleet.asked == [
        "lab.json5", ("wait_ready", FIRST_LOOK_S), ("attend", True), ("now",), ("attend", False), ("look_again",),
        ("close",),
    ]  # fmt: skip


def test_what_was_told_before_nobody_looked_is_not_shown_as_what_is(monkeypatch):
    """A demo that was just starting then stood as stopped for a second, while it ran for minutes."""
    now_s = 100.0
    monkeypatch.setattr("silo_tui.sessions.finder.time.monotonic", lambda: now_s)
    monkeypatch.setattr("silo.fleet.fleet.Fleet", Members)
    finder = ClientFinder()
    finder.find()
    told = Member(LoggerAddress("demo", 7, "", ""), summary=Summary(state=State.STOPPED), told_s=99.0)
    finder._fleet.found.members = [told]
    assert finder.find().loggers[0].member is told, "nobody looked away"
    finder.rest()
    assert finder.find().loggers[0].member.word == "..."
    finder._fleet.found.members = [replace(told, told_s=100.5)]
    assert finder.find().loggers[0].member.word == "stopped"
    finder._fleet.found.members = [told]
    now_s += OLD_S
    assert finder.find().loggers[0].member is told, "it tells no more, as an older one"


class Far:
    """Finds the fake on two hosts that are called the same."""

    own_name = "ann@here"

    def __init__(self, *ids: str) -> None:
        self.loggers = tuple(
            FoundLogger(
                "robot", 0, "lab", f"silo/same~{one}/robot", ALIVE, host="same",
                addresses=("robot", "same/robot", f"same~{one}/robot"),
                alike=len(ids) > 1,
            )
            for one in ids
        )  # fmt: skip

    def find(self) -> Found:
        return Found(self.loggers)

    def rest(self) -> None:
        pass

    def connect(self, _):
        return self.fake


async def test_two_robots_of_one_image_are_listed_with_addresses_that_open_them(fake, opened, monkeypatch):
    async with opened(fake, name="same/robot", ready=False) as screen:
        far = Far("aaaa000001", "bbbb000002")
        monkeypatch.setattr(screen.app._opener, "_finder", far)
        await screen.shows("2 loggers are called 'same/robot'")
        await screen.shows("choose one, or name it:")
        await screen.until(lambda: screen.text.count("same~bbbb000002/robot") == 2, "its line and the advice")
        assert "same~aaaa000001/robot" in screen.text
        far.fake = fake
        await screen.press("down", "enter")
        await screen.shows("silo same~bbbb000002/robot")  # the title, so that nobody takes it for the other
    assert [one.is_meant_by("same~bbbb000002/robot") for one in far.loggers] == [False, True]


async def test_a_logger_that_does_not_answer_is_tried_again_by_itself(fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.commands.opening.AGAIN_S", 0.0)
    tries = []

    def connect(_):
        tries.append(1)
        if len(tries) < 3:
            raise ConnectionLostError("the link is cut")
        return fake

    async with opened(fake, name="nobody", ready=False) as screen:
        monkeypatch.setattr(screen.app._opener._finder, "connect", connect)
        screen.app._opener._wanted = ""
        await screen.until(lambda: len(tries) == 3, "the third try")
        await screen.shows("/base/position")


async def test_a_logger_of_another_silo_is_not_tried_again(fake, opened, monkeypatch):
    monkeypatch.setattr("silo_tui.commands.opening.AGAIN_S", 0.0)
    tries, looks = [], []

    def connect(_):
        tries.append(1)
        raise VersionError("runs an older silo")

    async with opened(fake, name="nobody", ready=False) as screen:
        finder = screen.app._opener._finder
        find = finder.find
        monkeypatch.setattr(finder, "connect", connect)
        monkeypatch.setattr(finder, "find", lambda: looks.append(1) or find())
        screen.app._opener._wanted = ""
        await screen.shows("runs an older silo")
        seen = len(looks)
        await screen.until(lambda: len(looks) > seen + 5, "more looks")
        assert len(tries) == 1
