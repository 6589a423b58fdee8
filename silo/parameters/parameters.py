"""All parameters of a logger: declared, set, closed for a while, and what clients ask of them in its link thread.

Excitations among it: one at a time.
"""

import enum
import inspect
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np

from silo.core.arguments import shown
from silo.core.calls import told_class, told_names
from silo.core.tuning.excitation import check_rate, ends_of, number_at
from silo.core.tuning.parameters import (
    WORD_BYTES,
    Excitation,
    ParameterInfo,
    ParameterKind,
    ParameterValue,
    Writable,
    bound_text,
    decoded,
    fitting,
    meant,
    only_meant,
)
from silo.errors import ElementError, reason
from silo.parameters.excited import Excited
from silo.parameters.landing import CLOSED, STANDS_STILL, Landing, WaitingChange
from silo.parameters.parameter import Parameter
from silo.segment.parameter_changes import MOST_WORDS

MOST_KNOWN = 16  # of which is remembered how they ended
LOOK_S = 0.1  # between looks whether the loop still turns
STALLED_S = 1.0  # without a tick: then the value is brought back from outside of the loop
STALLED_TICKS = 3
STALLED = "the loop stands still"

MOST_WAITING = 64
MOST_REVERTS = 1000  # changes that wait to be confirmed
REVERT_LOOK_S = 0.1  # after which is looked again whether a change is back
MOST_ENDS = 256  # changes of which is remembered what became of them
BUSY = f"{MOST_WAITING} changes of parameters wait for a tick already: try again in a moment; nothing was changed"
PROGRAM = "program"

Check = Callable[..., object]
_TYPES = {
    ParameterKind.FLOAT: np.float64,
    ParameterKind.INT: np.int64,
    ParameterKind.ENUM: np.int64,
    ParameterKind.BOOL: np.bool_,
}


@dataclass
class Excitations:
    """What was asked for, by the names that clients gave, the newest last."""

    landing: Landing
    known: dict[str, WaitingChange] = field(default_factory=dict)

    @property
    def running(self) -> WaitingChange | None:
        """The one that goes on, or waits for its first tick."""
        return next((one for one in list(self.landing.waiting) if one.excited and not one.excited.ended), None)

    def found(self, name: str) -> tuple[WaitingChange, Excited]:
        """Return one by the name that its client gave, or without a name the one that runs. Raises ElementError."""
        change = self.known.get(name) if name else self.running
        if change is None or change.excited is None:
            raise ElementError("no such excitation runs")
        return change, change.excited

    def swings(self, groups: set[str]) -> list[dict[str, ParameterValue]]:
        """Return the least and the most that values of some groups come to while they are excited."""
        one = self.running
        if one is None or one.excited is None or one.excited.info.group not in groups:
            return []
        info = one.excited.info
        return [{info.name: end} for end in ends_of(info, one.excited.what)]

    def check(self, info: ParameterInfo, what: Excitation, frequency_hz: float) -> None:
        """Raise ElementError where it can't begin now; `info` has the present value."""
        running = self.running
        if running is not None and running.excited is not None:
            raise ElementError(
                f"{running.excited.info.name} is being excited by {running.who or 'somebody'}: one at a time; "
                "nothing was changed"
            )
        if self.landing.next_row() < 0:
            raise ElementError(f"{STANDS_STILL}: start it first; nothing was changed")
        if any(info.name == one.name for change in list(self.landing.waiting) for one, _ in self.landing.going(change)):
            raise ElementError(f"parameter '{info.name}' is on its way to another value; nothing was changed")
        check_rate(what, frequency_hz)

    def begin(
        self, info: ParameterInfo, what: Excitation, who: str, where: str, name: str, expects: Mapping[str, int]
    ) -> WaitingChange:
        """Have it begin with the next tick, around the value that `info` has. Raises ElementError where it can't."""
        what = msgspec.structs.replace(what, name=info.name)
        low, high = (number_at(end, what.index) for end in ends_of(info, what))
        change = self.landing.change({info.name: info.value}, who, where, name)
        place = self.landing.place_of(info, what.index)
        change.excited = Excited(what, info, place, number_at(info.value, what.index), low, high)
        change.expects = expects
        self.landing.post(change)
        self.known[name] = change
        while len(self.known) > MOST_KNOWN:
            self.known.pop(next(iter(self.known)))
        return change

    def stop(self, name: str, why: str) -> bool:
        """End one, or without a name the one that runs. Returns whether there was one."""
        change = self.known.get(name) if name else self.running
        if change is None or change.excited is None or change.excited.ended:
            return False
        change.excited.end_soon(why)
        return True

    def next_look_s(self) -> float | None:
        """Return when to look again whether the loop turns, of `time.monotonic`; None while nothing is excited."""
        return time.monotonic() + LOOK_S if self.running is not None else None

    def look(self, frequency_hz: float) -> None:
        """Bring a value back whose loop stands still."""
        one = self.running
        if one is None or one.excited is None:
            return
        if time.monotonic() - one.excited.went_s > max(STALLED_S, STALLED_TICKS / frequency_hz):
            one.excited.drop(STALLED)


