"""What a robot, or a router, takes from whom: judged by its configuration before anybody can connect.

Zenoh authenticates links, so a name in a key is proven where every way in is guarded by rules that admit each user to
its own key. Over a way that anybody can take, nothing that changes something is offered at all.
"""

import contextlib
import ipaddress
import json
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from silo.errors import ConnectionLostError
from silo.net.access.probing import endpoint_of
from silo.net.access.rights import Rule, allowed, local_rules, open_rules
from silo.net.configuration import endpoints_of, listened, said_of
from silo.net.keys import ANY_DO, LOCAL_SENDER, user_part

INSECURE = "insecure_allow_unauthenticated_changes"
CHECKED = "router_checks_names"  # said by the file that `silo remote init` writes for robots behind its router
_HERE = ("unixsock-stream", "unixpipe")
_ENCRYPTED = ("tls", "quic")
_FAR = ("tcp", "udp", "tls", "quic", "ws", "serial", "vsock")  # what Zenoh calls its links, but those of _HERE
_BOTH = ["ingress", "egress"]
_CHANGE = ("query", "reply", "declare_queryable")
_MESSAGES = (
    *_CHANGE, "put", "delete", "declare_subscriber", "liveliness_token", "liveliness_query",
    "declare_liveliness_subscriber",
)  # fmt: skip


class Admission(NamedTuple):
    """Whether changes are taken from a network (`why` says why not), and whether the names of who sends them hold.

    `routers` are endpoints of routers on this computer, from which they are taken while nobody else reaches those.
    """

    changes: bool
    proven: bool
    why: str = ""
    routers: tuple[str, ...] = ()

    @property
    def why_now(self) -> str:
        """Return why no changes are taken at this moment; empty where they are."""
        return self.why or next((_why_unknown(one) for one in self.routers if _is_open_now(one)), "")


# the state of what listens in /proc/net/; addresses stand there in words of the processor's byte order
_LISTENS = {"tcp": "0A", "udp": "07"}
_LOOPBACK_6 = ("00000000000000000000000001000000", "00000000000000000000000000000001")
_MAPPED = "0000000000000000FFFF0000"

NO_NETWORK = Admission(False, False)


def admission_of(settings: zenoh.Config, config: str) -> Admission:
    """Return what a robot may take from those who come by the ways of a configuration."""
    taken, joined = listened(settings), endpoints_of(settings, "connect", "peer")
    if not taken and not joined:
        return NO_NETWORK
    said = said_of(config)
    unknown = [one for one in joined if _kind(one) not in _ENCRYPTED]
    near = tuple(one for one in unknown if _is_near(one))
    closed = next((_why_open(one) for one in taken if not _is_guarded(settings, one)), "")
    closed = closed or next((_why_unknown(one) for one in unknown if one not in near), "")
    if said.get(INSECURE) is True:
        closed, near = "", ()
    names_hold = not taken or rules_hold_names(settings)
    proven = not closed and names_hold and not unknown and (not joined or said.get(CHECKED) is True)
    return Admission(not closed, proven, closed, near)


def router_admission(settings: zenoh.Config, endpoints: list[str], config: str) -> Admission:
    """Return what a router that listens on these may let through."""
    closed = next((_why_open(one) for one in endpoints if not _is_guarded(settings, one)), "")
    if closed and said_of(config).get(INSECURE) is not True:
        return Admission(False, False, closed)
    return Admission(True, not closed and rules_hold_names(settings))


def _kind(endpoint: str) -> str:
    return endpoint.partition("/")[0]


def _is_guarded(settings: zenoh.Config, endpoint: str) -> bool:
    """Whether nobody but this computer's users gets in, or whoever gets in has shown who he is."""
    if _is_near(endpoint) or _said(settings, "transport/auth/usrpwd/dictionary_file"):
        return True
    return _kind(endpoint) in _ENCRYPTED and _said(settings, "transport/link/tls/enable_mtls") is True


def _is_near(endpoint: str) -> bool:
    found = endpoint_of(endpoint)
    return _kind(endpoint) in _HERE or (found is not None and is_loopback(found.host))


def is_loopback(host: str) -> bool:
    """Return whether an address is of this computer alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _is_open_now(endpoint: str) -> bool:
    """Whether others than this computer's users reach what listens at an endpoint of this computer."""
    found = endpoint_of(endpoint)
    return found is not None and any(not near for near in _listeners(found.kind, found.port))


