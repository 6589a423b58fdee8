"""Lines of the list of loggers: columns, orders, and what is said of many. Pure."""

import time
from collections.abc import Sequence

import msgspec

from silo.conditions.standing import LimitWord
from silo.core.elements import State
from silo.core.quantities.writing import duration_text, idle_words, many, size_text, wall_clock
from silo.fleet.member import NO_TICK, Member, Stands, segments
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among
from silo_tui.model.words.states import MEANINGS, WIDEST, limit_word

STATES = {
    "running": "● RUNNING", "stopped": "■ STOPPED", "dead": "✖ DEAD", "silent": "○ SILENT", "closed": "- CLOSED",
    "no answer": "? MUTE", "...": "…", NO_TICK: "‼ NO TICK",
}  # fmt: skip
WIDE = 110  # from which on there is room for the size of what is left
STATE_WIDTH, LEAST_WHO = 9, 4
ROLE = {
    **dict.fromkeys((Stands.DEAD, Stands.SILENT), "dead"),
    **dict.fromkeys((Stands.STALLED, Stands.RED, Stands.LOST), "alarm"),
    **dict.fromkeys((Stands.MUTE, Stands.FULL, Stands.YELLOW, Stands.SLOW), "warning"),
}  # as what each of them is drawn, by `silo_tui.theme.ROLES`
WORST = {Stands.SLOW: "slow", Stands.LOST: "lost", Stands.FULL: "disk", Stands.SILENT: "old"}


class FoundLogger(msgspec.Struct, frozen=True):
    """One logger of the list: how to name it, whom it belongs to, how it stands, what it answered last."""

    name: str
    pid: int
    user: str
    key: str  # tells loggers apart, also two of one name
    member: Member  # how it stands
    host: str = ""  # where it runs, as far as that is known
    addresses: tuple[str, ...] = ()  # all words that mean it
    alike: bool = False  # another one that was found has its name, on a computer of the same name
    answer: str = ""

    @property
    def address(self) -> str:
        """What to call it in a list: host and name, or what tells it from another one of these."""
        if self.alike and self.addresses:
            return self.addresses[1] if self.pid and len(self.addresses) > 1 else self.addresses[-1]
        return f"{self.host}/{self.name}" if self.host else self.name

    @property
    def can_be_asked(self) -> bool:
        """Whether a command can reach it."""
        return self.member.here and not self.member.dead

    @property
    def has_gone(self) -> bool:
        """Whether it was there while we looked, and isn't any more; of those that went before that nothing was told."""
        return not self.member.here and self.member.summary is not None

    @property
    def where(self) -> str:
        """Whom it belongs to: a process and its user on this computer, the address elsewhere."""
        return f"pid {self.pid}  {self.user}" if self.pid else self.addresses[-1] if self.addresses else self.host

    def is_meant_by(self, wanted: str) -> bool:
        """Return whether a name or an address, or nothing, means it."""
        return not wanted or wanted in {self.name, f"{self.name}.{self.pid}", *self.addresses}


ORDERS: Sequence[Order[FoundLogger]] = (
    Order("worst", "!", "worst first", lambda one: (one.member.stands, one.address.casefold())),
    Order("logger", "n", "name", lambda one: one.address.casefold()),
    Order("state", "s", "state", lambda one: (one.member.word, one.address.casefold())),
    Order("rate", "r", "rate, the largest first", lambda one: _of(one, "measured_hz"), True),
    Order("lost", "l", "losses, the most first", lambda one: _of(one, "lost"), True),
    Order("disk", "d", "disk, the fullest first", lambda one: one.member.disk_share or 0.0, True),
    Order("seen", "k", "gone longest first", lambda one: (one.member.here, one.member.since_s)),
)


def _of(one: FoundLogger, name: str) -> float:
    return float(getattr(one.member.summary, name)) if one.member.summary is not None and one.member.here else 0.0


def name_width(lines: Sequence[FoundLogger], width: int) -> int:
    """Return how many cells the names get: as many as the longest takes, where there is room."""
    longest = max((len(one.address) for one in lines), default=0)
    return max(8, min(longest, width - len(_tail("", "", "", "", "", "", width)) - STATE_WIDTH - 4 - LEAST_WHO))


def _tail(run: str, rate: str, lost: str, disk: str, worst: str, seen: str, width: int) -> str:
    room = 12 if width >= WIDE else 4
    return f"{run:>8} {rate:>7} {lost:>5} {disk:>{room}} {worst:<{WIDEST}} {seen:>5}  "


def head(names: int, width: int) -> str:
    """Return the head of the list."""
    tail = _tail("for", "rate Hz", "lost", "disk", "worst", "seen", width)
    return f"  {'logger':<{names}} {'state':<{STATE_WIDTH}} {tail}who"


