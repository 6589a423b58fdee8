"""Roles, by plain Zenoh and nothing of silo's client: every role tries every verb on every key, in both directions.

A hub (a router, or a robot that listens itself) sees what gets in, and offers what may get out.
"""

import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from silo.net.access.admission import hold_directions
from silo.net.access.rights import (
    _OWN,
    ANSWERED,
    NOBODY_ASKED,
    OPERATOR,
    PEOPLE,
    ROBOT,
    ROBOTS,
    SHARED,
    TABLE,
    THERE,
    TOLD,
    VIEWER,
    access_control,
)
from silo.net.configuration import FORCED, insert
from silo.net.keys import LOCAL_SENDER, Root
from silo.net.session import Beside, close, open_router, open_server
from tests.thin_net import free_port
from tests.waiting import DEADLINE_S, wait_until

MINE, OTHER = Root("robot3", "anymal", "3fa977b2e0"), Root("robot4", "anymal", "3fa9000000")
USERS = {"alice": OPERATOR, "bob": VIEWER, "robot3": ROBOT, "robot4": ROBOT, SHARED: ROBOT}
_OFFERS = {TOLD: "put", ANSWERED: "answer", THERE: "token"}
_USES = {TOLD: "subscribe", ANSWERED: "ask", THERE: "look"}


def instances(row_key: str) -> list[tuple[str, str]]:
    """Keys that a row means, each with the user that it is of."""
    if "{user}" in row_key:
        return [(row_key.format(user=user), user) for user in ("alice", "bob", "carol")]
    return [(row_key.replace("**", "legs/LF/q").replace("*", "5f3a-1"), "")]


KEYS = [(row, key, user) for row in TABLE for key, user in instances(row.key)]
UNKNOWN = [f"do/{LOCAL_SENDER}", "refused", "elsewhere", "view", "client", "ask/more", "event/more", "alive/more"]


def may(role: str, name: str, root: Root) -> set[tuple[str, str]]:
    """What the table lets somebody do with the keys of a robot: verbs with keys."""
    found = set()
    hosts = {"robot3": [MINE], "robot4": [OTHER]}.get(name, [MINE, OTHER])
    if root not in hosts:
        return found
    for row, key, user in KEYS:
        if role in row.offered:
            found.add((_OFFERS[row.way], key))
        if role in row.used and (role == ROBOT or user in ("", name) or name == ""):
            found.add((_USES[row.way], key))
    return found


