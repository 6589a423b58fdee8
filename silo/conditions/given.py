"""Limits and triggers as programs give them: the methods that a logger and its clients have in common."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

from silo.core.arguments import line, switch, text, whole
from silo.core.conditions import SignalLimits, TriggerOptions
from silo.core.elements import FileType

_TRIGGER = 'trigger("fall", "abs(base/roll) > 0.6")'

DoneT = TypeVar("DoneT")  # what they return: a client what was done, in words, a logger nothing


class TakesConditions(ABC, Generic[DoneT]):
    """Takes limits and triggers by what is written in a call; which ones there are is known to who sets them."""

    _kept: ClassVar[int] = 0  # captures of a trigger of which nothing is said, 0 for all

    @abstractmethod
    def _set_limits(self, limits: SignalLimits) -> DoneT: ...

    @abstractmethod
    def _remove_limits(self, name: str) -> DoneT: ...

    @abstractmethod
    def _set_trigger(self, trigger: TriggerOptions) -> DoneT: ...

    @abstractmethod
    def _remove_trigger(self, name: str) -> DoneT: ...

    def limit(
        self,
        name: str,
        bounds: Sequence[float | None] | None,
        *,
        persistence: int = 1,
        hysteresis: float = 0.0,
        stale: float | str = 0.0,
        when: str = "",
    ) -> DoneT:
        """Give a signal limits, also while the logger runs: `log.limit("joints/tau", (-40, -30, 30, 40))`.

        The helper process of `serve()` judges them; they are kept in saved files, which `silo check` judges.

        Args:
            name: an element (each of its values is judged), one scalar of it, or a derived signal.
            bounds: (red_low, yellow_low, yellow_high, red_high), None for one that there isn't; a value at a bound is
                within it. None in place of all four forgets its limits, of exactly the name that they were given to.
            persistence: so many samples in a row make a state; each violation is counted all the same.
            hysteresis: how far inside a bound its state ends, in the signal's unit: with 0.5 that of 40 at 39.5.
            stale: a value that stays the same for so long is one too (`"0.5s"`).
            when: an expression that must hold, else nothing is judged.

        Returns:
            Of a client what was done, in words.

        Raises:
            ElementError: the bounds, a number or a time make no sense, or the logger has no such signal; nothing was
                changed.
            ExpressionError: `when` makes no sense to the logger; the message shows the place.
            RefusedError: what the logger raises comes to a client so, and that the robot program has ended; nothing was
                changed.
            GoesOnError: of a client: the robot program takes longer.
        """
        from silo.judging.checks import MOST_STALE_S, bounds_given, seconds

        name = text("the signal's name", name, 'limit("joints/tau", (-40, -30, 30, 40))')
        if bounds is None:
            return self._remove_limits(name)
        text("when", when, 'when="controller/mode == STANCE"')
        four, stale_s = bounds_given(name, bounds), seconds("stale", stale, MOST_STALE_S)
        return self._set_limits(
            SignalLimits(name, bounds=four, persistence=persistence, hysteresis=hysteresis, stale_s=stale_s, when=when)
        )

    def trigger(
        self,
        name: str,
        when: str | None,
        *,
        pre: float | str = 0.0,
        post: float | str = 0.0,
        edge: str = "rising",
        rearm: str = "",
        persist: float | str = 0.0,
        holdoff: float | str = 0.0,
        mode: str = "normal",
        save: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
        keep: int | None = None,
        armed: bool = True,
    ) -> DoneT:
        """Capture what all saved elements did around the moments at which a condition turns true.

            log.trigger("fall", "abs(base/roll) > 0.6", pre="5s", post="1s", rearm="abs(base/roll) < 0.3")

        The helper process of `serve()` judges every row, and writes ticks k - pre to k + post of each fire at tick k to
        files `<logger>_<date>_<run>_<name>_<number>`; a fire within `post` makes the capture longer. The control loop
        has no part in it. Also while the logger runs. Times are seconds, or texts such as `"20ms"`.

        Args:
            name: stands in the names of its files; a trigger of this name is replaced.
            when: the condition; None forgets the trigger, and a capture that is under way goes on.
            pre: how long before the fire.
            post: how long after it.
            edge: `"rising"`: the condition turns true, `"falling"`: false, `"level"`: is true; `"enter"` and `"leave"`
                are the first two.
            rearm: what must be true before it fires again; without, the condition must have been false.
            persist: it must stay so for so long.
            holdoff: it ignores what follows for so long.
            mode: `"normal"`, or `"single"`: the first of each run only.
            save: file types; without any it captures nothing: `client.triggers()` tells when it fired.
            keep: of its captures on the disk, of this run and earlier ones, the newest so many stay, 0 for all; without
                it all that the program's own triggers wrote, 100 of a client's. Removed is only what the logger's own
                list says that it wrote.
            armed: False: it waits until it is armed (`silo trigger arm`, silo-tui).

        Returns:
            Of a client what was done, in words, with what its captures will lack.

        Raises:
            ElementError: a number, a word, a time or a name makes no sense; to the logger also a `pre` that is longer
                than what buffers hold, with the size that would do, or a trigger to be forgotten that there isn't.
            ExpressionError: a condition makes no sense to the logger; the message shows the place.
            RefusedError: what the logger raises comes to a client so, and that the robot program has ended; nothing was
                changed.
            GoesOnError: of a client: the robot program takes longer.
        """
        from silo.files.formats import file_types
        from silo.judging.checks import MOST_KEPT, MOST_TRIGGER_S, seconds

        name = line("the trigger's name", name, _TRIGGER)
        if when is None:
            return self._remove_trigger(name)
        given = {"pre": pre, "post": post, "persist": persist, "holdoff": holdoff}
        times: dict[str, Any] = {f"{key}_s": seconds(key, time, MOST_TRIGGER_S) for key, time in given.items()}
        return self._set_trigger(
            TriggerOptions(
                name,
                **times,
                when=text("when", when, _TRIGGER),
                slope=text("edge", edge, 'edge="falling"'),
                rearm=text("rearm", rearm, 'rearm="abs(base/roll) < 0.3"'),
                mode=text("mode", mode, 'mode="single"'),
                save=tuple(file_types(save)),
                keep=self._kept if keep is None else whole("keep", keep, 0, MOST_KEPT),
                armed=switch("armed", armed),
            )
        )
