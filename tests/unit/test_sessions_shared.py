"""Sessions that are shared by those who reach the same robots, and the thread that lets go of their links."""

import json
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from silo.core.runtime import user_name
from silo.net import lingering, sessions
from silo.net.lingering import Releasing
from silo.net.sessions import borrow, give_back, user_at
from tests.stand_ins.shared_sessions import open_configurations
from tests.waiting import DEADLINE_S


@pytest.fixture
def opened(monkeypatch):
    """Sessions that were opened, as `open_client` would; those that are closed leave it."""
    made = []

    def opening(path, config=None, reached=None, *, open_s=0.0):
        made.append(SimpleNamespace(path=path, config=config))
        return made[-1]

    monkeypatch.setattr(sessions, "reach", lambda path, reach_s: SimpleNamespace(rtt_s=0.25))
    monkeypatch.setattr(sessions, "open_client", opening)
    monkeypatch.setattr(sessions, "close", made.remove)
    return made


def test_who_reaches_the_same_configuration_shares_a_session_until_the_last_has_let_go(opened, tmp_path):
    files = [str(tmp_path / name) for name in ("one.json5", "other.json5")]
    for file in files:
        Path(file).write_text("{}")
    first, second, apart = borrow("", files[0]), borrow("", files[0]), borrow("", files[1])
    assert first.session is second.session is not apart.session
    assert open_configurations() == {files[0]: 2, files[1]: 1}
    assert (first.slack_s, first.user) == (sessions.WAITED_TRIPS * 0.25, user_name(tmp_path.stat().st_uid))
    give_back(first)
    give_back(apart)
    assert ([one.config for one in opened], open_configurations()) == ([files[0]], {files[0]: 1})
    give_back(second)
    assert (opened, open_configurations()) == ([], {})


def test_a_session_to_a_socket_is_nobody_elses(opened, tmp_path):
    first, second = (borrow(str(tmp_path / "bot.1.sock"), "") for _ in range(2))
    assert first.session is not second.session
    give_back(first)
    assert opened == [second.session]
    give_back(second)


def test_a_way_that_can_not_be_opened_leaves_no_session(opened, tmp_path, monkeypatch):
    (tmp_path / "one.json5").write_text("{}")

    def interrupted(path):
        raise KeyboardInterrupt

    monkeypatch.setattr(sessions, "user_at", interrupted)
    with pytest.raises(KeyboardInterrupt):
        borrow("", str(tmp_path / "one.json5"))
    assert (opened, open_configurations()) == ([], {})


@pytest.mark.parametrize(
    ("said", "user"),
    [
        ({}, None),
        ({"metadata": {"silo": {"user": "carol"}}}, "carol"),
        ({"metadata": {"silo": {"user": 7}}}, None),
        ({"transport": {"auth": {"usrpwd": {"user": "alice", "password": "x"}}}}, "alice"),
        (
            {
                "transport": {"auth": {"usrpwd": {"user": "alice", "password": "x"}}},
                "metadata": {"silo": {"user": "c"}},
            },
            "alice",
        ),
    ],
)
def test_changes_are_sent_under_the_name_of_a_file_or_of_its_certificate_else_of_who_runs_it(said, user, tmp_path):
    file = tmp_path / "c.json5"
    file.write_text(json.dumps(said))
    assert user_at(str(file)) == (user or user_name(tmp_path.stat().st_uid))


def test_links_are_let_go_of_by_one_thread_while_any_session_is_open_and_once_more_at_each_end(monkeypatch):
    known, looked = [], threading.Event()

    def release(there, before=None):
        known.append(before)
        if before == {(1, 2)}:
            looked.set()
        return {(1, 2)}

    monkeypatch.setattr(lingering, "PERIOD_S", 0.001)
    monkeypatch.setattr(lingering, "release_links", release)
    releasing, one, other = Releasing(), object(), object()
    releasing.end(one)
    assert known == []
    before = set(threading.enumerate())
    releasing.begin(one)
    (thread,) = set(threading.enumerate()) - before
    releasing.begin(other)
    assert set(threading.enumerate()) - before == {thread}
    assert looked.wait(DEADLINE_S)
    releasing.end(one)
    looked.clear()
    assert looked.wait(DEADLINE_S)
    releasing.end(other)
    thread.join(DEADLINE_S)
    assert not thread.is_alive()
    assert known.count(None) == 2
