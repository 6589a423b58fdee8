"""How triggers and limits stand, in the words of their screens: rows of plain text, and what the head says. Pure."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from msgspec.structs import replace

from silo.conditions.requests import TriggerTried
from silo.conditions.standing import SIDES, LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import ElementInfo, Entry
from silo.core.names import Names
from silo.core.quantities.writing import many, share_words, size_text, whole_duration
from silo.errors import ExpressionError
from silo.files.formats import SAVED, SAVED_NAMES, file_types
from silo_tui.model.words import text
from silo_tui.model.words.names import space_words
from silo_tui.model.words.states import WIDEST, limit_word

NOW = " now"  # the end of an axis of time
UNNAMED = "it stands in names of files"  # what a trigger has a name for
MOST_PLOTS = 6  # of what a condition is about, at once
NAME, WHEN = 10, 20  # cells of a trigger's name, and those that its condition keeps
LOUD = (TriggerWord.FIRING,)
CAUTION = (TriggerWord.HOLDOFF, TriggerWord.BLIND, TriggerWord.OTHER)


def name_width(names: Sequence[str], width: int) -> int:
    """Return the cells of the names of triggers: as many as the longest takes, where conditions keep theirs."""
    return max(NAME, min(max(map(len, names), default=0), width - 54 - WHEN + NAME))


def times_head(width: int, name: int = NAME) -> str:
    """Return the head of the list of triggers; `name` cells are of their names."""
    when = when_width(width, name)
    return f"  {'state':<10} {'name':<{name}} {'when':<{when}} {'pre':>6} {'post':>6} {'count':>5}  last"


def when_width(width: int, name: int) -> int:
    """Return the cells of the conditions of triggers, whose names have `name`."""
    return max(12, width - 54 + NAME - name)


def trigger_row(one: TriggerStatus, width: int, name: str, when: str, now_ns: int) -> str:
    """Return a trigger as a line of so many cells; `name` is as long as the names of all are, `when` as it fits."""
    options = one.options
    state = one.state.value.upper() + (f" {one.holdoff_s:.0f}" if one.holdoff_s else "")
    last = text.ago((now_ns - one.last_ns) / 1e9) if one.last_ns else "never"
    room = when_width(width, len(name))
    pre, post = (text.span(value) if value else "0 s" for value in (options.pre_s, options.post_s))
    return f"  {state:<10} {name} {when:<{room}} {pre:>6} {post:>6} {one.fires:>5}  {last}"


def named_in(when: str, elements: Sequence[ElementInfo], prefix: str) -> list[str]:
    """Return the elements that stand in a condition: by name without the logger's prefix, an entry's, or a glob."""
    from silo.expressions.parsing import names_in, parse  # the first screen doesn't load it

    names = Names.of(elements, prefix)
    try:
        words = names_in(parse(when).root)
    except ExpressionError:
        return []
    named = [word for word in words if any(char.isalpha() for char in word)]
    places = {place for word in named for place, _ in names.find(word, scalars=True, namespaces=False)}
    return [names.names[place] for place in sorted(places)]


LASTED = 8  # cells, at least, of how long a scalar has been, or was, beyond its limits
STATE = max(WIDEST, len("HH back"))


def limit_head(room: int, space: str = "", wide: int = LASTED) -> str:
    """Return the head of the list of alarms, whose signals are told below the namespace `space`, in so many cells."""
    begin = f"  {'state':<{STATE}} {space_words('signal', space, room):<{room}}"
    return f"{begin} {'value':>8} {'limit':>7} {'worst':>8} {'last for':>{wide}} {'count':>5} seen by"


def signal_width(names: Sequence[str], width: int, wide: int = LASTED) -> int:
    """Return the cells of the signals' names in the list of alarms: of the longest, where there is room."""
    return max(14, min(max(map(len, names), default=0), width - 44 - wide - STATE))


