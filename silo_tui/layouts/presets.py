"""Views that are there without being kept: what one looks for first on a robot that one doesn't know."""

import re
from collections.abc import Sequence

import msgspec

from silo.conditions.standing import LimitStatus
from silo.core.quantities.writing import many
from silo_tui.layouts.layout import KeptLayout
from silo_tui.model.table.columns import LIMIT, NOISE

NEAR = "near-limit"
TEN = 10  # rows: a vector is one, by its norm, which the column shows then
NEAR_SHARE = 0.1  # of the range between two bounds, or of the only one


class Preset(msgspec.Struct, frozen=True):
    """One of them: its name, the letter that chooses it, what it shows."""

    name: str
    letter: str
    words: str
    layout: KeptLayout
    shown: str = ""  # what its filter lets pass: nobody typed that


PRESETS = (
    Preset(
        "hottest",
        "h",
        "Hottest ten: temperatures, highest on top now; rows then stay",
        KeptLayout(sort="value", filter="unit:degC", most=TEN),
        "temperatures",
    ),
    Preset(
        "noisiest",
        "n",
        "Noisiest ten: most noise against siblings of the same last name; no drift",
        KeptLayout(sort=NOISE, filter="type:f", set="statistics", most=TEN),
        "floats",
    ),
    Preset(
        "problems", "p", "Problems: what the column state says something of", KeptLayout(filter="problem"), "problems"
    ),
    Preset(
        "stuck",
        "s",
        "Stuck: floats, frozen or no change seen (>); last change on top",
        KeptLayout(sort="changed", filter="type:f frozen|std=0", set="timing"),
        "frozen or unchanged floats",
    ),
    Preset("edited", "e", "Edited: other settings than the program began with", KeptLayout(filter="edited")),
    # of those that are near as it is asked for: `near_limit`
    Preset(NEAR, "l", "Near a limit: within a tenth of one, or beyond", KeptLayout(sort=LIMIT)),
)
BY_NAME = {preset.name: preset for preset in PRESETS}


def is_near(one: LimitStatus) -> bool:
    """Return whether a scalar is beyond one of its bounds, or nearly."""
    return one.value is not None and one.share_left(one.value) <= NEAR_SHARE


def near_limit(limits: Sequence[LimitStatus]) -> tuple[str, str]:
    """Return the filter for what is near a limit now, or was beyond one as nobody has seen yet, and what to say of it.

    The filter is empty where nothing is.
    """
    now = {one.name for one in limits if is_near(one)}
    found = list(dict.fromkeys(one.name for one in limits if one.name in now or one.alarm))  # some have two limits
    of = f"of {many(len({one.name for one in limits}), 'signal')} with limits"
    if not found:
        return "", f"none {of} is within a tenth of one"
    pattern = "|".join(f"{re.escape(name)}$" for name in found)
    was = len(found) - len(now)
    unseen = f"{was} {'was' if was == 1 else 'were'} beyond, which nobody has seen" if was else ""
    near = f"{len(now)} {of} {'is' if len(now) == 1 else 'are'} within a tenth of one, or beyond" if now else ""
    words = f"{near}; {unseen}" if near and unseen else near or f"{unseen}; none {of} is near one now"
    return f"~{pattern}", words
