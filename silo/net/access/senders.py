"""Who asks for a change: words for a sender, as events, consoles and screens show them; words for who may not.

anna (proven) from desk2, silo-tui 4711       a network that checks names; host and program are what the client says
anna (says so) from desk2, silo 4712          a way in that checks none
bob (says so) of group lab, silo 4713         the Unix socket that a group shares
anna@robot3 silo 4714                         the Unix socket of the robot's own user
"""

from typing import NamedTuple

from silo.core.elements import ROBOT_PROGRAM

PROVEN, SAYS_SO = " (proven)", " (says so)"


class Claim(NamedTuple):
    """What a client says of itself: `alice@laptop silo-tui 4711`."""

    user: str
    host: str
    program: str


def claim_of(client: str) -> Claim:
    """Read what a client says of itself; nobody can claim to be proven."""
    who, _, program = bracketed(client).partition(" ")
    user, _, host = who.partition("@")
    return Claim(user or "somebody", host, program)


def network_words(user: str, client: str, *, proven: bool) -> str:
    """Return who sent a change over a network: `user` by its key, `client` as it names itself."""
    claim = claim_of(client)
    place = f" from {claim.host}" if claim.host else ""
    # where nobody checks names, one may be `anna (proven)`, or move a terminal's cursor
    name = "".join(letter if letter.isprintable() else "?" for letter in bracketed(user))
    return f"{name}{PROVEN if proven else SAYS_SO}{place}{_with(claim.program)}"


def group_words(group: str, client: str) -> str:
    """Return who of a group sent a change: its members are known together, not one by one."""
    claim = claim_of(client)
    return f"{claim.user}{SAYS_SO} of group {group}{_with(claim.program)}"


def on_behalf(by: str, who: str) -> str:
    """Return who is meant by what somebody does in another's name: that one on the robot's own computer, else both."""
    if not who:
        return by
    return f"{by} for {bracketed(who)}" if PROVEN in by or SAYS_SO in by else bracketed(who)


def bracketed(claimed: str) -> str:
    """Return what somebody says of itself, in which nothing reads as a word of ours."""
    return claimed.replace("(", "[").replace(")", "]")


def _with(program: str) -> str:
    return f", {program}" if program else ""


def short_words(who: str) -> str:
    """Return who it was, without place and program: `anna (proven)`, `bob (says so)`, `carol@robot3`."""
    if who == ROBOT_PROGRAM:
        return who
    name = who.partition(" ")[0]
    return next((name + mark for mark in (PROVEN, SAYS_SO) if who.startswith(name + mark)), name)


def is_by(who: str, client: str) -> bool:
    """Return whether these words are of the client that names itself so."""
    claim = claim_of(client)
    return who == bracketed(client) or (bool(claim.program) and who.endswith(f" from {claim.host}, {claim.program}"))


def came_by_network(who: str) -> bool:
    """Return whether these words are of somebody who is not on the robot."""
    return PROVEN in who or (SAYS_SO in who and f"{SAYS_SO} of group " not in who)


# -------------------------------------------------------------------------------------------------- who may not


def viewer_words(user: str, logger: str) -> str:
    """Return what a viewer is told who wants to change something: the same by `silo` and `silo-tui`."""
    who = f"user '{user}'" if user else "this user"
    return (
        f"{who} may look at {logger}, not change it: the role is viewer (or none); whoever runs the robot makes an "
        f"operator by `silo remote init FOLDER --user {user or 'NAME'}:operator`; nothing was changed"
    )


def group_viewer_words(group: str, logger: str) -> str:
    """Return the same to a member of a group."""
    return (
        f"group '{group}' may look at {logger}, not change it: its role is viewer (the program says "
        f'log.serve(group="{group}", group_role="viewer")); nothing was changed'
    )


def closed_words(logger: str, why: str) -> str:
    """Return what everybody is told over a network from which no changes are taken."""
    return f"{logger} takes no changes from this network: {why}; nothing was changed"


READ_ONLY = "this is read-only (--read-only, SILO_READ_ONLY or read_only=True): nothing that changes is sent"
READ_ONLY_WORDS = f"{READ_ONLY}; connect without it to change something; nothing was changed"


# ------------------------------------------------------------------------------------------------ who has control


def local_identity(user: str) -> str:
    """Return what tells a user of the robot itself from others, who may have the same name."""
    return f"@local {user}"


def group_identity(user: str) -> str:
    """Return what tells a member of the group from others."""
    return f"@group {user}"


def name_of(identity: str) -> str:
    """Return the name of a user."""
    return identity.removeprefix("@local ").removeprefix("@group ")