def lasted_words(one: LimitStatus, now_ns: int) -> str:
    """Return for how long a scalar is, or was, beyond its limits."""
    lasted_s = one.lasted_s(now_ns)
    if lasted_s is None:
        return ""
    return whole_duration(lasted_s) if one.is_over else text.span(lasted_s, 2)


def lasted_width(found: Sequence[LimitStatus], now_ns: int) -> int:
    """Return the cells of these words in the list of alarms."""
    return max([LASTED, *(len(lasted_words(one, now_ns)) for one in found)])


def limit_row(one: LimitStatus, short: str, room: int, now_ns: int, wide: int = LASTED) -> str:
    """Return a scalar with limits as a line; `short` is its name, which has `room` cells, `wide` how long it lasted."""
    lasted = lasted_words(one, now_ns)
    seen = f"{one.since_seen} NEW" if one.alarm and one.since_seen else one.seen.split("@")[0]
    count = one.count + one.stale_count
    near = _bound_shown(one)
    stale = one.word is LimitWord.STALE or (near is None and one.stale_s > 0)
    limit = None if stale else near
    # the newest value comes and goes: the other two say how all three are written
    digits = text.digits_for([each for each in (limit, one.worst) if each is not None] or [one.value or 0.0], 7)
    value, bound, worst = ("" if each is None else digits.write(each, 8) for each in (one.value, limit, one.worst))
    bound = text.span(one.stale_s if one.limit is None else one.limit) if stale else bound
    return (
        f"  {state_words(one):<{STATE}} {short:<{room}} {value:>8} {bound:>7} {worst:>8} {lasted:>{wide}} "
        f"{count or '':>5} {seen}"
    )


def state_words(one: LimitStatus) -> str:
    """Return how a scalar stands: `HH`, `HH back` where its value is by now, `was HH` till that is seen."""
    if one.word is LimitWord.OK and one.alarm and one.worst_word in SIDES and one.worst_word.is_over:
        return f"was {limit_word(one.worst_word)}"
    return f"{limit_word(one.word)}{' back' * one.is_back}"


def _bound_shown(one: LimitStatus) -> float | None:
    """Return the bound that its state is about; of what is well that it was beyond, else the next; None for none."""
    if one.bound is not None:
        return one.bound
    if one.limit is not None:
        return one.limit
    found = one.closest(math.nan if one.value is None else one.value)
    return found[1] if found is not None else None


def waits_for(one: LimitStatus) -> str:
    """Return what an alarm waits for whose newest value is in another range than it says; empty where it is in that."""
    waits = one.persistence > 1 or one.hysteresis
    if one.value is None or one.word not in SIDES or not waits:
        return ""
    given = zip(one.bounds, (-1, -1, 1, 1), strict=True)
    now = sum(side for bound, side in given if bound is not None and (one.value - bound) * side > 0)
    said = SIDES[one.word]
    if now == said:
        return ""
    row = f"after {one.persistence} samples in a row" if one.persistence > 1 else ""
    if abs(now) > abs(said) or now * said < 0:
        return f"beyond its limits now: an alarm {row}".rstrip()
    inside = f"{text.short(one.hysteresis)} inside of them" if one.hysteresis else ""
    where = "less far beyond" if now else "within its limits"
    return f"{where} now: the alarm ends {' '.join(filter(None, [inside, row]))}"


def alarms_words(found: Sequence[LimitStatus]) -> str:
    """Return how many are over, and how many nobody has seen, in a line."""
    now = sum(one.is_over for one in found)
    missed = sum(one.alarm and not one.is_over for one in found)
    blind = sum(one.word is LimitWord.BLIND for one in found)
    parts = [f"{now} over limits now"]
    parts += [f"{missed} {'was' if missed == 1 else 'were'} over, not seen since"] if missed else []
    return f"{', '.join(parts)} │ {many(len(found), 'limit')}{f', {blind} blind' if blind else ''}"