def row(
    one: FoundLogger, names: int, width: int, now_s: float, now_ns: int, addresses: tuple[str, ...] = (),
    *, is_open: bool = False,
) -> str:  # fmt: skip
    """Return a logger, among others of these addresses, as a line; what it answered stands behind its state."""
    name = fitted_among(one.address, addresses, names)
    begin = f"  {name:<{names}} {STATES.get(one.member.word, one.member.word):<{STATE_WIDTH}} "
    here = ["open"] * is_open
    if one.answer:
        return begin + ": ".join([*here, one.answer])
    member, told = one.member, one.member.summary
    if told is None:
        return begin + ": ".join([*here, member.problem.replace("\n", " ") or "no answer yet"])
    run_s = member.run_s(now_ns)
    was = f"was {STATES.get(told.state.value, ' ')[:1]}" if member.lost else ""
    share = member.disk_share
    disk = f"{100 * share:.0f}%" if share is not None else ""
    disk += f" {size_text(told.disk_free_bytes)}" if share is not None and width >= WIDE else ""
    worst = _worst(member)
    if member.stands in (Stands.RED, Stands.YELLOW) and len(counted := f"{worst} {told.alarms}") <= WIDEST:
        worst = counted
    ran = told.state is State.RUNNING and not member.stalled and told.measured_hz
    rate = f"{told.measured_hz:.1f}" if ran else member.rate if member.running else ""
    lost = text.count(member.lost_count) if member.lost_count is not None else ""
    tail = _tail(
        duration_text(run_s) if run_s is not None else was,
        rate,
        lost, disk, worst, "now" if member.here else text.ago(member.unseen_s(now_s)), width,
    )  # fmt: skip
    recorded = [f"REC {told.recorders}"] if told.recorders else []
    denied = [f"DENIED {told.denied}"] if told.denied else []
    idle = [idle_words(member.idle_s(now_s))] if member.stalled else []
    return begin + tail + " ".join([*here, *idle, *denied, *recorded, *member.people])


def told(one: FoundLogger) -> str:
    """Return what a filter looks in: names, state, what is the matter, who is there."""
    member, summary = one.member, one.member.summary
    state = f"{member.word} {STATES.get(member.word, '')} {_worst(member)} {member.problem}"
    more = [f"REC {summary.recorders}"] if summary is not None and summary.recorders else []
    more += ["DENIED"] if summary is not None and summary.denied else []
    return " ".join([one.address, one.where, state, *more, one.answer, *member.people])


def total(lines: Sequence[FoundLogger]) -> str:
    """Return how many there are, and in which states."""
    words = [one.member.word for one in lines if one.member.word != "..."]
    counts = [f"{words.count(word)} {word}" for word in dict.fromkeys(sorted(words))]
    return f"{many(len(lines), 'logger')}{': ' * bool(counts)}{', '.join(counts)}"


def down(lines: Sequence[FoundLogger], now_s: float, now_ns: int) -> list[str]:
    """Return a line for each host of which several loggers can't be reached any more."""
    return [one.words(now_s, now_ns) for one in segments(line.member for line in lines)]


def _worst(member: Member) -> str:
    """Return the worst in a word; empty for nothing, and where the state says it."""
    if member.stands in (Stands.RED, Stands.YELLOW) and member.summary is not None:
        return limit_word(LimitWord(member.summary.alarm))
    return WORST.get(member.stands, "")


def _worst_in_words(member: Member) -> str:
    """Return the worst with what it means; empty where another word of the line says it."""
    told = member.summary
    if told is None:
        return ""
    how = MEANINGS.get(told.alarm, "frozen")
    letters = "" if how == "frozen" else f"{told.alarm} "
    alarms = f"{letters}{many(told.alarms, 'alarm')}: a value is {how}"
    meanings = {
        Stands.SLOW: f"slow: {text.short(told.measured_hz)} of {text.short(told.frequency_hz)} Hz",
        Stands.LOST: "ticks were lost", Stands.FULL: "the disk is nearly full",
        Stands.RED: alarms, Stands.YELLOW: alarms,
    }  # fmt: skip
    return meanings.get(member.stands, "")


def details(one: FoundLogger) -> str:
    """Return what the columns don't say of a logger."""
    member, told = one.member, one.member.summary
    parts = [f"{one.address}: {one.where}", *filter(None, [_worst_in_words(member)])]
    if member.problem:
        parts.append(member.problem.replace("\n", " "))
    if told is not None:
        if member.lost:
            parts.append(f"silent since {wall_clock(time.time_ns() - int(1e9 * member.unseen_s(time.monotonic())))}")
        if told.disk_bytes:
            parts.append(f"{size_text(told.disk_free_bytes)} of {size_text(told.disk_bytes)} free")
        if told.denied:
            parts.append(f"{text.count(told.denied)} denied within the last hour: its events tell who")
        if told.reason and told.state is not State.RUNNING:
            parts.append(told.reason)
        elif (
            not told.saved and told.ticks and (member.lost or told.state is not State.RUNNING)
        ):  # else more comes anyway
            parts.append(f"{many(told.ticks, 'tick')}, not saved")
    return " │ ".join(parts)


def asked_line(one: FoundLogger, now_ns: int) -> str:
    """Return a logger as a question about many names it."""
    told, run_s = one.member.summary, one.member.run_s(now_ns)
    state = f"{one.member.word}{f' {duration_text(run_s)}' if run_s is not None else ''}"
    ticks = f", {many(told.ticks, 'tick')} not saved" if told and told.ticks and not told.saved else ""
    alone = "" if one.can_be_asked else ": left alone"
    return f"{one.address}   {state}{ticks}{alone}"


def why_none(targets: Sequence[FoundLogger], again: str) -> str:
    """Return why none of these can be asked for anything, empty where one can; `again` is the key that looks again."""
    if any(one.can_be_asked for one in targets):
        return ""
    if not all(one.member.dead for one in targets):
        return f"none of them is there: {again} looks again"
    who = f"{targets[0].address} is" if len(targets) == 1 else f"these {len(targets)} are"
    return f"{who} dead: start the program again"


def is_unsaved(one: FoundLogger) -> bool:
    """Return whether a start would drop something."""
    told = one.member.summary
    return told is not None and told.ticks > 0 and not told.saved
