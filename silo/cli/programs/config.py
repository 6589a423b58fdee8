"""`silo config`: the examples of configuration that come with silo, to be copied and edited."""

from dataclasses import dataclass
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from silo.cli.common import TypedPath, aligned, json_option, show
from silo.cli.verbs import Verbs
from silo.errors import SiloError

# a link to `config/` in the source tree, a folder in an installed package
FOLDER = Path(__file__).resolve().parents[2] / "config"


@dataclass(frozen=True)
class Example:
    """An example: `summary` is its first line."""

    name: str
    summary: str
    path: str


def examples() -> list[Example]:
    """Return the examples by name. Raises SiloError where this installation has none."""
    paths = sorted(path for path in FOLDER.glob("*") if path.suffix in (".yaml", ".json5"))
    if not paths:
        raise SiloError(f"{FOLDER} holds no examples: this silo was not installed whole; install it again")
    return [Example(path.name, _summary(path), str(path)) for path in paths]


def _summary(path: Path) -> str:
    with path.open(encoding="utf-8") as lines:
        return next(lines).strip("#/ \n")


def _complete(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(one.name, help=one.summary) for one in examples() if one.name.startswith(incomplete)]


@click.group(cls=Verbs)
def config() -> None:
    """List and copy examples of configuration: scripts, remote access by password or certificate.

    \b
    Examples:
      silo config ls
      silo config cp anymal.yaml
    """


@config.command("ls")
@json_option
def ls(as_json: bool) -> None:
    """List the examples that come with silo.

    \b
    Example:
      silo config ls
    """
    found = examples()
    show(found, as_json, lambda: "\n".join(aligned([(one.name, one.summary) for one in found])))


@config.command("cp")
@click.argument("name", shell_complete=_complete)
@click.argument("to", type=TypedPath(path_type=Path), default=Path())
def cp(name: str, to: Path) -> None:
    """Copy the example NAME to a folder or file TO (here, where it is left out). Never overwrites.

    \b
    Examples:
      silo config cp demo.yaml
      silo config cp tls.json5 /etc/robot/silo.json5
    """
    found = examples()
    chosen = [one for one in found if name in (one.name, Path(one.name).stem)]
    if not chosen:
        raise SiloError(f"no example '{name}'; there are {', '.join(one.name for one in found)}; nothing was copied")
    target = to / chosen[0].name if to.is_dir() else to
    if not target.parent.is_dir():
        raise SiloError(f"{target.parent} is no folder; make it first; nothing was copied")
    try:
        with target.open("x", encoding="utf-8") as copy:
            copy.write(Path(chosen[0].path).read_text(encoding="utf-8"))
    except FileExistsError:
        raise SiloError(f"{target} exists; name another file; nothing was copied") from None
    click.echo(str(target))