class Attempt:
    """Everything that somebody tries with the keys of a robot, and what of it came through."""

    def __init__(self, hub: zenoh.Session, session: zenoh.Session, root: Root, barrier: str, *, asks: bool) -> None:
        self.hub, self.session, self.root = hub, session, root
        self.through: set[tuple[str, str]] = set()
        self._barrier, self._asks = barrier, asks
        self._passed = 0
        self._declared: list[object] = []
        self.keys = [key for _, key, _ in KEYS] + UNKNOWN

    def full(self, key: str) -> str:
        return self.root.key(key)

    def note(self, verb: str, key: object) -> None:
        begin = self.root.key("")
        if str(key).startswith(begin):
            self.through.add((verb, str(key).removeprefix(begin)))

    def wait(self) -> None:
        """Wait until the hub has taken all that was sent before."""
        before = self._passed
        if self._asks:
            list(self.session.get(self._barrier, timeout=DEADLINE_S))
        else:
            self.session.put(self._barrier, b"barrier")
        wait_until(lambda: self._passed > before)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        if sample.payload.to_bytes() == b"barrier":
            self._passed += 1
        elif sample.payload.to_bytes() != b"hub":  # not what the hub itself put
            self.note("put" if sample.kind == zenoh.SampleKind.PUT else "delete", sample.key_expr)

    def _on_query(self, query: zenoh.Query) -> None:
        asked = query.payload.to_bytes() if query.payload is not None else b""
        with query:
            if str(query.key_expr) == self._barrier and not asked:
                self._passed += 1
                query.reply(str(query.key_expr), b"barrier")
            elif asked == b"try":
                self.note("ask", query.key_expr)
                query.reply(str(query.key_expr), b"hub")

    def run(self, expected: set[tuple[str, str]]) -> set[tuple[str, str]]:
        """Try it all; what is `expected` to come through is waited for, as callbacks may lag behind the barrier."""
        hub, mine = self.hub, self.session
        # `**` fits no part that begins with `@`
        for pattern in ("silo/**", self.full("do/@local")):
            self._declared += [hub.declare_subscriber(pattern, self._on_sample),
                               hub.declare_queryable(pattern, self._on_query)]  # fmt: skip
        self.wait()
        for key in self.keys:
            full = self.full(key)
            mine.put(full, b"forged")
            mine.delete(full)
            self._declared += [
                mine.declare_queryable(full, self._answer),
                mine.declare_subscriber(full, self._heard),
                mine.liveliness().declare_token(full),
            ]
        self.wait()
        for key in self.keys:
            full = self.full(key)
            list(mine.get(full, payload=b"try", timeout=DEADLINE_S))
            for reply in hub.get(full, payload=b"hub asks", target=zenoh.QueryTarget.ALL, timeout=DEADLINE_S):
                if reply.ok is not None and reply.ok.payload.to_bytes() == b"forged":
                    self.note("answer", full)
            for reply in hub.liveliness().get(full, timeout=DEADLINE_S):
                if reply.ok is not None:
                    self.note("token", full)
        self._undeclare_tokens()
        tokens = [hub.liveliness().declare_token(self.full(key)) for key in self.keys]
        for key in self.keys:
            hub.put(self.full(key), b"hub")
            for reply in mine.liveliness().get(self.full(key), timeout=DEADLINE_S):
                if reply.ok is not None:
                    self.note("look", self.full(key))
        wait_until(lambda: expected <= self.through)
        self.wait()
        for token in tokens:
            token.undeclare()
        for one in self._declared:
            one.undeclare()
        return self.through

    def _undeclare_tokens(self) -> None:
        gone = [one for one in self._declared if isinstance(one, zenoh.LivelinessToken)]
        self._declared = [one for one in self._declared if one not in gone]
        for one in gone:
            one.undeclare()
        self.wait()

    def _answer(self, query: zenoh.Query) -> None:
        asked = query.payload.to_bytes() if query.payload is not None else b""
        with query:
            if asked == b"hub asks":
                query.reply(str(query.key_expr), b"forged")

    def _heard(self, sample: zenoh.Sample) -> None:
        if sample.payload.to_bytes() == b"hub":
            self.note("subscribe", sample.key_expr)


class Hub:
    """A router or a robot, the files for it, and plain sessions to it."""

    def __init__(self, folder: Path, kind: str, rules: dict[str, object] | None) -> None:
        self.port = free_port()
        values: dict[str, object] = {"listen": {"endpoints": [f"tcp/127.0.0.1:{self.port}"]}}
        if rules is not None:
            (folder / "users.txt").write_text("".join(f"{name}:pw\n" for name in USERS))
            values["transport"] = {"auth": {"usrpwd": {"dictionary_file": str(folder / "users.txt")}}}
            values["access_control"] = rules
        config = folder / "server.json5"
        config.write_text(json.dumps(values))
        self._opened: list[zenoh.Session] = []
        if kind == "router":
            self.session, _ = open_router(str(config))
            self.path = None
        else:
            given = None if kind == "socket" else str(config)
            self.session, self.path = open_server(folder, "anymal", os.getpid(), given, MINE)

    def join(self, user: str = "", *, local: bool = False) -> zenoh.Session:
        settings = zenoh.Config()
        insert(settings, FORCED)
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("listen/endpoints", "[]")
        there = f"unixsock-stream/{self.path}" if local else f"tcp/127.0.0.1:{self.port}"
        settings.insert_json5("connect/endpoints", json.dumps([there]))
        if local and Beside.SECRET.of(self.path).exists():
            name, password = Beside.SECRET.of(self.path).read_text().strip().split(":", 1)
            settings.insert_json5("transport/auth/usrpwd", json.dumps({"user": name, "password": password}))
        elif user:
            settings.insert_json5("transport/auth/usrpwd", json.dumps({"user": user, "password": "pw"}))
        self._opened.append(zenoh.open(settings))
        return self._opened[-1]

    def tries(
        self, session: zenoh.Session, root: Root, expected: set[tuple[str, str]], name: str = ""
    ) -> set[tuple[str, str]]:
        own = {"robot4": OTHER}.get(name, MINE)
        asks = USERS.get(name) != ROBOT
        barrier = own.key("ask" if asks else "event")
        return Attempt(self.session, session, root, barrier, asks=asks).run(expected)

    def close(self) -> None:
        for session in [*self._opened, self.session]:
            close(session)


