"""Who is connected to a logger, and who has control: words for the head of the screen and for `:control`."""

import time

from silo.core.elements import Status
from silo.core.quantities.writing import duration_text, many
from silo.net.access.senders import name_of, short_words


def head_words(status: Status, identity: str) -> tuple[str, str]:
    """Return who has control, empty for nobody, and how many others are connected, empty for none."""
    control = status.control
    holder = (
        "" if control is None else "you have" if control.identity == identity else f"{name_of(control.identity)} has"
    )
    others = len(status.clients) - 1
    return f"{holder} control" if holder else "", many(others, "other client") if others > 0 else ""


def people_words(status: Status, identity: str) -> str:
    """Return who is connected, and who has control since when."""
    control = status.control
    if control is not None:
        mine = control.identity == identity
        since_s = max(0.0, time.time() - control.since_ns / 1e9)
        begin = f"{'you have' if mine else f'{control.who} has'} control since {duration_text(since_s)}"
    else:
        begin = "nobody has control" + (", and changes need it (:control take)" if status.one_operator else "")
    names = [f"{short_words(one.who)}{'' if one.identity else ' looks'}" for one in status.clients]
    return f"{begin}; connected: {', '.join(names) or 'nobody'}"
