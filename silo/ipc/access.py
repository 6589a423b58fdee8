"""Who may do what, as rules of Zenoh: written by `silo remote init`, and what the examples in `config/` say."""

from typing import Any

ROLES = {"viewer": ("look", "watch"), "operator": ("look", "watch", "change"), "robot": ("serve", "served")}
LOCAL_USER = "local"  # who comes by the Unix socket

_QUERIES = ["query", "reply", "declare_queryable"]
_VALUES = [
    "put", "delete", "declare_subscriber", "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip
# a robot behind a router: it offers and answers, and asks nobody
_OFFERED = ["put", "delete", "reply", "declare_queryable", "liveliness_token"]
_ASKED = [
    "query", "declare_subscriber", "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
]  # fmt: skip
_WATCHED = ("event", "view/*", "stream/*", "topic/**", "alive", "client/*", "summary")


def host_part(host: str) -> str:
    """Return the part of a key that fits the loggers of a host, whatever ids they drew; all hosts for `*`."""
    return host if host == "*" else f"{host}~$*"


def access_control(users: dict[str, str], host: str = "*") -> dict[str, Any]:
    """Return rules that give each user (by name) what the role lets it do, and all to those on the robot itself.

    What no rule allows is denied: a request that is denied gets no answer.
    """
    root = f"silo/{host_part(host)}/*"
    keys = {"look": ["ask"], "watch": list(_WATCHED), "change": ["do"]}
    rules = [
        {
            "id": name,
            "permission": "allow",
            "flows": ["ingress", "egress"],
            "messages": _VALUES if name == "watch" else _QUERIES,
            "key_exprs": [f"{root}/{key}" for key in ends],
        }
        for name, ends in keys.items()
    ]
    if "robot" in users.values():
        for name, flow, messages in (("serve", "ingress", _OFFERED), ("served", "egress", _ASKED)):
            rule = {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": ["silo/**"]}
            rules.append(rule)
    roles = {**users, LOCAL_USER: "operator"}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "usernames": [name]} for name in roles],
        "policies": [
            {"rules": list(rules_of), "subjects": [name for name, role in roles.items() if role == role_name]}
            for role_name, rules_of in ROLES.items()
            if role_name in roles.values()
        ],
    }
