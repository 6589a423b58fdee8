"""`silo trigger`: conditions that capture what was logged around the moment at which they turn true."""

import time
from typing import TYPE_CHECKING

import click

from silo.cli.common import (
    complete_logger,
    connect,
    file_types,
    json_option,
    logger_argument,
    show_duration,
    show_json,
    show_rows,
)
from silo.files.formats import SAVED_NAMES

if TYPE_CHECKING:
    from silo.conditions.requests import TriggerTried
    from silo.conditions.standing import TriggerStatus
    from silo.core.elements import TriggerOptions

MOST_TIMES = 10


class LoggerFirst(click.Group):
    """A group whose commands may come after the logger too: `silo trigger demo ls` is `silo trigger ls demo`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the command before the logger."""
        if len(args) > 1 and args[0] not in self.commands and args[1] in self.commands:
            args = [args[1], args[0], *args[2:]]
        return super().parse_args(ctx, args)


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


_logger_and_name = click.argument("words", nargs=-1, required=True, metavar="[LOGGER] NAME",
                                  shell_complete=complete_logger)  # fmt: skip


def _split(words: tuple[str, ...], count: int, usage: str) -> tuple[str | None, list[str]]:
    """Return the logger, which may be left out, and so many other words."""
    if len(words) not in (count, count + 1):
        raise click.UsageError(f"write {usage}")
    return (words[0] if len(words) > count else None), list(words[-count:])


def _rule_options(command: "click.decorators.FC") -> "click.decorators.FC":
    for option in (
        click.option("--holdoff", default="0", metavar="TIME", help="Ignore what follows a fire for so long."),
        click.option("--persist", default="0", metavar="TIME", help="It must stay true for so long."),
        click.option("--rearm", default="", metavar="EXPRESSION", help="What must be true before it fires again."),
        click.option("--edge", default="rising", metavar="EDGE", help="rising, falling, level, enter or leave."),
        click.option("--post", default="1s", show_default=True, metavar="TIME", help="Capture so long after it."),
        click.option("--pre", default="1s", show_default=True, metavar="TIME", help="Capture so long before it."),
    ):
        command = option(command)
    return command


def _made(name: str, when: str, pre: str, post: str, edge: str, rearm: str, persist: str, holdoff: str,
          mode: str = "normal", types: tuple[str, ...] = ("silo",), keep: int = 0) -> "TriggerOptions":  # fmt: skip
    from silo.core.elements import TriggerOptions
    from silo.judging.definitions import MOST_TRIGGER_S, seconds

    def given(what: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            return seconds(what, text, MOST_TRIGGER_S)

    return TriggerOptions(
        name, when, given("pre", pre), given("post", post), edge, rearm, given("persist", persist),
        given("holdoff", holdoff), mode, file_types(types), keep,
    )  # fmt: skip


@trigger.command(short_help="Set a trigger, or replace the one of its name.")
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] NAME WHEN", shell_complete=complete_logger)
@_rule_options
@click.option("--mode", type=click.Choice(["normal", "single"]), default="normal", help="single: the first fire only.")
@click.option("--save", "types", multiple=True, type=click.Choice(SAVED_NAMES), default=["silo"], show_default=True,
              help="What to write; may be repeated.")  # fmt: skip
@click.option(
    "--keep", type=click.IntRange(0), default=0, help="Of its captures on the disk the newest so many, 0 for all."
)
def add(
    words: tuple[str, ...], pre: str, post: str, edge: str, rearm: str, persist: str, holdoff: str, mode: str,
    types: tuple[str, ...], keep: int,
) -> None:  # fmt: skip
    """Set a trigger, or replace the one of its name; judged from now on, and kept until the program ends.

    `silo script save` writes it to the logger's script.

    \b
    Examples:
      silo trigger add fall 'abs(base/roll) > 30deg' --pre 5s --post 1s --rearm 'abs(base/roll) < 15deg'
      silo trigger demo add slip 'any(legs/*/slip)' --holdoff 10s --keep 20 --save silo --save bag
    """
    logger, (name, when) = _split(words, 2, "silo trigger add [LOGGER] NAME 'CONDITION'")
    made = _made(name, when, pre, post, edge, rearm, persist, holdoff, mode, types, keep)
    with connect(logger) as client:
        click.echo(client.set_trigger(made))


