"""Who is connected to a logger, and who has control: words for the head of the screen and for `:control`."""

import time

from silo.core.elements import Status
from silo.core.quantities.writing import duration_text, many
from silo.net.access.senders import claim_of, is_by, name_of, short_words


def head_words(status: Status, identity: str, own_name: str) -> tuple[str, str]:
    """Return who has control, empty for nobody, and how many others are connected, empty for none.

    `identity` is ours, `own_name` how events speak of us: another program of ours may have it.
    """
    control, holder = status.control, ""
    if control is not None:
        if control.identity != identity:
            holder = f"{name_of(control.identity)} has"
        else:
            holder = "you have" if is_by(control.who, own_name) else f"your {claim_of(control.who).program} has"
    others = len(status.clients) - 1
    return f"{holder} control" if holder else "", many(others, "other client") if others > 0 else ""


def people_words(status: Status, identity: str, own_name: str) -> str:
    """Return who is connected, and who has control since when."""
    control = status.control
    if control is not None:
        mine = control.identity == identity
        ours = mine and is_by(control.who, own_name)
        since_s = max(0.0, time.time() - control.since_ns / 1e9)
        begin = f"{'you have' if ours else f'{control.who} has'} control since {duration_text(since_s)}"
        begin += ", and you with it, as the same user" if mine and not ours else ""
    else:
        begin = "nobody has control" + (", and changes need it (:control take)" if status.one_operator else "")
    short = [short_words(one.who) for one in status.clients]
    names = [
        f"{words if short.count(words) == 1 else one.who}{'' if one.identity else ' looks'}"
        for words, one in zip(short, status.clients, strict=True)
    ]
    return f"{begin}; connected: {', '.join(names) or 'nobody'}"