def _listeners(kind: str, port: int) -> list[bool]:
    """Return of each socket that listens on a port whether it does so for this computer alone, as the kernel lists
    them.
    """
    family = "udp" if kind == "udp" else "tcp"
    lines = []
    for name in (family, f"{family}6"):
        with contextlib.suppress(OSError):
            lines += Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    rows = [line.split()[1].split(":") for line in lines if line.split()[3] == _LISTENS[family]]
    return [address in _LOOPBACK_6 or ((len(address) == 8 or address.startswith(_MAPPED)) and address.endswith("7F"))
            for address, at in rows if int(at, 16) == port]  # fmt: skip


def _said(settings: zenoh.Config, key: str) -> Any:
    return json.loads(settings.get_json(key))


_WAY_OUT = (
    "`silo remote init` makes certificates, users and roles; who wants it open all the same writes "
    f"metadata: {{ silo: {{ {INSECURE}: true }} }} into the file"
)


def _why_open(endpoint: str) -> str:
    return (
        f"anybody who reaches {endpoint} could change things: it asks nobody for a password or a certificate, so it is "
        f"for looking alone; {_WAY_OUT}"
    )


def _why_unknown(endpoint: str) -> str:
    return (
        f"nobody knows who is behind the router at {endpoint}: it shows no certificate, so it is for looking alone; "
        f"{_WAY_OUT}"
    )


def rules_hold_names(settings: zenoh.Config) -> bool:
    """Return whether rules admit each user, and no other, to the key of its name."""
    rules = _said(settings, "access_control")
    if not rules.get("enabled") or rules.get("default_permission") != "deny":
        return False
    changing = {rule["id"]: rule["key_exprs"] for rule in rules.get("rules") or [] if _lets_change(rule)}
    subjects = {subject["id"]: subject for subject in rules.get("subjects") or []}
    admitted = [
        (subjects.get(subject, {}), key)
        for policy in rules.get("policies") or []
        for subject in policy["subjects"]
        for rule in policy["rules"]
        for key in changing.get(rule, [])
    ]
    return all(_is_own(subject, key) for subject, key in admitted if zenoh.KeyExpr(key).intersects(ANY_DO))


def _lets_change(rule: dict[str, Any]) -> bool:
    return bool(
        rule["permission"] == "allow" and "query" in rule["messages"] and "ingress" in (rule["flows"] or ["ingress"])
    )


def _is_own(subject: dict[str, Any], key: str) -> bool:
    names = [*(subject.get("usernames") or []), *(subject.get("cert_common_names") or [])]
    return [user_part(name) for name in names] == [key.rsplit("/", 1)[1]]


# ------------------------------------------------------------------------------------------ rules that silo adds


def let_local_in(settings: zenoh.Config, config: str) -> None:
    """Give those who come by the Unix socket what an operator may, under their own key.

    Without rules, those who come by a network get the same; those whom the robot itself connects to, which are routers,
    may ask and tell it all. Raises ConnectionLostError for rules that allow what they don't name: they would be of no
    use.
    """
    rules = _said(settings, "access_control")
    if rules.get("enabled") and rules.get("default_permission") != "deny":
        raise ConnectionLostError(
            f'{config}: access_control must have default_permission: "deny" and rules for what is allowed; with '
            f'"{rules.get("default_permission")}" everybody could change things in the name of this computer\'s user'
        )
    added = [_Added("silo: this computer", local_rules("silo: this computer"), _HERE[:1])]
    if not rules.get("enabled"):
        routers = {_kind(one) for one in endpoints_of(settings, "connect", "peer")}
        others = tuple(kind for kind in _FAR if kind not in routers)
        if routers:
            added.append(_all("silo: routers", tuple(sorted(routers))))
        added.append(_Added("silo: the network", open_rules("silo: the network"), others))
    _add(settings, rules, added)


def keep_changes_out(settings: zenoh.Config) -> None:
    """Have a router let nobody change anything, whoever the rules admit."""
    rules = _said(settings, "access_control")
    keys = [ANY_DO, f"silo/*/*/do/{LOCAL_SENDER}"]
    denied = {**allowed("silo: no changes", "ingress", _CHANGE, keys), "permission": "deny", "flows": _BOTH}
    if not rules.get("enabled"):
        rules = {"policies": []}
        _add(settings, rules, [_all("silo: the network", _FAR)])
        rules = _said(settings, "access_control")
    # denied in every policy: Zenoh lets pass what one of the subjects that somebody is may do
    policies = [{**policy, "rules": [*policy["rules"], denied["id"]]} for policy in rules["policies"]]
    changed = {**rules, "rules": [*(rules.get("rules") or []), denied], "policies": policies}
    settings.insert_json5("access_control", json.dumps(changed))


