"""Who is connected to a logger, and who has control: words for the head of the screen and for `:control`."""

from silo.core.elements import Status
from silo.core.quantities.writing import many, since_text
from silo.net.access.senders import claim_of, is_by, name_of, short_words


def head_words(status: Status, identity: str, own_name: str) -> tuple[str, str]:
    """Return who has control, empty for nobody, and how many others are connected, empty for none.

    `identity` is ours, `own_name` how events speak of us: another program of ours may have it.
    """
    control, holder = status.control, ""
    if control is not None:
        if control.identity != identity:
            holder = f"{name_of(control.identity)} has control"
        else:  # another program of the same user, who may change all the same
            its = "" if is_by(control.who, own_name) else f" in {claim_of(control.who).program}"
            holder = f"you have control{its}"
    others = len(status.clients) - 1
    return holder, many(others, "other client") if others > 0 else ""


def operators(status: Status) -> list[str]:
    """Return the names of those that control can be given to."""
    return sorted({name_of(one.identity) for one in status.clients if one.identity})


def people_words(status: Status, identity: str, own_name: str) -> str:
    """Return who is connected, and who has control since when."""
    control = status.control
    if control is not None:
        mine = control.identity == identity
        ours = mine and is_by(control.who, own_name)
        begin = f"{'you have' if ours else f'{control.who} has'} control since {since_text(control.since_ns)}"
        begin += ", and you with it, as the same user" if mine and not ours else ""
    else:
        begin = "nobody has control" + (", and changes need it (:control take)" if status.one_operator else "")
    short = [short_words(one.who) for one in status.clients]
    names = [
        f"{words if short.count(words) == 1 else one.who}{' (this one)' * is_by(one.who, own_name)}"
        f"{'' if one.identity else ' looks'}"
        for words, one in zip(short, status.clients, strict=True)
    ]
    return f"{begin}; connected: {', '.join(names) or 'nobody'}"
