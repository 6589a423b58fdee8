"""Commands that ask one logger for one thing, declared: which words they take, what they call, how the answer is shown.

    @verb(trigger, "arm", "NAME", short="Have a trigger watch again.")
    def arm(client: Client, name: str) -> str:
        \"\"\"Have a trigger watch again: one that is off, or one of mode single that has fired.\"\"\"
        return client.arm_trigger(name)

The docstring is the help; options are click's, below `verb`, and come as keywords. What is returned is printed, or
shown by `shown`, and then there is `--json`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import click

from silo.cli.common import complete_logger, connect, json_option, show, show_rows
from silo.core.names import did_you_mean, nearest

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]

Found = TypeVar("Found")
_Command = TypeVar("_Command", bound=Callable[..., Any])
_PHRASES = ("EXPRESSION", "WHEN", "TEXT")  # words with blanks in them: a shell wants them quoted


class Verbs(click.Group):
    """A group whose commands are named where another word was written."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names, or an error with the nearest, or all of them."""
        if args[0] not in self.commands and not args[0].startswith("-"):
            hint = did_you_mean(nearest(args[0], self.commands), f"there are {', '.join(self.commands)}")
            raise click.UsageError(f"no command '{args[0]}'{hint}", ctx)
        return super().resolve_command(ctx, args)


class LoggerFirst(Verbs):
    """A group whose commands may come after the logger too: `silo trigger demo ls` is `silo trigger ls demo`.

    `usual` is the command that needs no word of its own.
    """

    def __init__(self, *args: Any, usual: str = "", **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._usual = usual

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put the command before the logger."""
        if len(args) > 1 and args[0] not in self.commands and args[1] in self.commands:
            args = [args[1], args[0], *args[2:]]
        elif self._usual and args and args[0] not in self.commands and args[0] not in ("-h", "--help"):
            args = [self._usual, *args]
        return super().parse_args(ctx, args)


class Target(NamedTuple):
    """Whom the words behind a command mean, None for the only logger, and what they say besides."""

    logger: str | None
    words: list[str]


def by_count(ctx: click.Context, words: Sequence[str], usage: str) -> Target:
    """Take a logger, which may be left out, and the words of `usage`. Raises UsageError for another number of them."""
    named = usage.split()
    if len(words) not in (len(named), len(named) + 1):
        shown = " ".join(f"'{word}'" if word in _PHRASES else word for word in named)
        raise click.UsageError(f"write {ctx.command_path} [LOGGER] {shown}", ctx)
    return Target(words[0] if len(words) > len(named) else None, list(words[len(words) - len(named) :]))


class Words(NamedTuple):
    """How words behind a command are told from its logger, and what completes them."""

    split: Callable[[click.Context, Sequence[str], str], Target]
    complete: "Complete" = complete_logger


BY_COUNT = Words(by_count)


def target(usage: str = "", words: Words = BY_COUNT) -> Callable[[_Command], _Command]:
    """Return the argument `[LOGGER] USAGE`, which comes as a `Target`."""
    required = bool(usage) and not usage.startswith("[")

    def read(ctx: click.Context, _param: click.Parameter, given: Any) -> Any:
        if ctx.resilient_parsing:  # words that are being completed go to who completes them, as they are
            return given
        return words.split(ctx, given, usage) if isinstance(given, tuple) else Target(given, [])

    if not usage:
        return click.argument(
            "logger", required=False, metavar="[LOGGER]", shell_complete=words.complete, callback=read
        )
    return click.argument(
        "words", nargs=-1, required=required, metavar=f"[LOGGER] {usage}", shell_complete=words.complete, callback=read
    )


@dataclass(frozen=True)
class Listing(Generic[Found]):
    """How a list is shown: titles and a row for each, columns in `right` aligned right, `below` a line of what is odd.

    `empty` are the words where there is none.
    """

    heads: tuple[str, ...]
    row: Callable[[Any], tuple[str, ...]]
    empty: str
    right: tuple[int, ...] = ()
    of: Callable[[Found], Sequence[Any]] = list  # type: ignore[assignment]  # an answer that is the list itself
    below: Callable[[Any], str] = lambda _: ""

    def __call__(self, found: Found) -> None:
        """Print it."""
        listed = self.of(found)
        if not listed:
            click.echo(self.empty)
            return
        show_rows([self.heads, *map(self.row, listed)], right=self.right)
        for text in filter(None, map(self.below, listed)):
            click.echo(text)


def verb(
    group: click.Group | None,
    name: str,
    usage: str = "",
    words: Words = BY_COUNT,
    *,
    short: str | None = None,
    shown: Callable[[Any], None] | None = None,
    json: Callable[[Any], object] = lambda found: found,
) -> Callable[[Callable[..., Any]], click.Command]:
    """Declare a command: `silo GROUP NAME [LOGGER] USAGE`.

    Args:
        group: where it belongs; None for a command of `silo` itself.
        name: what is typed for it.
        usage: words behind the logger, in the order in which the function takes them behind the client.
        words: how they are read.
        short: its line in the help of the group; the first sentence of the docstring if it isn't given.
        shown: what prints what the function returns, which is then had as JSON too; a text is printed as it is.
        json: what of it machines are told.
    """

    def declare(ask: Callable[..., Any]) -> click.Command:
        def run(*, as_json: bool = False, **given: Any) -> None:
            whom: Target = given.pop("words" if usage else "logger")
            with connect(whom.logger) as client:
                found = ask(client, *whom.words, **given)
            show(json(found), as_json, lambda: found if shown is None else shown(found))

        run.__doc__ = ask.__doc__
        options = vars(ask).pop("__click_params__", [])
        made = json_option(run) if shown is not None else run
        vars(made).setdefault("__click_params__", []).extend(options)
        command = click.command(name, short_help=short)(target(usage, words)(made))
        if group is not None:
            group.add_command(command)
        return command

    return declare