class _Added(NamedTuple):
    """Rules for those who come by some kinds of links."""

    name: str
    rules: list[Rule]
    links: tuple[str, ...]


def _all(name: str, links: tuple[str, ...]) -> _Added:
    # `**` fits no part that begins with `@`
    return _Added(name, [{**allowed(name, "ingress", _MESSAGES, ["**"]), "flows": _BOTH}], links)


def _add(settings: zenoh.Config, rules: dict[str, Any], added: list[_Added]) -> None:
    changed = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*(rules.get("rules") or []), *(rule for one in added for rule in one.rules)],
        "subjects": [
            *(rules.get("subjects") or []),
            *({"id": one.name, "link_protocols": list(one.links)} for one in added),
        ],
        "policies": [
            *(rules.get("policies") or []),
            *({"rules": [rule["id"] for rule in one.rules], "subjects": [one.name]} for one in added),
        ],
    }
    settings.insert_json5("access_control", json.dumps(changed))


# ------------------------------------------------------------------------------- rules of silo before directions


def hold_directions(settings: zenoh.Config) -> list[str]:
    """Take rules that allow people both to send and to get everything as the table has it: what an older silo wrote
    let a viewer answer, publish and be there in the name of a robot. Returns the names of such rules.

    Rules of one direction are as they were meant; one that goes for all users' changes is that of a robot.
    """
    rules = _said(settings, "access_control")
    old = [rule for rule in rules.get("rules") or [] if _is_of_both(rule)]
    if not rules.get("enabled") or not old:
        return []
    parts = {rule["id"]: _by_direction(rule) for rule in old}
    changed = {
        **rules,
        "rules": [one for rule in rules["rules"] for one in parts.get(rule["id"], [rule])],
        "policies": [
            {
                **policy,
                "rules": [
                    one
                    for name in policy["rules"]
                    for one in ([rule["id"] for rule in parts[name]] if name in parts else [name])
                ],
            }
            for policy in rules.get("policies") or []
        ],
    }
    settings.insert_json5("access_control", json.dumps(changed))
    return list(parts)


def direction_words(config: str, names: list[str]) -> str:
    """Return what is said of such rules."""
    return (
        f"{config}: {', '.join(names)}: rules that an older silo made let people both send and get; they are held as "
        "those of people now, so nobody but robots answers and publishes; `silo remote init FOLDER`, with the folder "
        "that it was made in, writes them so (zenohd needs that)"
    )


def _is_of_both(rule: Rule) -> bool:
    flows = rule.get("flows") or _BOTH
    both = rule["permission"] == "allow" and set(flows) == set(_BOTH)
    keys = [zenoh.KeyExpr(key) for key in rule["key_exprs"]]
    every = zenoh.KeyExpr("silo/robot~1/logger/do/*")
    return both and not any(key.includes(every) for key in keys) and any(map(_is_ours, keys))


def _is_ours(key: zenoh.KeyExpr) -> bool:
    return any(key.intersects(zenoh.KeyExpr(one)) for right in open_rules("") for one in right["key_exprs"])


def _by_direction(rule: Rule) -> list[Rule]:
    """Return the part of a rule that the table has for people, by direction; what isn't silo's stays as it is."""
    made = []
    for at, right in enumerate(open_rules("")):
        keys = [met for key in rule["key_exprs"] for one in right["key_exprs"] if (met := _what_both_have(key, one))]
        messages = [one for one in right["messages"] if one in rule["messages"]]
        if keys and messages:
            made.append(allowed(f"{rule['id']} {at}", right["flows"][0], messages, keys))
    others = [key for key in rule["key_exprs"] if not _is_ours(zenoh.KeyExpr(key))]
    return [*made, *([{**rule, "id": f"{rule['id']} others", "key_exprs": others}] if others else [])]


def _what_both_have(key: str, other: str) -> str:
    """Return the narrower of two keys, empty where neither includes the other."""
    if zenoh.KeyExpr(other).includes(zenoh.KeyExpr(key)):
        return key
    return other if zenoh.KeyExpr(key).includes(zenoh.KeyExpr(other)) else ""
