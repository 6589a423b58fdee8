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
from silo.ipc.access import QUERIES, VALUES, WATCHED
from silo.ipc.configuration import endpoints_of, listened, said_of
from silo.ipc.keys import ANY_DO, LOCAL_SENDER, user_part
from silo.ipc.probing import endpoint_of

INSECURE = "insecure_allow_unauthenticated_changes"
CHECKED = "router_checks_names"  # said by the file that `silo remote init` writes for robots behind its router
_HERE = ("unixsock-stream", "unixpipe")
_ENCRYPTED = ("tls", "quic")
_FAR = ["tcp", "udp", "tls", "quic", "ws", "serial", "vsock"]  # what Zenoh calls its links, but those of _HERE


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


_LISTENS = "0A"  # in /proc/net/tcp; addresses stand there in words of the processor's byte order
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


def _is_here(endpoint: str) -> bool:
    return _kind(endpoint) in _HERE


def _kind(endpoint: str) -> str:
    return endpoint.partition("/")[0]


def _is_guarded(settings: zenoh.Config, endpoint: str) -> bool:
    """Whether nobody but this computer's users gets in, or whoever gets in has shown who he is."""
    if _is_near(endpoint) or _said(settings, "transport/auth/usrpwd/dictionary_file"):
        return True
    return _kind(endpoint) in _ENCRYPTED and _said(settings, "transport/link/tls/enable_mtls") is True


def _is_near(endpoint: str) -> bool:
    found = endpoint_of(endpoint)
    return _is_here(endpoint) or (found is not None and is_loopback(found.host))


def is_loopback(host: str) -> bool:
    """Return whether an address is of this computer alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _is_open_now(endpoint: str) -> bool:
    """Whether others than this computer's users reach what listens at an endpoint of this computer."""
    found = endpoint_of(endpoint)
    return found is not None and any(not near for near in _listeners(found.port))


def _listeners(port: int) -> list[bool]:
    """Return of each socket that listens on a TCP port whether it does so for this computer alone, as the kernel
    lists them.
    """
    lines = []
    for family in ("tcp", "tcp6"):
        with contextlib.suppress(OSError):
            lines += Path(f"/proc/net/{family}").read_text().splitlines()[1:]
    rows = [line.split()[1].split(":") for line in lines if line.split()[3] == _LISTENS]
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
    """Give those who come by the Unix socket their own key, and nobody else; without rules, let a network do the rest.

    Raises ConnectionLostError for rules that allow what they don't name: they would be of no use.
    """
    root = "silo/*/*"
    keys = [f"{root}/{key}" for key in ("ask", f"do/{LOCAL_SENDER}", *WATCHED)]
    mine = _added("silo: this computer", keys, list(_HERE)[:1])
    rules = _said(settings, "access_control")
    if rules.get("enabled") and rules.get("default_permission") != "deny":
        raise ConnectionLostError(
            f'{config}: access_control must have default_permission: "deny" and rules for what is allowed; with '
            f'"{rules.get("default_permission")}" everybody could change things in the name of this computer\'s user'
        )
    # `**` fits no part that begins with `@`
    added = [mine] if rules.get("enabled") else [mine, _added("silo: the network", ["**"], _FAR)]
    _add(settings, rules, added)


def keep_changes_out(settings: zenoh.Config) -> None:
    """Have a router let nobody change anything, whoever the rules admit."""
    rules = _said(settings, "access_control")
    denied = {
        "id": "silo: no changes",
        "permission": "deny",
        "flows": ["ingress", "egress"],
        "messages": QUERIES,
        "key_exprs": [ANY_DO, f"silo/*/*/do/{LOCAL_SENDER}"],
    }
    if not rules.get("enabled"):
        rules = {"policies": []}
        _add(settings, rules, [_added("silo: the network", ["**"], _FAR)])
        rules = _said(settings, "access_control")
    # denied in every policy: Zenoh lets pass what one of the subjects that somebody is may do
    policies = [{**policy, "rules": [*policy["rules"], denied["id"]]} for policy in rules["policies"]]
    changed = {**rules, "rules": [*(rules.get("rules") or []), denied], "policies": policies}
    settings.insert_json5("access_control", json.dumps(changed))


def _added(name: str, keys: list[str], links: list[str]) -> dict[str, Any]:
    rule = {
        "id": name,
        "permission": "allow",
        "flows": ["ingress", "egress"],
        "messages": [*QUERIES, *VALUES],
        "key_exprs": keys,
    }
    return {"rule": rule, "subject": {"id": name, "link_protocols": links}}


def _add(settings: zenoh.Config, rules: dict[str, Any], added: list[dict[str, Any]]) -> None:
    names = [one["rule"]["id"] for one in added]
    changed = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*(rules.get("rules") or []), *(one["rule"] for one in added)],
        "subjects": [*(rules.get("subjects") or []), *(one["subject"] for one in added)],
        "policies": [*(rules.get("policies") or []), *({"rules": [name], "subjects": [name]} for name in names)],
    }
    settings.insert_json5("access_control", json.dumps(changed))