@dataclass(eq=False)
class Revert:
    """A change that is to be taken back at a time of `time.monotonic`, and what takes it `back` once that is asked."""

    until_s: float
    change: WaitingChange
    back: WaitingChange | None = None

    @property
    def goes_back(self) -> bool:
        """Whether it is too late to confirm it."""
        return self.back is not None and not self.back.refused


@told_names(
    "log.parameters", way_out="log.parameters['kp'] is the parameter of that name, log.parameters.names are all"
)
@told_class("log.parameters")
class Parameters(Mapping[str, Parameter]):
    """The parameters of a logger, by name: `log.parameters["kp"].value`, `log.parameters.set({"kp": 50.0})`."""

    def __init__(self) -> None:
        """Begin without any."""
        self.landing = Landing()
        self.excitations = Excitations(self.landing)
        self._known: dict[str, Parameter] = {}
        self._checks: dict[str, tuple[Check, bool]] = {}  # with whether it wants to see its group
        self._ends: OrderedDict[str, WaitingChange] = OrderedDict()
        self._reverts: list[Revert] = []

    # ------------------------------------------------------------------------------------------------- read

    def __getitem__(self, name: str) -> Parameter:
        return self._known[self.full(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._known))

    def __len__(self) -> int:
        return len(self._known)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and bool(meant(name, self._known))

    def full(self, name: str) -> str:
        """Return the full name of the only parameter that a name means. Raises ElementError."""
        return only_meant(name, self._known)

    @property
    def names(self) -> list[str]:
        """The full names, in the order in which they were declared."""
        return list(self._known)

    @property
    def defaults(self) -> dict[str, ParameterValue]:
        """What each is without anybody's change."""
        return {info.name: info.default for info in self.landing.infos}

    @property
    def revision(self) -> int:
        """Changes with every change that lands."""
        return self.landing.revision

    def read(self) -> dict[str, ParameterValue]:
        """Return what all of them are at one moment: for other threads than the loop's, in which a group may land."""
        return dict(zip(self._known, self.landing.image(), strict=True))

    # -------------------------------------------------------------------------------------- by the program itself

    def set(self, values: Mapping[str, object]) -> None:
        """Set some parameters now, all or none; they hold from the next row on.

        Args:
            values: by name, with or without prefix and group where these are clear.

        Raises:
            ElementError: there is no such parameter, a value doesn't fit, or its check refuses it; nothing was changed.
        """
        if not values:
            return
        fit = self._fitting(values)
        self._check(fit)
        self.landing.store(self.landing.change(fit, "", PROGRAM))

    def reset(self, *names: str) -> None:
        """Set parameters to their defaults, all of them without names."""
        self.set({name: self.defaults[self.full(name)] for name in names or self.names})

    def lock(self) -> None:
        """Close the parameters with `locked=True` to clients: made for the loop, where a phase must not be disturbed.

        What waits for them is refused, a ramp stops where it is; the program itself may set them.
        """
        self.landing.locked = True

    def unlock(self) -> None:
        """Open them again."""
        self.landing.locked = False

    def _set_one(self, info: ParameterInfo, value: object) -> None:
        self.set({info.name: value})

    def _fitting(self, values: Mapping[str, object]) -> dict[str, ParameterValue]:
        named = {self.full(name): value for name, value in values.items()}
        if len(named) < len(values):
            raise ElementError(f"a parameter is given twice: {', '.join(values)}; nothing was changed")
        return {name: fitting(self._known[name].info, value) for name, value in named.items()}

    def _check(self, fit: Mapping[str, ParameterValue]) -> dict[str, int]:
        """Ask the program's checks. Returns which state of their groups they saw; raises ElementError as they say."""
        if not self._checks:
            return {}
        asked = {name: self._checks[name] for name in self._checks if name in fit}
        groups = {self._known[name].info.group for name in fit}
        partners = {
            name: check for name, check in self._checks.items() if check[1] and self._known[name].info.group in groups
        }
        if not asked and not partners:
            return {}
        expects = self.landing.expected({self._known[name].info.group for name in partners})
        for swing in [{}, *self.excitations.swings(groups)]:  # what is excited may be anywhere between its ends
            after = {**self.landing.after(), **swing, **fit} if partners else dict(fit)
            for name, (check, wants_group) in {**asked, **partners}.items():
                group = self._known[name].info.group
                beside = {one.rpartition("/")[2]: after[one] for one in after if self._known[one].info.group == group}
                _ask(name, check, (after[name], beside) if wants_group else (after[name],))
        return expects

    # ------------------------------------------------------------------------------- for clients, in the link thread

    def request(
        self, values: Mapping[str, object], who: str, where: str, name: str, *, remote: bool, revert_s: float = 0.0
    ) -> WaitingChange:
        """Have a client's change land at the end of a tick. Raises ElementError where it can't.

        Asked again by the `name` that the client gave it, nothing is changed twice. `who` asks by which way (`where`),
        in words; `remote`: from another computer. After `revert_s` it is taken back, unless it is confirmed.
        """
        if name and name in self._ends:
            return self._ends[name]
        landing = self.landing
        if len(landing.waiting) >= MOST_WAITING:
            raise ElementError(BUSY)
        if revert_s and len(self._reverts) >= MOST_REVERTS:
            text = (
                f"{MOST_REVERTS} changes wait to be confirmed already: confirm some, or wait until they are taken back"
            )
            raise ElementError(f"{text}; nothing was changed")
        if not values:
            raise ElementError("no parameter is given; nothing was changed")
        fit = self._fitting(values)
        for name_of_one in fit:
            self._may_change(self._known[name_of_one].info, remote=remote)
        expects = self._check(fit)
        change = landing.change(fit, who, where, name)
        change.expects = expects
        landing.post(change)
        if name:
            self._ends[name] = change
            while len(self._ends) > MOST_ENDS:
                self._ends.popitem(last=False)
        if revert_s:
            self._reverts.append(Revert(time.monotonic() + revert_s, change))
        return change

    def _may_change(self, info: ParameterInfo, *, remote: bool) -> None:
        if info.writable is Writable.NO or (remote and info.writable is not Writable.ANYWHERE):
            whose = "the program alone sets it" if info.writable is Writable.NO else "it is set on the robot alone"
            more = "" if info.writable is Writable.NO else ' (writable="anywhere" lets others)'
            raise ElementError(f"parameter '{info.name}': {whose}{more}; nothing was changed")
        if self.landing.locked and info.locked:
            raise ElementError(f"parameter '{info.name}': {CLOSED}; nothing was changed")

    def excite(
        self, what: Excitation, who: str, where: str, name: str, *, remote: bool, frequency_hz: float
    ) -> WaitingChange:
        """Have a client's excitation begin with the next tick. Raises ElementError where it can't.

        The program's checks are asked for both ends that it comes to.
        """
        if name in self.excitations.known:
            return self.excitations.known[name]
        known = self._known[self.full(what.name)].info
        info = msgspec.structs.replace(known, value=self.landing.value(known))
        self._may_change(info, remote=remote)
        self.excitations.check(info, what, frequency_hz)
        if any(info.name == other.name for one in self._reverts for other in one.change.infos):
            raise ElementError(f"parameter '{info.name}' is to be taken back soon: confirm it first")
        for end in ends_of(info, what):
            expects = self._check({info.name: end})
        return self.excitations.begin(info, what, who, where, name, expects)

    def end_of(self, name: str) -> WaitingChange | None:
        """Return a change of the newest 256 by what its client called it."""
        return self._ends.get(name)

    def confirm(self, name: str) -> bool:
        """Keep a change that would be taken back; False where there is none of that name."""
        kept = [one for one in self._reverts if one.change.id != name or one.goes_back]
        found = len(kept) < len(self._reverts)
        self._reverts = kept
        return found

    def next_revert_s(self) -> float | None:
        """Return when the next change is to be taken back, of `time.monotonic`."""
        return min((one.until_s for one in self._reverts), default=None)

    def revert_due(self) -> None:
        """Take back what nobody confirmed in time, as far as nobody changed it since.

        What no tick came for yet, or the program has closed, is looked at again until it is back.
        """
        now_s = time.monotonic()
        for one in [one for one in self._reverts if one.until_s <= now_s]:
            if one.change.refused or (one.change.landed and not self._to_take_back(one.change)):
                self._reverts.remove(one)
                continue
            one.until_s = now_s + REVERT_LOOK_S
            infos = one.change.infos
            if one.change.landed and not one.goes_back and not (self.landing.locked and any(i.locked for i in infos)):
                values = self._to_take_back(one.change)
                one.back = self.landing.change(values, one.change.who, "taken back: nobody confirmed it")
                self.landing.post(one.back)

    def _to_take_back(self, change: WaitingChange) -> dict[str, ParameterValue]:
        """What a change that landed changed last, as it was before."""
        old = change.old
        return (
            {} if old is None else {i.name: decoded(i, old[part].tobytes()) for i, part in self.landing.going(change)}
        )

    # ------------------------------------------------------------------------------------------------- declared

    def declare(self, info: ParameterInfo, check: Check | None, choices: object) -> Parameter:
        """Take in a parameter whose name nobody has yet. Raises ElementError where its bounds make no sense."""
        landing = self.landing
        info = msgspec.structs.replace(info, offset=landing.used_words)
        if info.offset + info.words > MOST_WORDS:
            raise ElementError(f"parameter '{info.name}': a logger has room for {MOST_WORDS} values of parameters")
        _check_bounds(info)
        info = msgspec.structs.replace(info, default=fitting(info, info.default))
        info = msgspec.structs.replace(info, value=info.default)
        words = landing.place(info)
        kind = _TYPES.get(info.kind, np.dtype(f"S{info.string_bytes}"))
        array = np.ndarray(info.shape, kind, landing.block, info.offset * WORD_BYTES)
        made = Parameter(info, array, words.data.cast("B"), self._set_one, choices)
        self._known[info.name] = made
        if check is not None:
            self._checks[info.name] = check, _arguments(check) > 1
        return made


