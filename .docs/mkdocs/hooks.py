"""What the site says of commands, keys, requests and formats is written from the program itself.

A page names it in a comment, `<!-- generated: commands -->`, and the text stands in its place.
"""

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

import silo.requests  # noqa: F401  # knows all of them
from silo.cli.codes import EXIT_CODES
from silo.cli.group import COMMANDS, cli
from silo.files.formats import FORMATS, Keeps
from silo.rpc.declaring import Ask, Do, leaves, reply_type
from silo_tui.actions import COMMANDS as ACTIONS
from silo_tui.actions import with_keys

ROOT = Path(__file__).resolve().parents[2]
MARK = re.compile(r"<!-- generated: (\w+) -->")
Page = Callable[[], str]
PAGES: dict[str, tuple[str, str, str]] = {}  # title, address, text, by their file


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    """Put the generated texts into a page; an unknown name is an error. Decisions stand last in the search."""
    if page.file.src_uri.startswith(("decisions", "CHANGELOG")):
        page.meta["search"] = {"boost": 0.2}
    return MARK.sub(lambda mark: GENERATED[mark[1]](), markdown)


def on_page_content(html: str, page: Any, **_: object) -> str:
    """Keep the text of each page for `llms.txt`."""
    PAGES[page.file.src_uri] = (page.title or page.file.src_uri, page.file.url, page.markdown or "")
    return html


def on_post_build(config: Any, **_: object) -> None:
    """Write `llms.txt`, which names all pages, and `llms-full.txt`, which has them as one file of Markdown."""
    site = Path(config["site_dir"])
    pages = sorted(PAGES.values(), key=lambda one: one[1])
    head = f"# {config['site_name']}\n\n> {config['site_description']}\n\n"
    (site / "llms.txt").write_text(head + "\n".join(f"- [{title}]({url})" for title, url, _ in pages) + "\n")
    (site / "llms-full.txt").write_text(head + "\n\n".join(text for _, _, text in pages))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|').replace(chr(10), ' ') for cell in cells)} |"


def _table(heads: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> str:
    return "\n".join([_row(*heads), _row(*["---"] * len(heads)), *(_row(*row) for row in rows)])


def commands() -> str:
    """The help of every shell command."""
    context = click.Context(cli, info_name="silo")
    found = [f"## `silo`\n\n```text\n{cli.get_help(context)}\n```"]
    for name in COMMANDS:
        found += _help(cli.get_command(context, name), name, context, 2)
    return "\n\n".join(found)


def _help(command: click.Command, name: str, above: click.Context, level: int) -> list[str]:
    context = click.Context(command, info_name=name, parent=above)
    found = [f"{'#' * level} `{context.command_path}`\n\n```text\n{command.get_help(context)}\n```"]
    for below in getattr(command, "commands", {}).values():
        found += _help(below, below.name, context, level + 1)
    return found


def keys() -> str:
    """The keys of silo-tui by group, and the words after `:`."""
    actions = [own for each in ACTIONS if (own := with_keys(each)).keys]
    groups = dict.fromkeys(action.group for action in actions)
    parts = []
    for group in groups:
        rows = (
            (f"`{a.key_text}`" if "`" not in a.key_text else a.key_text, a.label, a.help)
            for a in actions
            if a.group == group
        )
        parts.append(f"## {group}\n\n{_table(('key', 'command', 'what it does'), rows)}")
    typed = ((f"`{a.typed.usage}`", a.typed.help) for a in ACTIONS if a.typed and a.typed.usage)
    parts.append(f"## After `:`\n\n{_table(('words', 'what they do'), typed)}")
    return "\n\n".join(parts)


def requests() -> str:
    """Every request: its key, fields and reply."""

    def rows() -> Iterator[tuple[str, ...]]:
        for base, key in ((Ask, "ask"), (Do, "do")):
            for kind in leaves(base):
                own = [name for name in kind.__struct_fields__ if name not in ("client", "protocol")]
                fields = ", ".join(f"`{name}`" for name in own)
                first = (inspect.getdoc(kind) or "").split("\n\n")[0]
                yield f"`{kind.__name__}`", key, fields or "-", f"`{reply_type(kind).__name__}`", first

    return _table(("request", "key", "fields", "reply", "what it does"), rows())


def formats() -> str:
    """Every file format and what it keeps."""
    kept = [keep for keep in Keeps if keep.name not in ("NOTHING", "ALL")]
    rows = ((f"`{' '.join(one.endings)}`", one.about, "yes" if one.reader else "no",
             ", ".join((keep.name or "").lower() for keep in kept if keep in one.keeps) or "-")
            for one in FORMATS)  # fmt: skip
    return _table(("ending", "what", "read again", "keeps beside values and stamps"), rows)


def mistakes() -> str:
    """Every natural mistake that a test types, and what its message says."""
    source = (ROOT / "tests" / "unit" / "test_natural_mistakes.py").read_text(encoding="utf-8")
    table = next(
        ast.literal_eval(node.value)
        for node in ast.parse(source).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "MISTAKES"
    )
    rows = ((f"`{call}`", f"... {words} ...") for call, words in table.items())
    return f"{_table(('written', 'the message says'), rows)}\n\n{len(table)} of them."


GENERATED: dict[str, Page] = {
    "commands": commands,
    "exit_codes": lambda: _table(("code", "means"), ((str(code), means) for code, means in EXIT_CODES.items())),
    "keys": keys,
    "requests": requests,
    "formats": formats,
    "mistakes": mistakes,
}
