"""Keys as people write them (`ctrl+f`, `/`, `PgUp`), and which two commands would share one."""

import re
import unicodedata

from textual.keys import KEY_NAME_REPLACEMENTS

from silo.core.names import did_you_mean, nearest
from silo_tui.actions import BY_ID, KEY_TEXTS, key_text

_SIGNS, _ESCAPED = re.compile(r'["\\]'), r"\\\g<0>"  # what has a meaning within quotes
EATEN = {"h": "Backspace", "i": "Tab", "j": "Enter", "m": "Enter"}
_WORDS = {
    **{text.casefold(): key for key, text in KEY_TEXTS.items()},
    **{name: name for name in ("up", "down", "left", "right", "insert", "delete", "backspace", "pageup", "pagedown")},
    **{f"f{number}": f"f{number}" for number in range(1, 13)},
    "esc": "escape", "escape": "escape", "return": "enter", "del": "delete", "page up": "pageup",
    "page down": "pagedown", "comma": "comma",
}  # fmt: skip


def read_key(text: str) -> str:
    """Return the name that Textual has for a key. ValueError says what is wrong with it."""
    words = text.strip()
    folded = words.casefold()
    if folded in _WORDS:
        return _WORDS[folded]
    if len(words) == 1:
        return _name_of(words)
    caret = re.fullmatch(r"\^(.)", words)
    modifiers, _, last = ("ctrl", "+", caret[1]) if caret else folded.rpartition("+")
    modifiers, last = modifiers.casefold(), last.casefold()
    if modifiers and set(modifiers.split("+")) <= {"ctrl", "shift", "alt"}:
        if "alt" in modifiers:
            raise ValueError(f"{words}: terminals keep alt for themselves; take ctrl or a plain key")
        if modifiers == "shift" and len(last) == 1:
            raise ValueError(f"{words}: write {last.upper()!r}")
        if modifiers == "ctrl" and last in EATEN:
            raise ValueError(f"{words}: terminals send it as {EATEN[last]}; take another")
        base = _name_of(last) if len(last) == 1 else _WORDS.get(last)
        if base is not None:
            return f"{modifiers}+{base}"
    near = nearest(folded, [*_WORDS, *(f"ctrl+{chr(letter)}" for letter in range(97, 123))])
    raise ValueError(f"{words!r} is no key{did_you_mean(near, 'for example f, ctrl+f, F5, PgUp')}")


def read_path(text: str) -> str:
    """Return a key, or the letter of a menu and the key in it (`e d`). ValueError says what is wrong with it."""
    try:
        return read_key(text)
    except ValueError:
        if len(text.split()) < 2:
            raise
    if len(text.split()) > 2:
        raise ValueError(f"{text.strip()!r} is more than two keys; a menu and a letter are, for example `e d`")
    return " ".join(map(read_key, text.split()))


def _name_of(char: str) -> str:
    if char.isalnum():
        return char
    name = unicodedata.name(char, char).lower().replace("-", "_").replace(" ", "_")
    return KEY_NAME_REPLACEMENTS.get(name, name)


def typed_keys(keys: str) -> str:
    """Return keys as the file has them, signs in quotes: YAML has a meaning for many of them."""
    names = [" ".join(map(_word_of, key.split())) for key in keys.split(",")]
    words = [name if re.fullmatch(r"[\w+]+", name, re.ASCII) else f'"{_SIGNS.sub(_ESCAPED, name)}"' for name in names]
    return words[0] if len(words) == 1 else f"[{', '.join(words)}]"


def _word_of(key: str) -> str:
    return key if "+" in key else key_text(key)


def key_problem(key: str) -> str:
    """Return why a key that was pressed can't be a command's; empty where it can."""
    try:
        read_key(_word_of(key))
    except ValueError as error:
        return str(error)
    return ""


def label(command_id: str) -> str:
    """Return what people call a command, with its id."""
    return f"{command_id} ({BY_ID[command_id].label})"
