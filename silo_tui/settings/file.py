"""The file `tui.yaml`, apart from `reading`: YAML, a fiftieth of the start, is loaded only where there is one."""

from pathlib import Path

import msgspec

from silo.net.configuration import config_folder

NAME = "tui.yaml"
MOST_BYTES = 1_000_000
LEFT_OUT = ". Left out"


class SettingsProblem(msgspec.Struct, frozen=True):
    """What is wrong in which line of the file (0: in none)."""

    line: int
    reason: str

    @property
    def why(self) -> str:
        """The reason alone."""
        return self.reason.removesuffix(LEFT_OUT).rstrip(".")

    def __str__(self) -> str:
        where = f"{NAME} line {self.line}" if self.line else NAME
        return f"{where}: {self.reason.replace('?.', '?')}"


def path() -> Path:
    """Return where the settings are."""
    return config_folder() / NAME


def is_there() -> bool:
    """Return whether there is one, or something that may be one."""
    try:
        return path().exists()
    except OSError:
        return True


def read_text(file: Path) -> str:
    """Return what the file says, nothing where there is none. OSError, UnicodeDecodeError."""
    if not file.exists():
        return ""
    if not file.is_file():
        raise OSError(0, "it is no file")
    with file.open("rb") as opened:
        data = opened.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise OSError(0, f"it has more than {MOST_BYTES // 1_000_000} MB")
    return data.decode("utf-8")
