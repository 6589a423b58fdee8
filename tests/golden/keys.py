"""Every key of every screen and what it is called: the bar from left to right, what gives way first, and the menus."""

from silo_tui import keymap
from silo_tui.actions import COMMANDS, commands_for


def told() -> list[str]:
    """Return all commands, then the keys of each keymap, screen by screen; `!` changes something, `?` asks before."""
    lines = [
        f"{each.id}{'!' * each.writes}{'?' * each.asks} {each.label}: {each.help} ({' '.join(each.scopes)})"
        for each in COMMANDS
    ]
    scopes = sorted({scope for command in COMMANDS for scope in command.scopes} - {"any"})
    try:
        for name in keymap.BASES:
            keymap.use_keys(name, {})
            for scope in scopes:
                lines += [f"== {name}: {scope}", *(f"bar{' to look' * only}: {_bar(scope, only)}" for only in (0, 1))]
                lines += [f"keys: {' '.join(f'{each.id}={each.keys}' for each in commands_for(scope))}"]
                if name == keymap.DEFAULT:
                    lines += [f"menu {opener}: {_menu(opener, scope)}" for opener in keymap.OPENERS.values()]
    finally:
        keymap.use_keys(keymap.DEFAULT, {})
    return lines


def _bar(scope: str, read_only: int) -> str:
    return " ".join(f"{command.id}:{rank}" for command, rank in keymap.in_bar(scope, read_only=bool(read_only)))


def _menu(opener: str, scope: str) -> str:
    entries = keymap.in_menu(opener, scope)
    return " ".join(f"{letter}={found[0].id}" for letter, found in entries.items())
