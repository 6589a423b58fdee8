"""Finding and opening a logger, without an app: what is kept of a view and offered again, which one is meant."""

import asyncio
import os
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from silo.errors import SiloError
from silo_tui.commands import opening
from silo_tui.commands.opening import Opener
from silo_tui.layouts import files, views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.sessions import kept
from silo_tui.settings.options import Settings
from tests.stand_ins.desk import Desk

ONE, TWO, NOTHING = KeptLayout(filter="one"), KeptLayout(filter="two"), KeptLayout()


@pytest.fixture
def screen(monkeypatch):
    """What is on the screen, and what is put on it."""
    found = SimpleNamespace(layout=ONE, shown=[])

    async def show(_: Any, layout: KeptLayout) -> str:
        found.shown.append(layout)
        return ""

    monkeypatch.setattr(views, "capture", lambda _: found.layout)
    monkeypatch.setattr(views, "show", show)
    monkeypatch.setattr(kept, "lives", lambda pid: pid == 1)
    return found


@pytest.fixture
def opener(fake, screen, new_finder):
    return made(Desk(fake), new_finder(fake))


def made(desk: Desk, finder: Any, *, view: str = "", wish: str = "offered", demo: Any = None) -> Opener:
    desk.settings = Settings(view=wish)
    found = Opener(desk, finder, "", demo, 5.0, view)
    found.desk = desk
    return found


def left(pid: int, layout: KeptLayout) -> Any:
    """What a process left that was in the same terminal."""
    ours = files.left_by_us("robot")
    path = ours.with_name(ours.name.replace(f".{os.getpid()}.", f".{pid}."))
    files.save(path, layout)
    os.utime(path, (pid, pid))
    return path


def wishes(opener: Opener, wish: str) -> None:
    opener._context.settings = replace(opener._context.settings, view=wish)


# --------------------------------------------------------------------------------------------------- what is kept of it


@pytest.mark.parametrize(("wish", "is_kept"), [("offered", True), ("always", True), ("off", False)])
def test_what_is_on_the_screen_is_kept_as_is_wished(wish, is_kept, opener, screen):
    wishes(opener, wish)
    opener.keep_view()
    assert files.left_by_us("robot").exists() == is_kept
    if is_kept:
        assert files.load_file(files.left_by_us("robot"))[0] == ONE


def test_a_view_is_written_when_it_is_another_one(opener, screen):
    opener.keep_view()
    files.left_by_us("robot").unlink()
    opener.keep_view()
    assert not files.left_by_us("robot").exists()
    screen.layout = TWO
    opener.keep_view()
    assert files.load_file(files.left_by_us("robot"))[0] == TWO


def test_a_view_like_the_first_one_is_kept_where_there_was_another_or_at_the_end(opener, screen):
    screen.layout = NOTHING
    opener.keep_view()
    assert not files.left_by_us("robot").exists(), "what is offered stays until there is something else"
    screen.layout = ONE
    opener.keep_view()
    screen.layout = NOTHING
    opener.keep_view()
    assert files.load_file(files.left_by_us("robot"))[0] == NOTHING
    files.left_by_us("robot").unlink()
    opener.quit()
    assert files.left_by_us("robot").exists()


@pytest.mark.parametrize("nothing", ["screen", "yet to be shown", "quits"])
def test_there_is_not_always_something_to_keep(nothing, opener, screen):
    if nothing == "screen":
        screen.layout = None
    elif nothing == "quits":
        opener.quit()
        files.left_by_us("robot").unlink()
    else:
        opener._view_is_there = False
    opener.keep_view()
    assert not files.left_by_us("robot").exists()


def test_a_view_that_can_t_be_kept_is_told_of(opener, monkeypatch):
    def full(*_: Any) -> None:
        raise OSError("the disk is full")

    monkeypatch.setattr(files, "save", full)
    opener.keep_view()
    assert opener.desk.said == ["the disk is full"]


def test_who_leaves_a_logger_keeps_its_view_in_place_of_what_was_offered(opener):
    offered, others = left(7, TWO), left(1, TWO)
    asyncio.run(opener._show_view())
    opener.quit()
    assert files.load_file(files.left_by_us("robot"))[0] == ONE
    assert [path.exists() for path in (offered, others)] == [False, True]


# ----------------------------------------------------------------------------------------------------- what is offered


@pytest.mark.parametrize(
    ("view", "wish", "says", "shown"),
    [
        ("walk", "offered", "view walk", [TWO]),
        ("", "always", "this is what was on the screen ", [ONE]),
        ("", "off", "", []),
        ("gone", "always", "there is no view 'gone'; did you mean", []),
    ],
)
def test_what_was_asked_for_or_was_left_last_is_put_on_the_screen(view, wish, says, shown, fake, screen, new_finder):
    files.save(files.place("walk"), TWO)
    files.save(files.place("gone2"), TWO)
    left(7, ONE)
    opener = made(Desk(fake), new_finder(fake), view=view, wish=wish)
    assert asyncio.run(opener._show_view()).startswith(says)
    assert screen.shown == shown
    if view:  # once
        wishes(opener, "off")
        assert asyncio.run(opener._show_view()) == ""


def test_what_a_lost_terminal_showed_is_offered_and_what_older_ones_showed_forgotten(opener, screen):
    older, newest, others = left(7, ONE), left(8, TWO), left(1, ONE)
    words = asyncio.run(opener._show_view())
    assert words.startswith("`:view last` shows what was on the screen ")
    assert [path.exists() for path in (older, newest, others)] == [False, True, True]
    assert screen.shown == []


def test_where_nothing_was_left_nothing_is_said(opener, screen):
    assert asyncio.run(opener._show_view()) == ""
    wishes(opener, "last")
    assert asyncio.run(opener._show_view()) == ""


# -------------------------------------------------------------------------------------------------- looking for loggers


def test_the_only_logger_that_there_is_is_told_at_once(opener, new_fake, new_finder, fake):
    assert asyncio.run(opener.only_one()).name == "robot"
    opener._finder = new_finder(fake, new_fake(name="arm"))
    assert asyncio.run(opener.only_one()) is None
    opener.demo = SimpleNamespace(owns=lambda pid: True)
    assert asyncio.run(opener.only_one()) is None


def test_a_look_around_that_fails_or_takes_long_tells_of_none(opener, monkeypatch):
    def fails() -> None:
        raise SiloError("no network")

    monkeypatch.setattr(opener._finder, "find", fails)
    assert asyncio.run(opener.only_one()) is None
    assert asyncio.run(opener._look())[1] == "no network"
    monkeypatch.setattr(opening, "AT_ONCE_S", 0.0)
    assert asyncio.run(opener.only_one()) is None


def test_a_search_is_begun_again_with_what_failed_before_where_nothing_is_open(opener, monkeypatch):
    begun: list[Any] = []
    monkeypatch.setattr(opening, "run_alone", lambda of, group, *work: begun.append(group))
    opener._failed["robot.4711"] = "no answer"
    opener.try_again()
    assert (opener._failed, begun) == ({}, [])
    opener.desk.take_session(None)
    opener.try_again()
    assert begun == ["search"]
