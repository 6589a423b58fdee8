"""`silo trigger`: conditions that capture what was logged around the moment at which they turn true."""

import time
from typing import TYPE_CHECKING, Any

import click

from silo.cli.common import together
from silo.cli.verbs import Listing, LoggerFirst, verb
from silo.core.conditions import AROUND_S, CLIENTS_KEEP
from silo.core.quantities.writing import count, duration_text, many, share_words
from silo.files.formats import SAVED_NAMES, file_types

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.conditions.requests import Triggers, TriggerTried
    from silo.conditions.standing import TriggerStatus
    from silo.core.conditions import TriggerOptions

MOST_TIMES = 10
AROUND = f"{AROUND_S:g}s"


@click.group(cls=LoggerFirst)
def trigger() -> None:
    """Set, try, arm and list triggers: conditions that save what was logged around them.

    Conditions name signals (`abs(base/roll) > 0.6`); each recorded row is judged, also while it runs.

    \b
    Examples:
      silo trigger test 'abs(base/roll) > 30deg'
      silo trigger add fall 'abs(base/roll) > 30deg' --pre 5s --post 1s
      silo trigger ls
    """


_rule_options = together(
    click.option("--pre", default=AROUND, show_default=True, metavar="TIME", help="Capture so long before it."),
    click.option("--post", default=AROUND, show_default=True, metavar="TIME", help="Capture so long after it."),
    click.option("--edge", default="rising", metavar="EDGE", help="rising, falling, level, enter or leave."),
    click.option("--rearm", default="", metavar="EXPRESSION", help="What must be true before it fires again."),
    click.option("--persist", default="0", metavar="TIME", help="It must stay true for so long."),
    click.option("--holdoff", default="0", metavar="TIME", help="Ignore what follows a fire for so long."),
)


def _made(name: str, when: str, pre: str, post: str, edge: str, rearm: str, persist: str, holdoff: str,
          mode: str = "normal", types: tuple[str, ...] = ("silo",), keep: int = 0) -> "TriggerOptions":  # fmt: skip
    from silo.core.conditions import TriggerOptions
    from silo.judging.checks import MOST_TRIGGER_S, typed_seconds

    given = {"pre": pre, "post": post, "persist": persist, "holdoff": holdoff}
    times: dict[str, Any] = {f"{key}_s": typed_seconds(key, text, MOST_TRIGGER_S) for key, text in given.items()}
    return TriggerOptions(
        name, when, **times, slope=edge, rearm=rearm, mode=mode, save=tuple(file_types(types)), keep=keep
    )


@verb(trigger, "add", "NAME WHEN", short="Set a trigger, or replace the one of its name.")
@_rule_options
@click.option("--mode", type=click.Choice(["normal", "single"]), default="normal", help="single: the first fire only.")
@click.option("--save", "types", multiple=True, type=click.Choice(SAVED_NAMES), default=["silo"], show_default=True,
              help="What to write; may be repeated.")  # fmt: skip
@click.option(
    "--keep",
    type=click.IntRange(0),
    default=CLIENTS_KEEP,
    show_default=True,
    help="Of its captures on the disk the newest so many, 0 for all.",
)
def add(client: "Client", name: str, when: str, **given: Any) -> str:
    """Set a trigger, or replace the one of its name; judged from now on, and kept until the program ends.

    `silo script save` writes it to the logger's script.

    \b
    Examples:
      silo trigger add fall 'abs(base/roll) > 30deg' --pre 5s --post 1s --rearm 'abs(base/roll) < 15deg'
      silo trigger demo add slip 'any(legs/*/slip)' --holdoff 10s --keep 20 --save silo --save bag
    """
    return client._set_trigger(_made(name, when, **given))


def _row(one: "TriggerStatus") -> tuple[str, ...]:
    state = one.state.value.upper() + (f" {one.holdoff_s:.0f} s" if one.holdoff_s else "")
    last = f"{duration_text(time.time() - one.last_ns / 1e9)} ago" if one.last_ns else "never"
    options = one.options
    return state, options.name, options.when, f"{options.pre_s:g} s", f"{options.post_s:g} s", str(one.fires), last


TRIGGERS = Listing[Any](
    ("STATE", "NAME", "WHEN", "PRE", "POST", "COUNT", "LAST"),
    _row,
    "no triggers; `silo trigger add NAME 'CONDITION'` sets one",
    right=(3, 4, 5, 6),
    of=lambda found: found.triggers,
    below=lambda one: f"{one.options.name}: {one.why}" if one.why else "",
)


@verb(trigger, "ls", short="List the triggers and how they stand.", shown=TRIGGERS)
def ls(client: "Client") -> "Triggers":
    """List the triggers and how they stand.

    \b
    Example:
      silo trigger ls demo
    """
    return client.triggers()


@verb(trigger, "arm", "NAME", short="Have a trigger watch again.")
def arm(client: "Client", name: str) -> str:
    """Have a trigger watch again: one that is off, or one of mode single that has fired."""
    return client.arm_trigger(name)


@verb(trigger, "disarm", "NAME", short="Have a trigger watch no more.")
def disarm(client: "Client", name: str) -> str:
    """Have a trigger watch no more; it is kept, and a capture that is under way goes on."""
    return client.arm_trigger(name, armed=False)


@verb(trigger, "force", "NAME", short="Fire a trigger now.")
def force(client: "Client", name: str) -> str:
    """Fire a trigger now, whatever its condition says."""
    return client.force_trigger(name)


@verb(trigger, "rm", "NAME", short="Forget a trigger.")
def rm(client: "Client", name: str) -> str:
    """Forget a trigger; its files stay."""
    return client._remove_trigger(name)


def _show_tried(tried: "TriggerTried") -> None:
    click.echo(tried_text(tried))
    shown = list(zip(tried.ticks, tried.time_ns, strict=True))[-MOST_TIMES:]
    if tried.fires > len(shown):
        click.echo(f"  the last {len(shown)} of them:")
    for tick, time_ns in shown:
        click.echo(f"  tick {tick}, {(tried.end_ns - time_ns) / 1e9:.3f} s ago")


@verb(trigger, "test", "WHEN", short="Tell when a condition would have fired.", shown=_show_tried)
@_rule_options
def test(client: "Client", when: str, **given: Any) -> "TriggerTried":
    """Judge a condition on all that is held now: how often, and when, it would have fired. Nothing is set.

    \b
    Example:
      silo trigger test demo 'any(legs/*/slip)' --holdoff 2s
    """
    return client.try_trigger(_made("test", when, **given))


def tried_text(tried: "TriggerTried") -> str:
    """Return what trying a trigger found, in a line."""
    if tried.why:
        return f"blind: {tried.why}"
    times = f"{many(tried.fires, 'time')}"
    held_s = (tried.end_ns - tried.begin_ns) / 1e9
    blind = f"; blind at {count(tried.blind)} of {many(tried.judged, 'tick')}" if tried.blind else ""
    held = f"; true {share_words(tried.held, tried.judged - tried.blind)}" if tried.held else ""
    return f"would have fired {times} in the {held_s:.3g} s that are held{held}{blind}"
