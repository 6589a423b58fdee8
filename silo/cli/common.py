"""What the commands share: which logger is meant, completion of names, tables of plain text."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.types import StringParamType

from silo.core.quantities.writing import duration_text, infinite_as_text
from silo.errors import ConnectionLostError, RefusedError, SiloError, VersionError
from silo.printing import drawing, printable

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from silo.client.client import Client
    from silo.core.elements import ElementInfo, Status
    from silo.fleet.resolving import Discovery
    from silo.net.found import LoggerAddress

MOST_COMPLETIONS = 100
TRY_AGAIN_S = 1.0
READ_ONLY = "silo read-only"  # in the meta of the root's context

_Made = TypeVar("_Made")
_Command = TypeVar("_Command", bound=Callable[..., Any] | click.Command)


class _AtHome:
    """What is typed: where the shell left a quoted `~` as it is, it is the home."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return it, the path of the home in place of `~`."""
        at_home = os.path.expanduser(value) if isinstance(value, str) else value  # noqa: PTH111  # raises for no `~name`
        return super().convert(at_home, param, ctx)  # type: ignore[misc]  # of the other base


class TypedPath(_AtHome, click.Path):
    """A path as it is typed."""


class LogWord(_AtHome, StringParamType):
    """A logger, or a file."""


def configuration() -> str:
    """Return what `--config` says, before or after the command; empty for this host and all remotes."""
    ctx = click.get_current_context(silent=True)
    found = ctx.find_root().obj if ctx else None
    return found if isinstance(found, str) else ""


def config_option(command: click.Command) -> click.Command:
    """Return a command that takes `--config` behind its name too, and so do those below it; see `configuration`."""
    if isinstance(command, click.Group):
        for below in command.commands.values():
            config_option(below)
    elif not any("--config" in each.opts for each in command.params):
        note = click.Option(["--config"], metavar="NAME|FILE", expose_value=False, hidden=True, callback=_take_config)
        command.params.append(note)
        looking = click.Option(["--read-only"], is_flag=True, expose_value=False, hidden=True, callback=_take_read_only)
        command.params.append(looking)
    return command


def check_control(control: bool) -> bool:
    """Return whether a bridge offers control. Raises UsageError where nothing may be changed."""
    if control and read_only():
        raise click.UsageError("--control lets others change things, --read-only lets nobody: leave one out")
    return control


def _take_read_only(ctx: click.Context, _param: click.Parameter, value: bool) -> None:
    if value:
        ctx.find_root().meta[READ_ONLY] = True


def read_only() -> bool:
    """Return whether nothing may be sent that changes anything: `--read-only`, before or after the command."""
    ctx = click.get_current_context(silent=True)
    return ctx is not None and bool(ctx.find_root().meta.get(READ_ONLY))


def _take_config(ctx: click.Context, _param: click.Parameter, value: str | None) -> None:
    if value is not None:
        ctx.find_root().obj = value


def discovered() -> "Discovery":
    """Return the loggers that are there: looked for once in a command."""
    from silo.fleet.resolving import discover

    ctx = click.get_current_context(silent=True)
    kept = ctx.find_root().meta if ctx else {}
    key = f"silo discovery {configuration()}"
    if key not in kept:
        # over a slow link, opening a session is most of what a command takes
        holding = ctx.find_root().with_resource(ExitStack()) if ctx else None
        kept[key] = discover(config=configuration(), holding=holding)
    found: Discovery = kept[key]
    return found


def _forget_discovered() -> None:
    """Have the next one who asks look again."""
    if ctx := click.get_current_context(silent=True):
        ctx.find_root().meta.pop(f"silo discovery {configuration()}", None)


def patiently(make: Callable[[], _Made]) -> _Made:
    """Return what `make` does; while a remote can't be reached, say why and do it again.

    Raises ConnectionLostError where all can be reached and what it looks for isn't there.
    """
    told = ""
    while True:
        made, problem = _tried(make)
        if made is not None:
            return made
        if problem != told:
            told = problem
            click.echo(f"{told}\ntrying again every {TRY_AGAIN_S:g} s, until Ctrl-C", err=True)
        _forget_discovered()
        _pause()


