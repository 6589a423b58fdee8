"""What `silo remote init` makes: an authority of its own, a certificate for the robot, users, and a file for each.

By the `openssl` command, which a desk needs for this once a year; a Python package for it would be 4 MB more on every
robot, and another wheel to find for its processor. Keys never pass through this process.
"""

import base64
import ipaddress
import json
import re
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from silo.core.runtime import write_private
from silo.errors import SiloError
from silo.net.access.admission import CHECKED
from silo.net.access.rights import ROBOT, SHARED, USER_ROLES, VIEWER, access_control
from silo.net.configuration import HOST_NAME, LINK, PORT, ROBOT_NAME

AUTHORITY_DAYS, ROBOT_DAYS = 3650, 825
LEASE_MS = 5000  # of a radio link: a packet that is sent three times may take 3 s

_REQUEST = """[req]
distinguished_name = name
prompt = no
x509_extensions = authority
[name]
CN = {name}
[authority]
basicConstraints = critical, CA:TRUE
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
[robot]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = serverAuth, clientAuth
subjectAltName = {names}
"""


EVERYWHERE = "0.0.0.0"
_ENDPOINT = re.compile(r'"tls/([^"/]*):(\d+)"')


@dataclass(frozen=True)
class Made:
    """What was written: `server` goes to the robot or the router, each of `clients` to the user, or robot, of that
    name; those of `robots` connect to a router.
    """

    folder: Path
    server: Path
    clients: dict[str, Path]
    robots: tuple[str, ...] = ()


def make_network(
    folder: Path,
    hosts: list[str],
    port: int | None,
    users: dict[str, str],
    listen: str | None = None,
    removed: Collection[str] = (),
) -> Made:
    """Make, add to, or take from, a folder with authority, certificate, users and files to hand out.

    The authority that is there stays, and so do users and their passwords, and names, address and port that aren't
    given; the certificate is renewed. `users` gives a role to each name, `removed` are let in no more. Raises SiloError
    with the reason where something can't be made.
    """
    for host in hosts:
        check_host(host)
    server, clients = folder / "server", folder / "clients"
    known = _known(folder)
    check_roles(known["users"], users)
    _check_removed(known["users"], users, removed)
    for each in (folder, server, clients):
        each.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not (folder / "ca-key.pem").exists():
        _make_authority(folder)
    port, listen = port or known["port"], listen or known["listen"]
    hosts = hosts or known["hosts"]
    if not hosts:
        raise SiloError("say by which name or address the robot is reached: `silo remote init --host robot3.local`")
    kept = {name: role for name, role in known["users"].items() if name not in removed}
    roles: dict[str, str] = {**kept, **users}
    _make_certificate(folder, server, hosts)
    passwords = _passwords(server / "users.txt", list(roles))
    write_private(server / "users.txt", "".join(f"{name}:{password}\n" for name, password in passwords.items()))
    write_private(server / "server.json5", _server_text(hosts, port, roles, listen))
    for name in removed:
        (clients / f"{name}.json5").unlink(missing_ok=True)
    made = {}
    for name, role in roles.items():
        made[name] = clients / f"{name}.json5"
        write_private(made[name], _client_text(folder, hosts[0], port, name, passwords[name], role))
    facts = {"hosts": hosts, "users": roles, "port": port, "listen": listen}
    write_private(folder / "network.json", json.dumps(facts, indent=2) + "\n")
    return Made(folder, server, made, tuple(name for name, role in roles.items() if role == ROBOT))


def role_of(word: str) -> tuple[str, str]:
    """Read `alice:operator`. Raises SiloError."""
    name, _, role = word.partition(":")
    role = role or VIEWER
    if role not in USER_ROLES or not name.isascii() or not name.replace("_", "").replace("-", "").isalnum():
        raise SiloError(
            f"--user takes NAME:ROLE, of letters and digits and {' or '.join(USER_ROLES)}, got '{word}'; "
            "nothing was made"
        )
    if name == "local":
        raise SiloError("the user 'local' is who works on the robot itself; take another name; nothing was made")
    return name, role


def robot_of(name: str) -> tuple[str, str]:
    """Read the host name of a robot behind a router. Raises SiloError."""
    if not re.fullmatch(HOST_NAME, name) or name in ("local", SHARED):
        raise SiloError(
            f"--robot takes the host name of one robot, letters, digits, _ . and -, and not 'local' or '{SHARED}', got "
            f"'{name}'; nothing was made"
        )
    return name, ROBOT


def check_host(host: str) -> None:
    """Raise SiloError for what is neither a name nor an address of a computer."""
    if not _is_address(host) and not re.fullmatch(HOST_NAME, host):
        raise SiloError(
            f"--host takes a name or an address, as robot3.local or 10.0.0.7, got '{host}'; nothing was made"
        )


def _check_removed(known: dict[str, str], users: dict[str, str], removed: Collection[str]) -> None:
    for name in removed:
        if name not in known:
            there = ", ".join(known) or "none"
            raise SiloError(f"there is no user '{name}' to remove (there are: {there}); nothing was changed")
        if name in users:
            raise SiloError(f"'{name}' can't be removed and made at once; nothing was changed")