@pytest.fixture
def folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir="/dev/shm", prefix="silo-roles-") as made:
        yield Path(made)


@pytest.fixture
def hub(folder: Path, request: pytest.FixtureRequest) -> Iterator[Hub]:
    kind, rules = request.param
    made = Hub(folder, kind, rules)
    yield made
    made.close()


GUARDED = [("router", access_control(USERS)), ("robot", access_control(USERS))]


@pytest.mark.parametrize("hub", GUARDED, ids=["router", "robot"], indirect=True)
@pytest.mark.parametrize("root", [MINE, OTHER], ids=["robot3's keys", "robot4's keys"])
@pytest.mark.parametrize("name", USERS)
def test_each_role_does_with_each_key_what_the_table_says_and_nothing_else(hub, name, root) -> None:
    expected = may(USERS[name], name, root)
    assert hub.tries(hub.join(name), root, expected, name) == expected


@pytest.mark.parametrize(
    "hub", [("socket", None), ("robot", access_control(USERS))], ids=["alone", "guarded"], indirect=True
)
def test_who_comes_by_the_unix_socket_asks_and_looks_and_never_acts_as_the_robot(hub) -> None:
    mine = {(verb, key) for verb, key in may(OPERATOR, "", MINE) if not key.startswith(("do/", "refused/"))}
    expected = mine | {("ask", f"do/{LOCAL_SENDER}"), ("ask", "do")}
    assert hub.tries(hub.join(local=True), MINE, expected) == expected


@pytest.mark.parametrize("hub", [("robot", None)], ids=["open"], indirect=True)
def test_whoever_comes_by_an_open_way_of_a_robot_never_acts_as_it(hub) -> None:
    expected = may(OPERATOR, "", MINE) | {("ask", "do")}
    assert hub.tries(hub.join(), MINE, expected) == expected


# ------------------------------------------------------------------- files that an older silo made, and newer ones

BOTH_WAYS = json.loads((Path(__file__).parents[1] / "data" / "access_control_both_ways.json").read_text())


@pytest.mark.parametrize("hub", [("router", BOTH_WAYS), ("robot", BOTH_WAYS)], ids=["router", "robot"], indirect=True)
@pytest.mark.parametrize("name", ["alice", "bob"])
def test_rules_of_an_older_silo_are_held_by_direction(hub, name) -> None:
    expected = {(verb, key) for verb, key in may(USERS[name], name, MINE) if not key.startswith("refused/")}
    assert hub.tries(hub.join(name), MINE, expected, name) == expected


@pytest.mark.parametrize("hub", [("router", BOTH_WAYS)], ids=["router"], indirect=True)
def test_robots_with_the_shared_file_of_an_older_silo_are_served_as_before(hub) -> None:
    expected = may(ROBOT, SHARED, MINE)
    assert hub.tries(hub.join(SHARED), MINE, expected, SHARED) >= expected


def test_rules_of_one_direction_are_left_as_they_are() -> None:
    settings = zenoh.Config()
    rules = access_control(USERS)
    settings.insert_json5("access_control", json.dumps(rules))
    assert hold_directions(settings) == []
    assert hold_directions(zenoh.Config()) == []
    settings.insert_json5("access_control", json.dumps(BOTH_WAYS))
    assert hold_directions(settings) == ["look", "watch", "change as alice"]


def table_text() -> str:
    """The table as the guide has it."""
    names = {ROBOTS: "a robot", PEOPLE: "everybody", (OPERATOR,): "an operator", NOBODY_ASKED: NOBODY_ASKED[0]}
    does = {ANSWERED: ("answers", "asks"), TOLD: ("publishes", "subscribes"), THERE: ("is there", "looks who is there")}
    lines = ["| key, below the robot's own | from whom | for whom |", "| --- | --- | --- |"]
    for row in TABLE:
        key = row.key.replace(_OWN, "NAME")
        own = ", by the own NAME alone" if _OWN in row.key else ""
        offers, uses = does[row.way]
        lines.append(f"| `{key}` | {names[row.offered]} {offers} | {names[row.used]} {uses}{own} |")
    return "\n".join(lines)


def test_the_guide_has_the_table_from_which_the_rules_are_made() -> None:
    assert table_text() in (Path(__file__).parents[2] / ".docs" / "guide" / "elsewhere.md").read_text()