@trigger.command("ls", short_help="List the triggers and how they stand.")
@logger_argument
@json_option
def ls_command(logger: str | None, as_json: bool) -> None:
    """List the triggers and how they stand.

    \b
    Example:
      silo trigger ls demo
    """
    with connect(logger) as client:
        found = client.triggers()
    if as_json:
        show_json(found)
        return
    if not found.triggers:
        click.echo("no triggers; `silo trigger add NAME 'CONDITION'` sets one")
        return
    header = ("STATE", "NAME", "WHEN", "PRE", "POST", "COUNT", "LAST")
    show_rows([header, *(_row(one) for one in found.triggers)], right=(3, 4, 5, 6))
    for one in found.triggers:
        if one.why:
            click.echo(f"{one.options.name}: {one.why}")


def _row(one: "TriggerStatus") -> tuple[str, ...]:
    state = one.state.value.upper() + (f" {one.holdoff_s:.0f} s" if one.holdoff_s else "")
    last = f"{show_duration(time.time() - one.last_ns / 1e9)} ago" if one.last_ns else "never"
    options = one.options
    return state, options.name, options.when, f"{options.pre_s:g} s", f"{options.post_s:g} s", str(one.fires), last


@trigger.command(short_help="Have a trigger watch again.")
@_logger_and_name
def arm(words: tuple[str, ...]) -> None:
    """Have a trigger watch again: one that is off, or one of mode single that has fired."""
    logger, (name,) = _split(words, 1, "silo trigger arm [LOGGER] NAME")
    with connect(logger) as client:
        click.echo(client.arm_trigger(name))


@trigger.command(short_help="Have a trigger watch no more.")
@_logger_and_name
def disarm(words: tuple[str, ...]) -> None:
    """Have a trigger watch no more; it is kept, and a capture that is under way goes on."""
    logger, (name,) = _split(words, 1, "silo trigger disarm [LOGGER] NAME")
    with connect(logger) as client:
        click.echo(client.arm_trigger(name, armed=False))


@trigger.command(short_help="Fire a trigger now.")
@_logger_and_name
def force(words: tuple[str, ...]) -> None:
    """Fire a trigger now, whatever its condition says."""
    logger, (name,) = _split(words, 1, "silo trigger force [LOGGER] NAME")
    with connect(logger) as client:
        click.echo(client.force_trigger(name))


@trigger.command(short_help="Forget a trigger.")
@_logger_and_name
def rm(words: tuple[str, ...]) -> None:
    """Forget a trigger; its files stay."""
    logger, (name,) = _split(words, 1, "silo trigger rm [LOGGER] NAME")
    with connect(logger) as client:
        click.echo(client.remove_trigger(name))


@trigger.command("test", short_help="Tell when a condition would have fired.")
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] WHEN", shell_complete=complete_logger)
@_rule_options
@json_option
def test_command(
    words: tuple[str, ...], pre: str, post: str, edge: str, rearm: str, persist: str, holdoff: str, as_json: bool
) -> None:
    """Judge a condition on all that is held now: how often, and when, it would have fired. Nothing is set.

    \b
    Example:
      silo trigger test demo 'any(legs/*/slip)' --holdoff 2s
    """
    logger, (when,) = _split(words, 1, "silo trigger test [LOGGER] 'CONDITION'")
    with connect(logger) as client:
        tried = client.try_trigger(_made("test", when, pre, post, edge, rearm, persist, holdoff))
    if as_json:
        show_json(tried)
        return
    click.echo(tried_text(tried))
    shown = list(zip(tried.ticks, tried.time_ns, strict=True))[-MOST_TIMES:]
    if tried.fires > len(shown):
        click.echo(f"  the last {len(shown)} of them:")
    for tick, time_ns in shown:
        click.echo(f"  tick {tick}, {(tried.end_ns - time_ns) / 1e9:.3f} s ago")


def tried_text(tried: "TriggerTried") -> str:
    """Return what trying a trigger found, in a line."""
    if tried.why:
        return f"blind: {tried.why}"
    times = f"{tried.fires} time{'s' if tried.fires != 1 else ''}"
    held_s = (tried.end_ns - tried.begin_ns) / 1e9
    blind = f"; blind at {tried.blind} of {tried.judged} ticks" if tried.blind else ""
    return f"would have fired {times} in the last {held_s:.3g} s (all that is held){blind}"