def head_words(
    triggers: Sequence[TriggerStatus], limits: Sequence[LimitStatus]
) -> tuple[tuple[str, ...], bool, tuple[str, ...]]:
    """Return for the status line the alarms and the worst, whether that is red, and what triggers do.

    Words and ever shorter ones, none where there is nothing to tell.
    """
    over = [one for one in limits if one.is_over]
    words_over = {one.word for one in over}
    worst = min((word for word in LimitWord if word in words_over), key=lambda word: word.rank, default=None)
    firing = [one.options.name for one in triggers if one.state is TriggerWord.FIRING]
    armed = sum(one.state in (TriggerWord.ARMED, TriggerWord.HOLDOFF) for one in triggers)
    watching: tuple[str, ...] = ()
    if firing or armed:
        watching = (
            (f"trigger {firing[0]} fires", "FIRES") if firing else (f"{many(armed, 'trigger')} armed", f"{armed} armed")
        )
    seen = "" if any(one.alarm for one in over) else " seen"
    missed = sum(one.alarm for one in limits if not one.is_over)  # short ones, too: the table may never show them
    alarm: tuple[str, ...] = ()
    if worst is not None:
        now = f"{many(len(over), 'alarm')} ({limit_word(worst)})"
        more = [f", {missed} ended"] if missed else []
        ended = f", {missed} ended unseen" if missed else ""
        words = (f"{now}{seen}{ended}", *(now + each for each in more), now, f"{limit_word(worst)} {len(over)}")
        alarm = tuple(dict.fromkeys(words))
    elif missed:
        alarm = (f"{many(missed, 'alarm')} ended unseen", f"{many(missed, 'alarm')} ended")
    return alarm, worst is not None and worst.is_red, watching


# --------------------------------------------------------------------------------------------------------- the editor


def beyond_all(name: str, entry: Entry, low: float, high: float) -> str:
    """Return a condition on a scalar that never held while it was between these; empty where there is none to guess."""
    if entry.dtype[1:2] == "b":
        return name if not high else f"not {name}" if low else ""
    if entry.labels or not math.isfinite(high - low):
        return ""
    tenth = (high - low or abs(high) or 1.0) / 10
    if not tenth or not math.isfinite((high + tenth) / tenth):
        return ""
    step = 10.0 ** math.floor(math.log10(tenth))
    level = (math.floor((high + tenth) / step) + 1) * step
    return f"{name} > {level:{'.15g' if float(f'{level:.15g}') > high else '.17g'}}"


MODES, SLOPES = ("normal", "single"), ("rising", "falling", "level", "enter", "leave")
NO_FILES = "none"  # what stands in the line `save` of a trigger that captures nothing


def fields_of(one: TriggerOptions) -> dict[str, str]:
    """Return what stands in the lines of the editor."""
    times = {"pre": one.pre_s, "post": one.post_s, "persist": one.persist_s, "holdoff": one.holdoff_s}
    return {
        "name": one.name, "when": one.when, "rearm": one.rearm,
        **{name: text.span(value, 6) if value else "0" for name, value in times.items()},
        "mode": one.mode if one.slope == "rising" else f"{one.mode} {one.slope}",
        "save": " ".join(SAVED[kind].name for kind in one.save) or NO_FILES, "keep": str(one.keep),
    }  # fmt: skip


def options_of_fields(fields: dict[str, str], before: TriggerOptions) -> TriggerOptions:
    """Return the trigger `before` with what lines say otherwise. Raises ElementError or ValueError, fit to show."""
    from silo.judging.checks import check_trigger_name

    shown, made = fields_of(before), dict[str, Any]()
    for label, typed in fields.items():
        if (word := typed.strip()) != shown[label]:
            made |= _typed(label, word)
    one = replace(before, **made)
    if not one.name:
        raise ValueError(f"name it: {UNNAMED}")
    check_trigger_name(one.name)
    return one


