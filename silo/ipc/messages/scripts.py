"""Scripts in the logger's script folder."""

from typing import ClassVar

from silo.ipc.messages.base import Do, Done, Reply, SlowAsk
from silo.ipc.messages.elements import EditsApplied
from silo.model import FieldChange


class Scripts(Reply, frozen=True):
    """`names` relative to `folder`; `current` is the logger's own."""

    folder: str
    names: list[str]
    current: str


class ScriptText(Reply, frozen=True):
    """A script's text; `path` as it stands on the robot."""

    path: str
    text: str


class ScriptDiff(Reply, frozen=True):
    """What differs between the running configuration (`old`) and a script (`new`); `unknown` names the table lacks.

    `warnings` are `file:line: reason` of keys that silo doesn't know. `extras` are differences of derived signals,
    limits and triggers, each under a name such as `trigger fall`; without a field for what comes or goes as a whole.
    """

    path: str
    changes: list[FieldChange]
    unknown: list[str]
    warnings: list[str] = []
    extras: list[FieldChange] = []


class ListScripts(SlowAsk[Scripts], frozen=True):
    """Which YAML files are in the folder of the logger's script?"""

    timeout_s: ClassVar[float] = 15.0


class ReadScript(SlowAsk[ScriptText], frozen=True):
    """What stands in a script? An empty path is the running configuration as a script."""

    path: str = ""


class DiffScript(SlowAsk[ScriptDiff], frozen=True):
    """What would loading this script change? Checks it too."""

    path: str = ""


class LoadScript(Do[EditsApplied], frozen=True):
    """Apply a script, only while stopped. The reply has the names that the table lacks."""

    path: str = ""
    revision: int = -1


class SaveScript(Do[Done], frozen=True):
    """Write the configuration to a script inside the script folder; refused if it exists."""

    timeout_s: ClassVar[float] = 15.0

    path: str = ""
    overwrite: bool = False
