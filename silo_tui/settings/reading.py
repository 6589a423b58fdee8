"""Reads `tui.yaml`. A mistake costs its own line and no other, and is told with its number and a suggestion."""

import re
from collections.abc import Container, Iterator
from dataclasses import replace
from typing import Any

import yaml

from silo.core.names import did_you_mean, nearest
from silo.errors import reason
from silo.settings.yaml_nodes import compose, describe, explain, is_null, key_name, line_of
from silo_tui.actions import BY_ID, RENAMED, key_text
from silo_tui.keymap import TWO_LAYERS, clashes
from silo_tui.settings.file import LEFT_OUT, SettingsProblem, path, read_text
from silo_tui.settings.keys import label, read_path
from silo_tui.settings.options import OPTION, OPTIONS, Option, Settings

KEYS_ALONE = (
    "keys without a keymap change those of `keymap: classic`, the default till 0.2; write that line, or two-layer"
)
_SAME = {"true": "on", "yes": "on", "false": "off", "no": "off", "lost": "offered", "last": "always"}
_SIGN_FIRST = re.compile(r"[:\[,-]\s*[*&!?%@`|>{}#,]")


class _MistakeError(Exception):
    """One line can't be taken."""


def read_file() -> tuple[Settings, list[SettingsProblem]]:
    """Return the user's settings and what was left out; defaults where there is no file."""
    try:
        text = read_text(path())
    except OSError as error:
        return Settings(), [SettingsProblem(0, f"can't be read ({reason(error)}); the defaults count")]
    except UnicodeDecodeError as error:
        return Settings(), [SettingsProblem(0, f"byte {error.start + 1} is no UTF-8; the defaults count")]
    return read(text)


def read(text: str) -> tuple[Settings, list[SettingsProblem]]:
    """Return what a file of this text sets, and its problems in the order of their lines."""
    root, problems, _ = nodes(text)
    settings = Settings()
    found: dict[str, Any] = {}
    keys: tuple[yaml.Node, yaml.Node] | None = None
    for key, value in pairs(root):
        name = key_name(key)
        try:
            _once(name, found)
            if name == "keys":
                keys = key, value  # whatever stands first: which are taken depends on the keymap
                found[name] = {}
            else:
                found[name] = _value(_option(name), value)
        except _MistakeError as mistake:
            problems.append(SettingsProblem(line_of(key), f"{mistake}{LEFT_OUT}"))
    if keys is not None:
        if "keymap" not in found and list(pairs(keys[1])):
            found["keymap"] = "classic"
            problems.append(SettingsProblem(line_of(keys[0]), KEYS_ALONE))
        try:
            found["keys"] = _keys(keys[1], problems, found.get("keymap", settings.keymap))
        except _MistakeError as mistake:
            problems.append(SettingsProblem(line_of(keys[0]), f"{mistake}{LEFT_OUT}"))
    return replace(settings, **found, named=frozenset(found)), sorted(problems, key=lambda problem: problem.line)


def _once(name: str, found: Container[str]) -> None:
    if name in found:
        raise _MistakeError(f"{name} is there twice; the first counts")


def nodes(text: str) -> tuple[yaml.Node | None, list[SettingsProblem], str]:
    """Return the root of a text, problems of lines that YAML can't read, and the text with these struck out (`###`)."""
    problems: list[SettingsProblem] = []
    lines = text.split("\n")
    while True:
        try:
            root = compose("\n".join(lines))
        except yaml.YAMLError as error:
            number, reason = _explained(error, "\n".join(lines))
            number = min(number, len(lines))  # YAML may miss something on the line after the last
            line = lines[number - 1]
            if not line.strip("# "):
                return None, [*problems, SettingsProblem(number, f"{reason}. The file is left out")], text
            if _SIGN_FIRST.search(line):
                reason += "; signs need quotes"
            problems.append(SettingsProblem(number, f"{reason}{LEFT_OUT}"))
            lines[number - 1] = "#" * len(line)
            continue
        if root is not None and not isinstance(root, yaml.MappingNode) and not is_null(root):
            why = f"write lines such as `{OPTIONS[0].name}: {OPTIONS[0].words[0]}`, not {describe(root)}"
            return None, [*problems, SettingsProblem(line_of(root), why)], text
        return root, problems, "\n".join(lines)