def _ask(name: str, check: Check, given: tuple[object, ...]) -> None:
    try:
        answer: object = check(*given)
    except BaseException as error:
        # of the program's own thread it ends what that was about to do; no client ends the one that hears it
        if not isinstance(error, Exception) and threading.current_thread() is threading.main_thread():
            raise
        words = reason(error) if isinstance(error, Exception) else f"its check ends by {type(error).__name__}"
        raise ElementError(f"parameter '{name}': {words}; nothing was changed") from error
    if answer is None or (isinstance(answer, bool | np.bool_) and answer):
        return
    if isinstance(answer, bool | np.bool_ | str):
        words = answer if isinstance(answer, str) and answer else "its check refuses it"
    else:
        words = f"its check returned {shown(answer)}; it returns True, False, or in words why not"
    raise ElementError(f"parameter '{name}': {words}; nothing was changed")


def _arguments(check: Check) -> int:
    try:
        found = inspect.signature(check).parameters.values()
    except (TypeError, ValueError):  # one written in C tells nothing
        return 1
    return sum(
        one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD) and one.default is one.empty for one in found
    )


def _check_bounds(info: ParameterInfo) -> None:
    numeric = info.kind in (ParameterKind.FLOAT, ParameterKind.INT)
    for word, value in (("min", info.minimum), ("max", info.maximum), ("step", info.step), ("rate", info.rate)):
        if value is None:
            continue
        if not numeric:
            raise ElementError(f"parameter '{info.name}': a {info.kind.value} has no {word}; leave it out")
        given = np.asarray(value)
        number = given.ndim == 0 and given.dtype.kind in "biuf" and bool(np.isfinite(given))
        if not number or (word in ("step", "rate") and value <= 0):
            fits = "above 0" if word in ("step", "rate") else "a finite number"
            alone = "" if number or not info.shape else ", the same for all its values"
            raise ElementError(f"parameter '{info.name}': {word} must be {fits}{alone}, got {value!r}")
    if info.minimum is not None and info.maximum is not None and info.minimum > info.maximum:
        low, high = bound_text(info.minimum), bound_text(info.maximum)
        raise ElementError(f"parameter '{info.name}': min {low} is above max {high}")