def _typed(label: str, word: str) -> dict[str, object]:
    """Return the options that a line of the editor says. Raises ElementError or ValueError."""
    from silo.judging.checks import MOST_TRIGGER_S, typed_seconds

    if label == "mode":
        words = word.split()
        modes = [each for each in words if each in MODES] or [MODES[0]]
        slopes = [each for each in words if each not in MODES] or [SLOPES[0]]
        if len(modes) + len(slopes) > 2 or slopes[0] not in SLOPES:
            raise ValueError(f"mode is {' or '.join(MODES)}, with {', '.join(SLOPES)}; got {word!r}")
        return {"mode": modes[0], "slope": slopes[0]}
    if label == "save":
        names = word.replace(",", " ").split() or [SAVED_NAMES[0]]
        return {"save": () if names == [NO_FILES] else tuple(file_types(names))}
    if label == "keep":
        if not word.isdecimal():
            raise ValueError(f"keep is how many captures stay, 0 for all, got {word!r}")
        return {"keep": int(word)}
    if label in ("name", "when", "rearm"):
        return {label: word}
    return {f"{label}_s": typed_seconds(label, word or "0", MOST_TRIGGER_S)}


def held_axis(tried: TriggerTried, width: int) -> tuple[str, int]:
    """Return what stands before the axis of all that is held, and of how many cells that is; `NOW` stands behind it."""
    left = f"-{text.short((tried.end_ns - tried.begin_ns) / 1e9, 3)} s "
    return left, max(8, width - len(left) - len(NOW))


def tried_lines(
    tried: TriggerTried, width: int, verb: str = "would have fired", holds: str = "true", *, lasts: str = ""
) -> list[str]:
    """Return what a test found: how often, for how much of what is held, and where in it.

    `lasts`: what is said instead of how often where it holds from the begin on, and began nowhere.
    """
    if tried.why:
        return [f"blind: {tried.why}"]
    held_s = (tried.end_ns - tried.begin_ns) / 1e9
    part = f"{100 * tried.blind / tried.judged:.0f} %" if tried.judged else "maybe some"
    blind = f"; {part} of it can't be judged" if tried.blind else ""
    share = share_words(tried.held, tried.judged - tried.blind) if tried.held else ""
    last = f"in the {text.short(held_s, 3)} s that are held"
    if share and not tried.fires:  # it holds already, so that it begins to hold nowhere
        first = f"{holds} {share} {last}, from its begin on: {lasts or f'{verb} 0 ×'}{blind}"
    else:
        first = f"{verb} {tried.fires} × {last}{f'; {holds} {share}' if share else ''}{blind}"
    left, room = held_axis(tried, width)
    cells = ["·"] * room
    for time_ns in tried.time_ns:
        cells[min(int((time_ns - tried.begin_ns) / max(tried.end_ns - tried.begin_ns, 1) * room), room - 1)] = "│"
    return [first, left + "".join(cells) + NOW]


def slow_words(made: TriggerOptions, hz: float, nominal_hz: float) -> str:
    """Return how long a capture gets of a loop that makes fewer ticks than it should: times are counted in them."""
    name, seconds = ("pre", made.pre_s) if made.pre_s else ("post", made.post_s)
    if not seconds or hz == nominal_hz:
        return ""
    lasts = f"{name} of {text.span(seconds)} lasts {text.span(seconds * nominal_hz / hz, 2)}"
    return f"times count ticks, of which the loop makes {text.short(hz, 3)} of {text.short(nominal_hz, 3)} Hz: {lasts}"


def capture_words(tried: TriggerTried, made: TriggerOptions) -> str:
    """Return how large a capture is, and what makes it larger."""
    size = f"each capture about {size_text(tried.capture_bytes)}"
    if made.keep:
        size += f"; disk keeps {made.keep} of them, {size_text(made.keep * tried.capture_bytes)}"
    if any(after - before <= made.post_s * 1e9 for before, after in pairwise(tried.time_ns)):
        size += f"; fires within {text.span(made.post_s)} (post) of each other join in one, which is larger"
    return size
