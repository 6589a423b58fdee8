"""How `rmw_zenoh` names what is in a ROS 2 graph, and what goes with each message. Pure rules, no session.

Source: docs/design.md, liveliness_utils.cpp and attachment_helpers.cpp of github.com/ros2/rmw_zenoh.
Attachments are those since April 2025 (Humble 0.1.2, Jazzy 0.2.4, all of Kilted and later): before, texts stood between
the numbers.
"""

import re
import struct
from dataclasses import dataclass
from enum import Enum

import xxhash

QOS = "::,10:,:,:,,"  # reliable, volatile, keep the last ten; what is empty is rmw_zenoh's default
NO_HASH = "TypeHashNotSupported"
TRIGGER = "std_srvs/srv/Trigger"
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
GID_BYTES = 16


class Distribution(str, Enum):
    """A distribution of ROS 2 that has rmw_zenoh."""

    HUMBLE = "humble"
    JAZZY = "jazzy"
    KILTED = "kilted"
    LYRICAL = "lyrical"
    ROLLING = "rolling"

    def hash_of(self, type_hash: str) -> str:
        """Return how a type's hash stands in keys: Humble has none."""
        return NO_HASH if self is Distribution.HUMBLE else type_hash


class EntityKind(str, Enum):
    """What a liveliness token stands for."""

    PUBLISHER = "MP"
    SERVICE = "SS"


@dataclass(frozen=True)
class Node:
    """A node of the graph, the only one of its Zenoh session."""

    domain: int
    session: str  # the session's Zenoh id
    name: str

    @property
    def token(self) -> str:
        """The liveliness token that makes it a node."""
        return f"@ros2_lv/{self.domain}/{self.session}/0/0/NN/%/%/{self.name}"

    def key(self, name: str, type_name: str, type_hash: str) -> str:
        """Return the key of a topic's messages, or of a service."""
        return f"{self.domain}/{name.strip('/')}/{dds_name(type_name)}/{type_hash}"

    def entity_token(self, number: int, kind: EntityKind, name: str, type_name: str, type_hash: str) -> str:
        """Return the liveliness token of a publisher or service; `number` is its own within the node, from 1."""
        return (
            f"@ros2_lv/{self.domain}/{self.session}/0/{number}/{kind.value}/%/%/{self.name}/"
            f"{name.replace('/', '%')}/{dds_name(type_name)}/{type_hash}/{QOS}"
        )


@dataclass(frozen=True)
class Attachment:
    """What goes with a message or a request: its number from 1, when it came to be, whose it is."""

    sequence: int
    time_ns: int
    gid: bytes

    def encoded(self) -> bytes:
        """Return its bytes."""
        return struct.pack("<qqB", self.sequence, self.time_ns, GID_BYTES) + self.gid

    @classmethod
    def decoded(cls, data: bytes) -> "Attachment":
        """Return what bytes say. Raises ValueError for bytes that are none."""
        if len(data) != 17 + GID_BYTES or data[16] != GID_BYTES:
            raise ValueError(f"an attachment of {len(data)} bytes is none of rmw_zenoh")
        sequence, time_ns = struct.unpack_from("<qq", data)
        return cls(sequence, time_ns, data[17:])


def gid_of(token: str) -> bytes:
    """Return the id of an entity: the XXH3 hash of its token, the low half first."""
    return bytes(xxhash.xxh3_128_digest(token.encode())[::-1])


def dds_name(type_name: str) -> str:
    """Return a type as it stands in keys: `std_msgs/msg/String` is `std_msgs::msg::dds_::String_`."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_name(text: str) -> str:
    """Return a text as a name that ROS 2 takes: letters, digits, single underscores, a letter first."""
    name = re.sub("_+", "_", re.sub("[^A-Za-z0-9]", "_", text)).strip("_")
    return name if name[:1].isalpha() else f"silo_{name}".rstrip("_")