def kind_of_default(
    name: str, default: object, choices: object
) -> tuple[ParameterKind, tuple[int, ...], tuple[str, ...]]:
    """Return what a parameter with this default is, its shape, and the words that it may be."""
    words = _choice_words(name, choices)
    if isinstance(default, enum.Enum) and not words:
        words = tuple(type(default).__members__)
    array = np.asarray(default.name if isinstance(default, enum.Enum) else default)
    if words:
        return ParameterKind.ENUM, array.shape, words
    kinds = {
        "f": ParameterKind.FLOAT,
        "i": ParameterKind.INT,
        "u": ParameterKind.INT,
        "b": ParameterKind.BOOL,
        "U": ParameterKind.STRING,
    }
    if array.dtype.kind not in kinds or not array.size:
        raise ElementError(
            f"parameter '{name}': a default is a number, a text, True or False, or an array of such, got {default!r}"
        )
    return kinds[array.dtype.kind], array.shape, ()


def _choice_words(name: str, choices: object) -> tuple[str, ...]:
    if choices is None:
        return ()
    if isinstance(choices, type) and issubclass(choices, enum.Enum):
        return tuple(choices.__members__)
    words = tuple(choices) if isinstance(choices, Sequence) and not isinstance(choices, str) else ()
    if not words or not all(isinstance(word, str) and word for word in words) or len(set(words)) < len(words):
        raise ElementError(f"parameter '{name}': choices are an enumeration, or different words, got {choices!r}")
    return words
