"""Limits and triggers as programs write them: one way for `log.limit`, `client.limit` and `silo trigger`."""

from collections.abc import Iterable, Sequence

from silo.core.arguments import line, switch, text, whole
from silo.core.elements import FileType, SignalLimits, TriggerOptions
from silo.files.formats import file_types
from silo.judging.definitions import MOST_STALE_S, MOST_TRIGGER_S, bounds_given, seconds

MOST_KEPT = 1_000_000


def limits_given(
    name: str,
    bounds: Sequence[float | None],
    *,
    persistence: int = 1,
    hysteresis: float = 0.0,
    stale: float | str = 0.0,
    when: str = "",
) -> SignalLimits:
    """Return limits as `Logger.limit` takes them. Raises ElementError."""
    name = text("the signal's name", name, 'limit("joints/tau", (-40, -30, 30, 40))')
    when = text("when", when, 'when="controller/mode == STANCE"')
    bounds = bounds_given(name, bounds)
    return SignalLimits(name, bounds, persistence, hysteresis, seconds("stale", stale, MOST_STALE_S), when)


def trigger_given(
    name: str,
    when: str,
    *,
    pre: float | str = 0.0,
    post: float | str = 0.0,
    edge: str = "rising",
    rearm: str = "",
    persist: float | str = 0.0,
    holdoff: float | str = 0.0,
    mode: str = "normal",
    save: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
    keep: int = 0,
    armed: bool = True,
) -> TriggerOptions:
    """Return a trigger as `Logger.trigger` takes it. Raises ElementError."""
    example = 'trigger("fall", "abs(base/roll) > 0.6")'
    name = line("the trigger's name", name, example)
    times = (("pre", pre), ("post", post), ("persist", persist), ("holdoff", holdoff))
    pre_s, post_s, persist_s, holdoff_s = (seconds(what, given, MOST_TRIGGER_S) for what, given in times)
    return TriggerOptions(
        name,
        text("when", when, example),
        pre_s,
        post_s,
        text("edge", edge, 'edge="falling"'),
        text("rearm", rearm, 'rearm="abs(base/roll) < 0.3"'),
        persist_s,
        holdoff_s,
        text("mode", mode, 'mode="single"'),
        tuple(file_types(save)),
        whole("keep", keep, 0, MOST_KEPT),
        switch("armed", armed),
    )
