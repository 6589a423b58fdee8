"""Which protocol this silo speaks, and the words for two sides that don't understand each other.

Every request carries the protocol of its client, and `HelloReply` the range that the helper process understands: who
is older is said once, at the connection, and by every answer to a client that doesn't ask. Raise PROTOCOL with any
change that an older side would misread, OLDEST once requests of an older one can't be answered truly any more. Fields
with a default, new requests and new kinds of events need neither.

1: until 0.1.0. 2: marks and bases of columns, unsaved data at a start, requests that go on.
"""

from silo.version import VERSION

PROTOCOL = 2
OLDEST = 2


def client_problem(protocol: int) -> str:
    """Return why a helper process can't answer requests of this protocol; empty if it can."""
    if OLDEST <= protocol <= PROTOCOL:
        return ""
    robot = f"that of the robot ({VERSION}, protocol {PROTOCOL})"
    if protocol < OLDEST:
        return (
            f"the silo of this program is older (protocol {protocol}) than {robot}: update silo on the computer where "
            "this program runs; nothing was changed"
        )
    return (
        f"the silo of this program is newer (protocol {protocol}) than {robot}: update silo on the robot and start its "
        "program again; nothing was changed"
    )


def robot_problem(who: str, protocol: int, oldest: int, version: str) -> str:
    """Return why this silo can't ask a helper process that understands `oldest` to `protocol`; empty if it can."""
    if oldest <= PROTOCOL <= protocol:
        return ""
    mine = f"{VERSION}, protocol {PROTOCOL}"
    if protocol < PROTOCOL:
        return (
            f"{who} runs an older silo ({version}, protocol {protocol}) than this program ({mine}): "
            "update silo on the robot and start its program again"
        )
    return (
        f"{who} runs a newer silo ({version}, protocol {oldest} to {protocol}) than this program ({mine}): "
        "update silo on this computer"
    )
