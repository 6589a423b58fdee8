"""Who may do what, as one table: role, key, verb, direction. From it come the rules of Zenoh's access control that
`silo remote init` writes, those that silo adds by itself, the table in the guide, and the tests of all of them.

Each key is offered by one side and used by the other: robots answer, tell and are there; people ask, subscribe and look
who is there. What no row allows is denied, whichever way it goes: so nobody but a robot answers in its name.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from silo.core.elements import GroupRole
from silo.net.keys import LOCAL_SENDER, escape, host_part, user_part
from silo.rpc.declaring import Ask, Do, Request

VIEWER, OPERATOR, ROBOT = GroupRole.VIEWER.value, GroupRole.OPERATOR.value, "robot"
PEOPLE = tuple(role.value for role in GroupRole)
USER_ROLES = (*PEOPLE, ROBOT)
ROBOTS = (ROBOT,)
NOBODY_ASKED = ("whoever comes by a way without users",)
SHARED = "robots"  # whoever has the file of this name may be any robot; each other robot is one host


class MessageFlow(NamedTuple):
    """What Zenoh calls the messages that go to and fro under a key: who offers it sends the first, who uses it the
    second; each gets what the other sends.
    """

    word: str
    offers: tuple[str, ...]
    uses: tuple[str, ...]


ANSWERED = MessageFlow("answers", ("reply", "declare_queryable"), ("query",))
TOLD = MessageFlow("publishes", ("put",), ("declare_subscriber",))
THERE = MessageFlow("is there", ("liveliness_token",), ("liveliness_query", "declare_liveliness_subscriber"))


class KeyRights(NamedTuple):
    """A key below `silo/<host>~<id>/<logger>/`, and the roles of those on either side of it.

    `{user}` stands for the name of who uses it, which rules admit nobody else to.
    """

    key: str
    way: MessageFlow
    offered: tuple[str, ...]
    used: tuple[str, ...]


# who may send requests of a kind, each under its key; what changes something names its sender there
ASKED: dict[type[Request[Any]], tuple[str, ...]] = {Ask: PEOPLE, Do: (OPERATOR,)}

TABLE = (
    *(KeyRights(kind.key + "/{user}" * (kind is Do), ANSWERED, ROBOTS, who) for kind, who in ASKED.items()),
    KeyRights(Do.key, ANSWERED, ROBOTS, NOBODY_ASKED),  # clients of protocol 1, who are told what to update
    KeyRights("refused/{user}", ANSWERED, ROBOTS, PEOPLE),
    KeyRights("event", TOLD, ROBOTS, PEOPLE),
    KeyRights("summary", TOLD, ROBOTS, PEOPLE),
    KeyRights("view/*", TOLD, ROBOTS, PEOPLE),
    KeyRights("stream/*", TOLD, ROBOTS, PEOPLE),
    KeyRights("topic/**", TOLD, ROBOTS, PEOPLE),
    KeyRights("alive", THERE, ROBOTS, PEOPLE),
    KeyRights("client/*", THERE, PEOPLE, ROBOTS),
)
_OWN = "{user}"
_IN_OUT = {"ingress": "in", "egress": "out"}

Rule = dict[str, Any]


class Right(NamedTuple):
    """Messages that somebody may send (`ingress`: it comes in) or get (`egress`: it goes out), and under which key."""

    flow: str
    messages: tuple[str, ...]
    key: str


def rights(role: str, user: str = "*") -> list[Right]:
    """Return all that the table lets a role do, below `silo/<host>~<id>/<logger>/`; `user` is a part of keys."""
    found = []
    for row in TABLE:
        key = row.key.replace(_OWN, "*" if role == ROBOT else user)
        if role in row.offered:
            found += [Right("ingress", row.way.offers, key), Right("egress", row.way.uses, key)]
        if role in row.used:
            found += [Right("ingress", row.way.uses, key), Right("egress", row.way.offers, key)]
    return found


def access_control(users: dict[str, str], host: str = "*") -> Rule:
    """Return rules that give each user (by name) what the role lets it do; who works on the robot itself needs none.

    A robot is admitted to the keys of the host that it is called after. What no rule allows is denied: a request that
    is denied gets no answer.
    """
    people = [name for name, role in users.items() if role != ROBOT]
    rules, policies = [], []
    if people:
        shared = [right for right in rights(VIEWER, _OWN) if _OWN not in right.key]
        made = _rules("all people", shared, host)
        rules += made
        policies.append(_policy(made, people))
    for name in people:
        made = _rules(name, [right for right in rights(users[name], _OWN) if _OWN in right.key], host, user_part(name))
        rules += made
        policies.append(_policy(made, [name]))
    for name in [name for name, role in users.items() if role == ROBOT]:
        made = _rules(name, rights(ROBOT), "*" if name == SHARED else escape(name).replace("~", "%7E"), asked_at=host)
        rules += made
        policies.append(_policy(made, [name]))
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "usernames": [name]} for name in users],
        "policies": policies,
    }


def local_rules(name: str) -> list[Rule]:
    """Return rules for who comes by the Unix socket of a robot: an operator under a name that no network has."""
    return _rules(name, [*rights(OPERATOR, LOCAL_SENDER), *rights(*NOBODY_ASKED)], "*")


def open_rules(name: str) -> list[Rule]:
    """Return rules for who comes by a way of a robot that has none: it may look, and ask for changes by any name; the
    robot says whether it does them.
    """
    return _rules(name, [*rights(OPERATOR), *rights(*NOBODY_ASKED)], "*")


def _rules(who: str, given: Iterable[Right], host: str, user: str = "*", asked_at: str = "") -> list[Rule]:
    """Return rights as rules, one for all keys of the same messages and direction.

    What goes out to a robot is asked with the wildcards of who asks, `silo/*/*/alive`: hence `asked_at`, another host.
    """
    keys: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for flow, messages, key in given:
        place = asked_at if asked_at and flow == "egress" else host
        full = f"silo/{host_part(place)}/*/{key.replace(_OWN, user)}"
        keys.setdefault((flow, messages), []).append(full)
    return [allowed(f"{who}: {', '.join(messages)} {_IN_OUT[flow]}", flow, messages, full)
            for (flow, messages), full in keys.items()]  # fmt: skip


def allowed(name: str, flow: str, messages: Iterable[str], keys: Iterable[str]) -> Rule:
    """Return a rule that lets messages of some keys through, one way."""
    return {"id": name, "permission": "allow", "flows": [flow], "messages": [*messages], "key_exprs": [*keys]}


def _policy(rules: list[Rule], subjects: list[str]) -> Rule:
    return {"rules": [rule["id"] for rule in rules], "subjects": subjects}