def _tried(make: Callable[[], _Made]) -> tuple[_Made | None, str]:
    """Return what `make` does, or why a remote can't be reached that may be in a moment."""
    from silo.net.access.probing import Layer, LayerError

    passing = (Layer.NAME, Layer.ROUTE, Layer.PORT, Layer.ROLE)
    try:
        return make(), ""
    except LayerError as error:
        if error.layer not in passing:
            raise
        return None, str(error)
    except VersionError:
        raise
    except ConnectionLostError as error:
        if not discovered().unreachable:
            raise
        return None, str(error)


def _pause() -> None:
    time.sleep(TRY_AGAIN_S)


class Ending:
    """Ctrl-C and SIGTERM from now on: they are waited for."""

    # Python handles a signal in the main thread; that of one that another thread took doesn't wake it
    LOOKED_S = 0.5

    def __init__(self) -> None:
        self._asked = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: self._asked.set())

    def wait(self) -> None:
        """Wait for one."""
        while not self.within(self.LOOKED_S):
            pass

    def within(self, time_s: float) -> bool:
        """Return whether one has come, after so long at most."""
        return self._asked.wait(time_s)


def ask_first(question: str, way: str) -> None:
    """Ask on a terminal. Raises UsageError with the way to go where nobody can be asked, Abort for no."""
    if sys.stdin is None or not sys.stdin.isatty():
        raise click.UsageError(way)
    click.confirm(question, abort=True)


def tell_viewers(client: "Client") -> None:
    """Raise RefusedError for who may not change anything, before a word of how a change could be made."""
    hello = client._hello()
    if not hello.may_edit:
        raise RefusedError(hello.why_not)


def find_logger(name: str | None) -> "LoggerAddress":
    """Return the logger that an address means (`robot3/anymal`, `anymal`, `anymal.4711`), or the only one.

    Raises ConnectionLostError where there is none, UsageError where several could be meant.
    """
    from silo.fleet.resolving import SeveralError, awaited
    from silo.rpc.declaring import Ask

    def look() -> "Discovery":
        if discovered().comes_back(name or ""):
            _forget_discovered()
        return discovered()

    try:
        found = awaited(name or "", look, Ask.timeout_s)
    except SeveralError as error:
        raise click.UsageError(str(error)) from None
    if "/" not in (name or ""):  # it might be there, too
        tell_unreachable(discovered().unreachable)
    return found


def means_saved(word: str) -> bool:
    """Whether a word means what is saved, not a logger: a run number, a file, a folder with logs, a bag.

    A logger that runs goes before a file or folder that is only called like it.
    """
    from silo.files.formats import is_bag_folder, means_log

    path = Path(word)
    return means_log(word) or is_bag_folder(path) or (path.exists() and not _runs(word))


def _runs(name: str) -> bool:
    if name.startswith(("/", ".")) or name.endswith("/"):
        return False
    try:
        return bool(find_logger(name))
    except (SiloError, click.UsageError):
        return False


def find_saved(which: str | Path) -> Path:
    """Return the log that is meant, of a folder the newest run; newer captures are told of.

    Raises LogNotFoundError.
    """
    from silo.files.naming import find_log

    return find_log(which, tell=lambda text: click.echo(text, err=True))


def tell_unreachable(unreachable: Mapping[str, str]) -> None:
    """Say which remotes don't answer, and why."""
    from silo.fleet.near import unreachable_text

    for remote, why in unreachable.items():
        click.echo(f"{unreachable_text(remote, why)} (`silo remote doctor {remote}`)", err=True)


def connect(name: str | None) -> "Client":
    """Return a client of the logger; close it, or use it as a context manager."""
    found = find_logger(name)
    from silo.client.client import Client

    return Client.connect(found, read_only=read_only())


