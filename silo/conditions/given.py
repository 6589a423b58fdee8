"""Limits and triggers as programs write them: one way for `log.limit`, `client.limit` and `silo trigger`."""

from collections.abc import Sequence
from typing import Any

from silo.core.arguments import line, switch, text, whole
from silo.core.elements import SignalLimits, TriggerOptions
from silo.files.formats import file_types
from silo.judging.definitions import MOST_STALE_S, MOST_TRIGGER_S, bounds_given, seconds

MOST_KEPT = 1_000_000


def limits_given(name: str, bounds: Sequence[float | None], *, stale: float | str, **given: Any) -> SignalLimits:
    """Return limits of what `Logger.limit` was given. Raises ElementError."""
    name = text("the signal's name", name, 'limit("joints/tau", (-40, -30, 30, 40))')
    text("when", given["when"], 'when="controller/mode == STANCE"')
    return SignalLimits(name, bounds_given(name, bounds), stale_s=seconds("stale", stale, MOST_STALE_S), **given)


def trigger_given(name: str, when: str, **given: Any) -> TriggerOptions:
    """Return a trigger of what `Logger.trigger` was given. Raises ElementError."""
    example = 'trigger("fall", "abs(base/roll) > 0.6")'
    name = line("the trigger's name", name, example)
    times: dict[str, Any] = {
        f"{time}_s": seconds(time, given[time], MOST_TRIGGER_S) for time in ("pre", "post", "persist", "holdoff")
    }
    return TriggerOptions(
        name,
        text("when", when, example),
        slope=text("edge", given["edge"], 'edge="falling"'),
        rearm=text("rearm", given["rearm"], 'rearm="abs(base/roll) < 0.3"'),
        mode=text("mode", given["mode"], 'mode="single"'),
        save=tuple(file_types(given["save"])),
        keep=whole("keep", given["keep"], 0, MOST_KEPT),
        armed=switch("armed", given["armed"]),
        **times,
    )