def check_roles(known: dict[str, str], users: dict[str, str]) -> None:
    """Raise SiloError where a name of a robot is that of a person, or the other way round: its file is out there."""
    for name, role in users.items():
        if name in known and (known[name] == ROBOT) != (role == ROBOT):
            raise SiloError(
                f"'{name}' has the role {known[name]} here, and can't be {role} too: take another name; nothing was "
                "changed"
            )


def _known(folder: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads((folder / "network.json").read_text())
    except FileNotFoundError:
        found = {"hosts": [], "users": {}}
    # an older silo wrote them into the file of the server alone
    file = folder / "server" / "server.json5"
    written = _ENDPOINT.search(file.read_text()) if file.exists() else None
    listen, port = (written[1].strip("[]"), int(written[2])) if written else (EVERYWHERE, PORT)
    return {"port": port, "listen": listen, **found}


def _passwords(file: Path, names: list[str]) -> dict[str, str]:
    lines = file.read_text().splitlines() if file.exists() else []
    known = dict(line.split(":", 1) for line in lines if ":" in line)
    return {name: known.get(name) or secrets.token_urlsafe(12) for name in names}


def _make_authority(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as place:
        request = Path(place) / "request"
        request.write_text(_REQUEST.format(name="silo authority", names="DNS:unused"))
        _openssl(
            "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-config", str(request),
            "-days", str(AUTHORITY_DAYS), "-keyout", str(folder / "ca-key.pem"), "-out", str(folder / "ca.pem"),
        )  # fmt: skip
    (folder / "ca-key.pem").chmod(0o600)


def _make_certificate(folder: Path, server: Path, hosts: list[str]) -> None:
    names = ", ".join(f"{'IP' if _is_address(host) else 'DNS'}:{host}" for host in hosts)
    with tempfile.TemporaryDirectory() as place:
        request, signing = Path(place) / "request", Path(place) / "csr"
        request.write_text(_REQUEST.format(name=hosts[0], names=names))
        _openssl(
            "req", "-new", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-config", str(request),
            "-keyout", str(server / "key.pem"), "-out", str(signing),
        )  # fmt: skip
        _openssl(
            "x509", "-req", "-in", str(signing), "-CA", str(folder / "ca.pem"), "-CAkey", str(folder / "ca-key.pem"),
            "-set_serial", f"0x{secrets.token_hex(8)}", "-days", str(ROBOT_DAYS), "-extfile", str(request),
            "-extensions", "robot", "-out", str(server / "certificate.pem"),
        )  # fmt: skip
    (server / "key.pem").chmod(0o600)
    shutil.copy(folder / "ca.pem", server / "ca.pem")


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _openssl(*words: str) -> None:
    try:
        done = subprocess.run(["openssl", *words], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise SiloError(
            "certificates are made by the command openssl, which isn't here: sudo apt install openssl"
        ) from None
    if done.returncode:
        raise SiloError(f"openssl {words[0]} failed: {done.stderr.strip().splitlines()[-1:] or done.returncode}")


def _at(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _server_text(hosts: list[str], port: int, roles: dict[str, str], listen: str) -> str:
    values = {
        "listen": {"endpoints": [f"tls/{_at(listen)}:{port}"]},
        "transport": {
            "auth": {"usrpwd": {"dictionary_file": "users.txt"}},
            "link": {
                "tls": {
                    "root_ca_certificate": "ca.pem",
                    "listen_certificate": "certificate.pem",
                    "listen_private_key": "key.pem",
                },
                "tx": {**LINK["transport"]["link"]["tx"], "lease": LEASE_MS},
            },
        },
        "access_control": access_control(roles),
    }
    words = ", ".join(f"{name} ({role})" for name, role in roles.items())
    return (
        f"// Made by `silo remote init` for {', '.join(hosts)}; users: {words}.\n"
        '// For a robot program, log.serve(config="server.json5"), in its folder. Users that are added count from the\n'
        "// next start of the robot program on.\n" + json.dumps(values, indent=2) + "\n"
    )


def _client_text(folder: Path, host: str, port: int, name: str, password: str, role: str) -> str:
    """The file of a user, or of a robot that connects to a router."""
    words = (
        f"// Lets {name} in as {role}; it holds a password: for {name} alone.\n"
        f"//     silo remote add robots {name}.json5\n"
    )
    values: dict[str, Any] = {
        "connect": {"endpoints": [f"tls/{_at(host)}:{port}"]},
        "transport": {
            "auth": {"usrpwd": {"user": name, "password": password}},
            "link": {
                "tls": {"root_ca_certificate_base64": base64.b64encode((folder / "ca.pem").read_bytes()).decode()}
            },
        },
    }
    if role == ROBOT:
        whom, own = ("robots", {}) if name == SHARED else (f"the robot {name}, and no other,", {ROBOT_NAME: name})
        words = (
            f"// Connects {whom} to the router on {host}; it holds a password.\n"
            f'//     log.serve(config="{name}.json5")\n'
            "// That router admits each user to its own name alone, so robots say of who changed something: proven.\n"
        )
        values["metadata"] = {"silo": {CHECKED: True, **own}}
    return words + json.dumps(values, indent=2) + "\n"