def split_logger(words: Sequence[str], *, or_pattern: bool = False) -> tuple[str | None, list[str]]:
    """Return a leading name or address of a logger, if there is one, and the other words, patterns and settings.

    A word with a `/` in it is an address where a logger that is there has it, else a pattern. With `or_pattern`, a
    plain word that names no logger is a pattern too, as long as only one logger can be meant. A URL names its logger,
    and perhaps an element.
    """
    from silo.net.found import ADDRESS, is_url, parse_url

    if words and is_url(words[0]):
        url = parse_url(words[0])
        return url.logger, [*([url.element] if url.element else []), *words[1:]]
    if not words or not ADDRESS.fullmatch(words[0]):
        return None, list(words)
    if "/" in words[0] and "~" not in words[0] and not discovered().named(words[0]):
        return None, list(words)
    if or_pattern and "/" not in words[0]:
        loggers = discovered().loggers
        if len(loggers) == 1 and not loggers[0].is_meant_by(words[0]):
            return None, list(words)
    return words[0], list(words[1:])


def unknown_logger(logger: str | None) -> click.UsageError | None:
    """Return the error for a word that is no logger where several run, so that it may be a pattern of one of them."""
    from silo.net.found import told_apart

    if logger is None:
        return None
    discovery = discovered()
    if len(discovery.loggers) < 2 or discovery.named(logger):
        return None
    labels = ", ".join(told_apart(discovery.loggers))
    return click.UsageError(f"no logger is called '{logger}', and several run: say which before it: {labels}")


# --------------------------------------------------------------------------------------------------------- completion


def items(words: Iterable[str], incomplete: str = "") -> "list[CompletionItem]":
    """Return the words that begin so, as a shell takes them."""
    from click.shell_completion import CompletionItem  # a module that no command needs

    return [CompletionItem(word) for word in words if word.startswith(incomplete)]


