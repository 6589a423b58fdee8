"""A script's YAML as nodes with their lines, and the parser's complaints in plain words. Knows no keys of a script."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml

from silo.core.yaml_depth import TOO_DEEP, ShallowLoader
from silo.errors import ScriptError, reason
from silo.settings.options import shorten


class _Loader(ShallowLoader):
    """Composes nodes only. Scalars get no type here: `_Reader` knows what each should be, and that is 2x faster."""

    def resolve(self, *_: object) -> str:
        return ""


_RESOLVER = yaml.resolver.Resolver()


@contextmanager
def collector_paused() -> Iterator[None]:
    """No garbage collection while nodes pile up: 10,000 elements take 0.3 s instead of 1.4 s."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def compose(text: str) -> yaml.Node | None:
    """The root node of the one document in `text`, None if there is none. Raises `yaml.YAMLError`."""
    loader = _Loader(text)
    try:
        node: yaml.Node | None = loader.get_single_node()
        return node
    finally:
        loader.dispose()


def read_nodes(path: Path) -> tuple[str, yaml.Node | None]:
    """The text of a YAML file and its root node. Raises ScriptError with the file, and the line of what is no YAML."""
    try:
        text = path.read_text("utf-8")
        return text, compose(text)
    except OSError as error:
        raise ScriptError(f"{path}: can't be read ({reason(error)})") from error
    except UnicodeDecodeError as error:
        raise ScriptError(f"{path}: is no text in UTF-8") from error
    except yaml.YAMLError as error:
        line, why = explain(error, text)
        raise ScriptError(f"{path}:{line}: {why}") from error


def explain(error: yaml.YAMLError, text: str) -> tuple[int, str]:
    """Line and reason of an error of the YAML parser, in words for somebody who doesn't know YAML."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is not None:
        lines = text.splitlines()
        line = min(mark.line + 1, len(lines))
        while line > 1 and not lines[line - 1].strip():  # the end of the file: what matters is the last text before it
            line -= 1
        if "\t" in lines[line - 1][: mark.column + 1]:
            return line, "a tab stands where YAML wants spaces; indent with two spaces"
        reason = " ".join(part for part in (getattr(error, "context", ""), getattr(error, "problem", "")) if part)
        if "maximum nesting depth" in reason:  # libyaml from 0.2.6 on looks ahead, and is there before us
            reason = TOO_DEEP
        if "expected a single document" in reason:
            return line, "a second document starts here (`---`); a script is one document"
        return line, f"not valid YAML: {reason}"
    position = getattr(error, "position", None)
    if isinstance(position, int):
        line = text.encode("utf-8", "surrogatepass").count(b"\n", 0, position) + 1
        return line, "not valid YAML: a control character that must not stand in text"
    return 1, f"not valid YAML: {getattr(error, 'problem', None) or error}"


def line_of(node: yaml.Node) -> int:
    """The line that a node starts in, from 1."""
    return int(node.start_mark.line) + 1


def is_plain(node: yaml.Node) -> bool:
    """Whether this is a scalar without quotes."""
    return isinstance(node, yaml.ScalarNode) and not node.style


def is_null(node: yaml.Node) -> bool:
    """Whether a key has no value."""
    return isinstance(node, yaml.ScalarNode) and is_plain(node) and node.value in ("", "~", "null", "Null", "NULL")


def describe(node: yaml.Node) -> str:
    """A value as it should stand in a message: short, and with its quotes where these are the problem."""
    if isinstance(node, yaml.SequenceNode):
        return "a list"
    if isinstance(node, yaml.MappingNode):
        return "a group of keys"
    if is_null(node):
        return "nothing"
    return (
        shorten(node.value)
        if is_plain(node)
        else f"the text {repr(node.value) if len(node.value) <= 40 else shorten(node.value)}"
    )


def key_name(key: yaml.Node) -> str:
    """A key as text; one that is a list or a group (`? [a, b]`) as what it is."""
    return str(key.value) if isinstance(key, yaml.ScalarNode) else describe(key)


Pair = tuple[yaml.Node, yaml.Node]


def text_of(pairs: list[Pair], anchors: Iterator[int]) -> str:
    """Keys and their values as YAML text, in the styles in which they were read; their comments are gone.

    `anchors` numbers the anchors: those of one file need names of their own.
    """

    class Dumper(yaml.SafeDumper):
        def generate_anchor(self, node: yaml.Node) -> str:
            return f"kept{next(anchors)}"

    seen: set[int] = set()

    def tagged(node: yaml.Node) -> None:
        if id(node) in seen:
            return  # an alias, maybe into itself
        seen.add(id(node))
        if not node.tag:  # composed without tags, see `_Loader`
            plain = isinstance(node, yaml.ScalarNode) and is_plain(node)
            node.tag = _RESOLVER.resolve(type(node), node.value, (plain, not plain))  # type: ignore[no-untyped-call]
        for child in node.value if isinstance(node, yaml.CollectionNode) else ():
            for one in child if isinstance(child, tuple) else (child,):
                tagged(one)

    root = yaml.MappingNode("tag:yaml.org,2002:map", pairs, flow_style=False)
    tagged(root)
    return str(yaml.serialize(root, Dumper=Dumper, allow_unicode=True, width=2**31))
