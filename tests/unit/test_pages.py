"""What the pages for users tell to type is there: each command with its options, each block of Python."""

import ast
import contextlib
import re
import shlex
from pathlib import Path

import click
import pytest

from silo.cli import codes
from silo.cli.group import cli

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / ".docs"
FOLDERS = ("", "guide", "how-to", "tutorial")
PAGES = [ROOT / "README.md", *(page for folder in FOLDERS for page in sorted((DOCS / folder).glob("*.md")))]
README_WORDS = 950


def commands(page: Path) -> list[str]:
    """The lines for a shell that a page prints which begin with `silo`, one per command."""
    blocks = re.findall(r"```bash\n(.*?)```", page.read_text(), re.S)
    lines = [line.strip() for block in blocks for line in block.splitlines()]
    return [one for line in lines for one in re.split(r"&&|\|\|| \| ", line) if one.strip().startswith("silo ")]


def python(page: Path) -> list[str]:
    return [text for text in re.findall(r"```python\n(.*?)```", page.read_text(), re.S) if "--8<--" not in text]


def parse(command: click.Command, words: list[str], above: click.Context | None, name: str) -> click.Context:
    """What click makes of the words; raises click.UsageError for an option or a command that there isn't."""
    context = command.make_context(name, words, parent=above)
    if not isinstance(command, click.Group):
        return context
    found, child, rest = command.resolve_command(context, [*context._protected_args, *context.args])
    return parse(child, rest, context, found)


TYPED = [(page, line) for page in PAGES for line in commands(page)]


@pytest.mark.parametrize(
    ("page", "line"), TYPED, ids=[f"{page.stem}: {line.split('#')[0].strip()}" for page, line in TYPED]
)
def test_a_command_that_a_page_prints_is_one_that_silo_takes(page, line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line, comments=True)[1:]
    files = [word for word in words if re.fullmatch(r"[\w/.-]+\.\w+", word) and not word.startswith("-")]
    for file in files:  # some arguments are files that must be there
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    (tmp_path / "logs").mkdir(exist_ok=True)
    with contextlib.suppress(click.exceptions.Exit):  # --help
        parse(cli, words, None, "silo").close()


@pytest.mark.parametrize("page", [page for page in PAGES if python(page)], ids=lambda page: page.stem)
def test_the_python_of_a_page_is_python(page):
    for text in python(page):
        ast.parse(text)


def test_the_readme_is_read_in_one_sitting():
    assert len((ROOT / "README.md").read_text().split()) <= README_WORDS


def test_each_exit_code_is_one_of_the_table_of_the_reference():
    used = {value for name, value in vars(codes).items() if name.startswith("EXIT_") and isinstance(value, int)}
    assert {0, *used} == set(codes.EXIT_CODES)
    modules = [one for one in (ROOT / "silo/cli").rglob("*.py") if one.name != "codes.py"]
    own = r"^EXIT_\w+ *=|(?:SystemExit|exit)\([1-9]|exit_code = [1-9]"
    assert not [f"{one}: {line}" for one in modules for line in re.findall(own, one.read_text(), re.M)]