def complete_logger(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":
    """Complete names of the loggers that run."""
    from silo.net.found import told_apart

    try:
        loggers = discovered().loggers
    except SiloError:  # the shell has no place for an error message
        return []
    names = [one.name for one in loggers]
    apart = told_apart(loggers)
    labels = [one.name if names.count(one.name) == 1 else word for one, word in zip(loggers, apart, strict=True)]
    return items(labels, incomplete)


def complete_words(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":
    """Complete a logger first, then its elements; their namespaces where there would be too many."""
    from silo.state.requests import TableRequests

    words = ctx.params.get(param.name or "") or ()
    reply = answer_of(lambda: split_logger(words)[0], TableRequests._table)
    infos = (*reply.table.elements, *reply.table.derived) if reply is not None else ()
    elements = items(next_names([info.name for info in infos], incomplete))
    return elements if words else [*complete_logger(ctx, param, incomplete), *elements]


def complete_script(ctx: click.Context, param: click.Parameter, incomplete: str) -> "list[CompletionItem]":
    """Complete a logger, or a script on its side."""
    from silo.scripts.requests import ScriptRequests

    words = ctx.params.get(param.name or "") or ()
    loggers = [] if words else complete_logger(ctx, param, incomplete)
    reply = answer_of(lambda: split_logger(words)[0], ScriptRequests.scripts)
    return [*loggers, *(items(reply.names, incomplete) if reply is not None else [])]


def answer_of(whom: Callable[[], str | None], declared: Callable[..., Any], **wish: Any) -> Any:
    """Return what a logger answers at once to who completes words; None where it can't be told or asked."""
    from silo.fleet.exchange import ask_once
    from silo.rpc.declaring import request_of

    try:
        return ask_once(find_logger(whom()), request_of(declared, **wish), 1.0)
    except (SiloError, click.UsageError):
        return None


def next_names(names: Sequence[str], incomplete: str) -> list[str]:
    """Return the names that begin so; cut behind the next `/` where there are too many to show."""
    from silo.core.names import begun

    matching = begun(names, incomplete)
    if len(matching) <= MOST_COMPLETIONS:
        return matching
    start = len(incomplete)
    heads = {name[: place + 1] if (place := name.find("/", start + 1)) > 0 else name for name in matching}
    return sorted(heads)[:MOST_COMPLETIONS]


logger_argument = click.argument("logger", required=False, metavar="[LOGGER]", shell_complete=complete_logger)
json_option = click.option("--json", "as_json", is_flag=True, help="JSON, for machines.")


def together(*options: Callable[[Any], Any]) -> Callable[[_Command], _Command]:
    """Return what gives a command these options and arguments, in this order."""

    def decorate(command: _Command) -> _Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# for data that a start would clear, to be read by `unsaved`
unsaved_options = together(
    click.option("--save", "save_first", is_flag=True, help="Save what is in no file first."),
    click.option("--discard", is_flag=True, help="Clear what is in no file."),
)


def unsaved(*, save_first: bool, discard: bool) -> str:
    """Return what is to become of unsaved data. Raises UsageError for both at once."""
    if save_first and discard:
        raise click.UsageError("--save or --discard, not both")
    return "save" if save_first else "discard" if discard else "refuse"


@contextmanager
def naming_ways_out(command: str, client: "Client") -> Iterator[None]:
    """Say in commands how to go on after a refusal: over unsaved data, or of a start while it runs."""
    from silo.rpc.refusals import RefusedWhy, RequestRefusedError

    name = client.found.label
    try:
        yield
    except RequestRefusedError as refused:
        if refused.why is RefusedWhy.RUNNING and command == "start":
            text = f"logger '{name}' runs already: `silo restart {name}`, or `silo stop {name}` first"
            raise RefusedError(f"{text}; nothing was changed") from refused
        if refused.why is not RefusedWhy.UNSAVED:
            raise
        raise RefusedError(f"{refused}: `silo {command} {name} --save` or `--discard`") from refused


def types_option(command: _Command) -> _Command:
    """Return the option `--type`, to be read by `silo.files.formats.file_types`."""
    from silo.files.formats import SAVED_NAMES

    return click.option(
        "-t",
        "--type",
        "types",
        multiple=True,
        type=click.Choice(SAVED_NAMES),
        default=["silo"],
        show_default=True,
        help="What to write; may be repeated.",
    )(command)


# --------------------------------------------------------------------------------------------------------------- text


def show_json(value: object) -> None:
    """Print a value as one line of JSON; an infinite number, which JSON has not, is "inf" or "-inf"."""
    from json import dumps

    import msgspec

    text = msgspec.json.encode(infinite_as_text(msgspec.to_builtins(value))).decode()
    # JSON allows control characters beyond ASCII, a terminal doesn't; they stand in strings alone
    click.echo(text if text.isprintable() else "".join(one if one.isprintable() else dumps(one)[1:-1] for one in text))


def show(value: object, as_json: bool, text: Callable[[], object]) -> None:
    """Print a value as JSON, or what `text` gives; it may print itself, and give nothing."""
    if as_json:
        show_json(value)
    elif (words := text()) is not None:
        click.echo(words)


@contextmanager
def progress(label: str) -> Iterator[Callable[..., None]]:
    """Give what shows how much is done, as a share or of a total: a bar on a terminal, nothing elsewhere."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield lambda done, total=1.0: None
        return
    with click.progressbar(length=1000, label=printable(label), file=drawing(sys.stderr)) as bar:

        def show(done: float, total: float = 1.0) -> None:
            step = int(1000 * done / max(total, 1e-9)) - bar.pos
            if step > 0:
                bar.update(step)

        yield show


def show_rows(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> None:
    """Print rows in columns; those numbered in `right` are aligned right."""
    for line in aligned([[printable(cell) for cell in row] for row in rows], right):  # of other computers, too
        click.echo(line)


def aligned(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> list[str]:
    """Return rows as lines of columns; those numbered in `right` are aligned right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def type_of(info: "ElementInfo") -> str:
    """Return the type of an element in a word: `f8`, `f8[3]`, `enum`, `text`, `12 values`."""
    if any(entry.labels for entry in info.entries):
        return "enum" if len(info.entries) == 1 else f"enum[{len(info.entries)}]"
    types = {entry.dtype.lstrip("<|=>") for entry in info.entries}
    if len(types) > 1:
        return f"{len(info.entries)} values"
    (only,) = types or {"-"}
    word = "text" if only.startswith("S") else "bool" if only == "b1" else only
    shape = "x".join(map(str, info.shape))
    return f"{word}[{shape}]" if shape else word


def logged_for(status: "Status") -> str:
    """How long a logger has been logging, fit to show; `-` before its first start."""
    return duration_text((time.time_ns() - status.run_began_ns) / 1e9) if status.state.value == "running" else "-"
