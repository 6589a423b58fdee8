"""The id of a logger: what tells it from another of its name on a computer that calls itself the same.

Four digits are of the computer, six are drawn. Robots of one cloned image share host name and machine id, but not the
addresses that their network cards were made with; a computer without such a card is told by its boot.
"""

import hashlib
import secrets
from pathlib import Path

_NETWORK = Path("/sys/class/net")


def drawn_id() -> str:
    """Return an id for a logger of this computer: ten hexadecimal digits, other ones at each call."""
    return machine_digits() + secrets.token_hex(3)


def machine_digits() -> str:
    """Return four digits that stay while this computer does."""
    cards = sorted(filter(None, map(_made_with, _NETWORK.glob("*"))))
    facts = [_text(Path("/etc/machine-id")), *cards] if cards else [_text(Path("/proc/sys/kernel/random/boot_id"))]
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:4]


def _made_with(card: Path) -> str:
    """Return the address that a card was made with; empty for one that drew or was given its own."""
    return _text(card / "address") if _text(card / "addr_assign_type") == "0" and (card / "device").exists() else ""


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