def _explained(error: yaml.YAMLError, text: str) -> tuple[int, str]:
    number, reason = explain(error, text)
    context = getattr(error, "context_mark", None)
    tabs = [place for place, line in enumerate(text.split("\n"), 1) if re.match(r" *\t", line)]
    if tabs:  # YAML complains of the line before, which it takes to go on
        return tabs[0], "a tab stands where YAML wants spaces; indent with two spaces"
    doing = getattr(error, "context", None) or ""
    if context is not None and ("while scanning" in doing or "while parsing a flow" in doing):
        number = context.line + 1  # an open quote or bracket is found out lines below
    return number, reason


def pairs(node: yaml.Node | None) -> Iterator[tuple[yaml.Node, yaml.Node]]:
    """Yield keys and values of a group; nothing of anything else."""
    if isinstance(node, yaml.MappingNode):
        yield from node.value


def _option(name: str) -> Option:
    if name not in OPTION:
        known = [*OPTION, "keys"]
        hint = did_you_mean(nearest(name.lower(), known), f"there are {', '.join(known)}")
        raise _MistakeError(f"{name!r} is unknown{hint}")
    return OPTION[name]


def _value(option: Option, node: yaml.Node) -> Any:
    if option.several:
        return tuple(dict.fromkeys(_word(option, each) for each in _several(node)))
    if option.words:
        return _word(option, node)
    try:
        number = float(getattr(node, "value", ""))
    except (ValueError, TypeError):
        number = float("nan")
    if not option.low <= number <= option.high:
        raise _MistakeError(f"{option.name} is {option.range_text}, not {describe(node)}")
    return number


def _several(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.SequenceNode):
        return list(node.value)
    return [] if is_null(node) else [node]


def _word(option: Option, node: yaml.Node) -> str:
    typed = str(node.value).casefold() if isinstance(node, yaml.ScalarNode) else ""
    word = typed if typed in option.words else _SAME.get(typed, "")
    if word not in option.words:
        hint = did_you_mean(nearest(typed, option.words))
        raise _MistakeError(f"{option.name} is {option.range_text}, not {describe(node)}{hint}")
    return word


# --------------------------------------------------------------------------------------------------------------- keys


def _keys(node: yaml.Node, problems: list[SettingsProblem], keymap: str) -> dict[str, str]:
    if not isinstance(node, yaml.MappingNode) and not is_null(node):
        raise _MistakeError(f"keys is a group of lines such as `  help: F1`, not {describe(node)}")
    keys: dict[str, str] = {}
    lines: dict[str, int] = {}
    for name, value in pairs(node):
        command = key_name(name)
        try:
            if now := RENAMED.get(command):
                reason = f"{command} is {now} now, one for all lists: taken as that; write {now}"
                problems.append(SettingsProblem(line_of(name), reason))
                read = [*keys.get(now, "").split(","), *_read_keys(command, value)]
                command, read = now, list(filter(None, read))
            else:
                _once(command, keys)
                read = list(_read_keys(command, value))
            keys[_known(command)] = ",".join(dict.fromkeys(read))
            lines[command] = line_of(name)
        except _MistakeError as mistake:
            problems.append(SettingsProblem(line_of(name), f"{mistake}{LEFT_OUT}"))
    # leaving one out gives a command its own key back, which another line may have given away
    while clash := min(clashes(keymap, keys), key=lambda each: -lines.get(each[0], 0), default=None):
        mine, theirs, key, scope = clash
        if theirs in keys and lines[theirs] > lines[mine]:
            mine, theirs = theirs, mine
        reason = f"{key_text(key)} of {mine} is {label(theirs)} already ({scope})"
        problems.append(SettingsProblem(lines[mine], f"{reason}{LEFT_OUT}"))
        del keys[mine]
    return keys


def _known(command: str) -> str:
    known = [each.id for each in BY_ID.values() if each.keys or each.id in TWO_LAYERS]
    if command not in known:
        hint = did_you_mean(nearest(command.lower(), known), "? shows their names")
        raise _MistakeError(f"{command!r} is no command{hint}")
    return command


def _read_keys(command: str, node: yaml.Node) -> Iterator[str]:
    words = [str(getattr(each, "value", "")) for each in _several(node)]
    if isinstance(node, yaml.ScalarNode) and len(words) == 1 and words[0].strip() != ",":
        words = words[0].split(",")
    if not any(word.strip() for word in words):
        raise _MistakeError(f"{command} needs a key; a sign such as # needs quotes")
    for word in words:
        try:
            yield read_path(word)
        except ValueError as error:  # noqa: PERF203 - a key or two
            raise _MistakeError(str(error)) from None
