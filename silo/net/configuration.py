"""Configurations of Zenoh: files that people write, remotes by their name, and what silo adds to both.

What a file says wins over what silo would have set, except that nothing is ever broadcast. Paths in it are relative to
its own folder.
"""

import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from silo.core.runtime import user_folder
from silo.errors import ConnectionLostError

if TYPE_CHECKING:
    import zenoh

LOCAL = "local"  # in place of a configuration: the loggers of this computer alone
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_SUFFIX = ".json5"

# always, whatever a file says: nobody is looked for by broadcast, and nobody is told of others
FORCED: dict[str, Any] = {
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    # every restart of a publisher would leave 17 MB locked in its clients
    "transport": {"shared_memory": {"enabled": False}},
}
PORT = 7447  # on which a robot, or a router, listens for others, unless it is told another one

LINK: dict[str, Any] = {
    "transport": {
        # of all ways in together: who comes by the Unix socket must not wait for those of the network
        "unicast": {"open_timeout": 1000, "accept_timeout": 1000, "accept_pending": 4000},
        "link": {
            "tx": {
                "lease": 2000,
                "keep_alive": 4,
                "queue": {"congestion_control": {"block": {"wait_before_close": 200_000}}},
            }
        },
    },
}
# what comes over a network may be slow, and how slow is known to the other side only
SLOW_ACCEPT: dict[str, Any] = {"transport": {"unicast": {"open_timeout": 10_000, "accept_timeout": 10_000}}}
# where both sides have it: a table of 500 elements is 114 kB, of which 14 go over the network
COMPRESSED: dict[str, Any] = {"transport": {"unicast": {"compression": {"enabled": True}}}}
# round trips that may pass until a session is open: 3 of TLS, 3 of Zenoh, and some lost packets; the second time that
# one is lost takes twice as long to notice
OPEN_TRIPS = 40
LEASE_TRIPS = 4
ROBOT_NAME = "robot"  # said by the file that `silo remote init --robot` writes for one robot
HOST_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
PATHS = (
    "transport/link/tls/root_ca_certificate",
    "transport/link/tls/listen_certificate",
    "transport/link/tls/listen_private_key",
    "transport/link/tls/connect_certificate",
    "transport/link/tls/connect_private_key",
    "transport/auth/usrpwd/dictionary_file",
)


def config_folder() -> Path:
    """Return `~/.config/silo`, or as `XDG_CONFIG_HOME` says."""
    return user_folder("XDG_CONFIG_HOME", ".config")


def remote_file(name: str) -> Path:
    """Return where the configuration of a remote stands; XDG_CONFIG_HOME moves the folder."""
    return config_folder() / "remotes" / f"{name}{_SUFFIX}"


def remotes() -> list[str]:
    """Return the names of this user's remotes: networks of robots, where every command looks for loggers, too."""
    try:
        found = [path.name.removesuffix(_SUFFIX) for path in remote_file("x").parent.glob(f"*{_SUFFIX}")]
    except (OSError, RuntimeError):  # no home
        return []
    return sorted(name for name in found if NAME.fullmatch(name))


def scaled(rtt_s: float) -> dict[str, Any]:
    """Return what a client sets for a link of that round trip time: times that leave room for some trips."""
    ms = rtt_s * 1000
    return {
        "transport": {
            "unicast": {"open_timeout": round(1000 + OPEN_TRIPS * ms), "accept_timeout": round(1000 + OPEN_TRIPS * ms)},
            "link": {"tx": {"lease": round(2000 + LEASE_TRIPS * ms)}},
        }
    }


def find_file(config: str) -> str:
    """Return the path of a configuration: a file as it is, or the file of a remote by its name.

    Raises ConnectionLostError for what is neither.
    """
    path = Path(config).expanduser()
    if path.is_file():
        return str(path.absolute())
    known = remotes()
    if config in known:
        return str(remote_file(config))
    names = f"the remotes are {', '.join(known)}" if known else "there are no remotes"
    raise ConnectionLostError(
        f"{config}: there is no such file, and no remote of that name ({names}; `silo remote add` makes one, "
        f"'{LOCAL}' means this computer alone)"
    )


def from_file(config: str) -> "zenoh.Config":
    """Return what a file says, its paths made absolute, and that what goes over the network is compressed.

    Raises ConnectionLostError for what is no configuration.
    """
    import zenoh  # of the folder of settings nobody waits for it

    try:
        settings: zenoh.Config = zenoh.Config.from_file(config)
    except (zenoh.ZError, OSError) as error:
        raise ConnectionLostError(f"{config}: is not a configuration of Zenoh: {reason_of(error)}") from error
    for key in PATHS:
        value = json.loads(settings.get_json(key))
        if value and not os.path.isabs(value):  # noqa: PTH117  # Zenoh has texts
            settings.insert_json5(key, json.dumps(str(Path(config).absolute().parent / value)))
    insert(settings, COMPRESSED, written(config))
    return settings


def written(config: str) -> dict[str, Any]:
    """Return what stands in a file itself; nothing of one that isn't JSON5 (Zenoh reads YAML, too)."""
    import zenoh  # which takes anything for metadata, and so reads the JSON5

    try:
        text = Path(config).read_text(encoding="utf-8")
        found = json.loads(zenoh.Config.from_json5(f"{{metadata: {text}\n}}").get_json("metadata"))
    except (zenoh.ZError, OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def insert(
    settings: "zenoh.Config", values: dict[str, Any], unless: dict[str, Any] | None = None, at: str = ""
) -> None:
    """Set values, except those that `unless` has."""
    for name, value in values.items():
        given = (unless or {}).get(name)
        if isinstance(value, dict):
            insert(settings, value, given if isinstance(given, dict) else {}, f"{at}{name}/")
        elif given is None:
            settings.insert_json5(at + name, json.dumps(value))


def endpoints_of(settings: "zenoh.Config", key: str, mode: str) -> list[str]:
    """Return the endpoints to `connect` to or to `listen` on, in that mode."""
    found = json.loads(settings.get_json(f"{key}/endpoints"))
    if isinstance(found, dict):
        found = found.get(mode, [])
    return list(found)


def listened(settings: "zenoh.Config") -> list[str]:
    """Return what a file says to listen on; nothing if it leaves Zenoh's default, which is the whole network."""
    found = endpoints_of(settings, "listen", "peer")
    return [endpoint for endpoint in found if endpoint not in ("tcp/[::]:0", "tcp/[::]:7447")]


def user_of(settings: "zenoh.Config") -> str:
    """Return the user name of a configuration; empty where it has none."""
    return json.loads(settings.get_json("transport/auth/usrpwd/user")) or ""


def said_of(config: str) -> dict[str, Any]:
    """Return what a file says to silo alone: `metadata: {silo: {...}}`, where Zenoh takes anything."""
    metadata = written(config).get("metadata")
    said = metadata.get("silo") if isinstance(metadata, dict) else None
    return said if isinstance(said, dict) else {}


def robot_named(config: str) -> str:
    """Return as which host a robot comes by a file that was made for one robot alone; empty for any other file."""
    name = said_of(config).get(ROBOT_NAME)
    return name if isinstance(name, str) and re.fullmatch(HOST_NAME, name) else ""


def reason_of(error: Exception | None) -> str:
    """Return Zenoh's words without the places in its sources."""
    text = str(error).split(" at /", 1)[0].strip()
    return text.splitlines()[0][:300] if text else type(error).__name__
