"""Who may do what, as rules of Zenoh: written by `silo remote init`, and what the examples in `config/` say.

Changes go to `do/<user>`, and each user is admitted to that key alone: so a robot knows who sent one.
"""

from typing import Any

from silo.ipc.keys import user_part

ROLES = {"viewer": ("look", "watch"), "operator": ("look", "watch"), "robot": ("serve", "served", "know")}

QUERIES = ["query", "reply", "declare_queryable"]
VALUES = [
    "put", "delete", "declare_subscriber", "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip
# a robot behind a router: it offers and answers, and asks nobody
_OFFERED = ["put", "delete", "reply", "declare_queryable", "liveliness_token"]
_ASKED = [
    "query", "declare_subscriber", "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip
WATCHED = ("event", "view/*", "stream/*", "topic/**", "alive", "client/*", "summary")


def host_part(host: str) -> str:
    """Return the part of a key that fits the loggers of a host, whatever ids they drew; all hosts for `*`."""
    return host if host == "*" else f"{host}~$*"


def access_control(users: dict[str, str], host: str = "*") -> dict[str, Any]:
    """Return rules that give each user (by name) what the role lets it do; who works on the robot itself needs none.

    What no rule allows is denied: a request that is denied gets no answer.
    """
    root = f"silo/{host_part(host)}/*"
    rules = [
        _rule("look", QUERIES, [f"{root}/ask"]),
        _rule("watch", VALUES, [f"{root}/{key}" for key in WATCHED]),
    ]
    operators = [name for name, role in users.items() if role == "operator"]
    rules += [_rule(f"change as {name}", QUERIES, [f"{root}/do/{user_part(name)}"]) for name in operators]
    if "robot" in users.values():
        rules += [
            _rule("serve", _OFFERED, ["silo/**"], ["ingress"]),
            _rule("served", _ASKED, ["silo/**"], ["egress"]),
            # who is connected, and whose views are to end
            _rule("know", ["liveliness_query", "declare_liveliness_subscriber"], ["silo/*/*/client/*"], ["ingress"]),
        ]
    shared = [{"rules": list(ROLES[role]), "subjects": named} for role in ROLES if (named := _with(users, role))]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "usernames": [name]} for name in users],
        "policies": shared + [{"rules": [f"change as {name}"], "subjects": [name]} for name in operators],
    }


def _rule(name: str, messages: list[str], keys: list[str], flows: list[str] | None = None) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows or ["ingress", "egress"],
        "messages": messages,
        "key_exprs": keys,
    }


def _with(users: dict[str, str], role: str) -> list[str]:
    return [name for name, its_role in users.items() if its_role == role]
