"""Writes what was changed into `tui.yaml`: only these values; comments and all other lines stay as they are."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from silo.errors import SaveError, reason
from silo.files.atomic import atomic_file
from silo.settings.yaml_nodes import key_name
from silo_tui.actions import RENAMED
from silo_tui.settings import reading
from silo_tui.settings.file import NAME, path, read_text
from silo_tui.settings.keys import typed_keys
from silo_tui.settings.options import Settings, changed, typed


def write_file(old: Settings, new: Settings) -> Path:
    """Write what differs between the settings as they were read and `new`; return the file. SaveError, nothing changed.

    The file is read again before: what was changed in an editor meanwhile stays.
    """
    target = Path(os.path.realpath(path()))  # a link into a folder of dot files stays a link
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        text = read_text(target)
        mode = target.stat().st_mode & 0o777 if text else None
    except (OSError, UnicodeDecodeError) as error:
        raise SaveError(f"can't write '{target}': {reason(error)}; nothing was changed") from error
    data = rewritten(text, old, new).encode()
    with atomic_file(target) as file:
        if mode is not None:
            os.fchmod(file.fileno(), mode)
        file.write(data)
    return target


def rewritten(text: str, old: Settings, new: Settings) -> str:
    """Return a file's text with what differs between two settings. SaveError where it can't be fitted in."""
    before, _ = reading.read(text)
    wanted = replace(before, **changed(old, new), keys=_merged(before, old, new))
    made = text
    for name, value in {**changed(before, wanted), **changed(old, new)}.items():  # a default too, where it was chosen
        made = _with_value(made, name, typed(value))
    for command in sorted({*before.keys, *wanted.keys}):
        if wanted.keys.get(command) != before.keys.get(command):
            for once in (old for old, now in RENAMED.items() if now == command):
                made = _with_key(made, once, "")
            made = _with_key(made, command, wanted.keys.get(command, ""))
    if reading.read(made)[0].keymap != wanted.keymap:  # which counts without a line depends on whether there are keys
        made = _with_value(made, "keymap", wanted.keymap)
    if reading.read(made)[0] != wanted:
        raise SaveError(f"{NAME} can't take the changes as it is: look at its lines; nothing was changed")
    return made


def _merged(before: Settings, old: Settings, new: Settings) -> dict[str, str]:
    keys = dict(before.keys)
    for command in {*old.keys, *new.keys}:
        if old.keys.get(command) != new.keys.get(command):
            if command in new.keys:
                keys[command] = new.keys[command]
            else:
                keys.pop(command, None)
    return keys


def _with_value(text: str, name: str, value: str) -> str:
    root, _, struck = reading.nodes(text)
    for key, node in reading.pairs(root):
        if key_name(key) == name:
            return _put(text, struck, key, node, value)
    first = _first_group(root)  # behind a group of lines a line would look as if it were one of the group
    line = f"{name}: {value}\n"
    if first is None:
        return _ended(text) + line
    start = text.rfind("\n", 0, first) + 1
    return text[:start] + line + text[start:]


def _first_group(root: yaml.Node | None) -> int | None:
    starts = (key.start_mark.index for key, _ in reading.pairs(root) if key_name(key) == "keys")
    return next(starts, None)


def _with_key(text: str, command: str, keys: str) -> str:
    root, _, struck = reading.nodes(text)
    group = next((node for key, node in reading.pairs(root) if key_name(key) == "keys"), None)
    entries = list(reading.pairs(group))
    for key, node in entries:
        if key_name(key) == command:
            return _put(text, struck, key, node, typed_keys(keys)) if keys else _without(text, key, node, group)
    if not keys:
        return text
    if not entries:
        if group is None:
            return f"{_ended(text)}keys:\n  {command}: {typed_keys(keys)}\n"
        return _put(text, struck, None, group, f"\n  {command}: {typed_keys(keys)}")
    if isinstance(group, yaml.MappingNode) and group.flow_style:
        at = group.start_mark.index + 1
        return f"{text[:at]}{command}: {typed_keys(keys)}, {text[at:]}"
    first = entries[0][0].start_mark
    start = text.rfind("\n", 0, first.index) + 1
    return f"{text[:start]}{text[start : first.index]}{command}: {typed_keys(keys)}\n{text[start:]}"


def _put(text: str, struck: str, key: yaml.Node | None, node: yaml.Node, value: str) -> str:
    start, end = node.start_mark.index, _end(node)
    if start == end:  # an empty value: its place may be lines below
        start = end = struck.index(":", key.end_mark.index if key is not None else struck.rfind("keys", 0, start)) + 1
        value = value if value.startswith("\n") else f" {value}"
    elif key is not None and node.start_mark.line > key.start_mark.line:  # a list in lines of its own becomes one line
        start = struck.index(":", key.end_mark.index) + 1
        value = f" {value}"
    return text[:start] + value + text[end:]


def _without(text: str, key: yaml.Node, node: yaml.Node, group: Any) -> str:
    start, end = key.start_mark.index, _end(node)
    if group.flow_style:
        rest = text[end:].lstrip()
        return text[:start] + (rest[1:].lstrip() if rest.startswith(",") else rest)
    start = text.rfind("\n", 0, start) + 1
    newline = text.find("\n", end)
    return text[:start] + (text[newline + 1 :] if newline >= 0 else "")


def _end(node: yaml.Node) -> int:
    """Return where the last word of a value ends: a list in lines ends for YAML where the next key begins."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)


def _ended(text: str) -> str:
    return text if not text or text.endswith("\n") else text + "\n"
