"""Scripts, and views of the terminal that are kept beside them."""

from silo.core.calls import told_class
from silo.core.elements import FieldChange
from silo.rpc.declaring import Caller, Lane, Reply, ask, change
from silo.state.requests import EditsApplied


class Scripts(Reply, frozen=True):
    """`names` relative to `folder`; `current` is the logger's own."""

    folder: str
    names: list[str]
    current: str


class ScriptText(Reply, frozen=True):
    """A script's text; `path` as it stands on the robot."""

    path: str
    text: str


class ScriptDiff(Reply, frozen=True, rename={"conditions": "extras"}):
    """What differs between the running configuration (`old`) and a script (`new`); `unknown` names the table lacks.

    `warnings` are `file:line: reason` of keys that silo doesn't know. `conditions` are differences of derived signals,
    limits and triggers, each under a name such as `trigger fall`; without a field for what comes or goes as a whole.
    `end` says that a run would end by itself with it, which it does not without.
    """

    path: str
    changes: list[FieldChange]
    unknown: list[str]
    warnings: list[str] = []
    conditions: list[FieldChange] = []
    end: str = ""


class KeptViews(Reply, frozen=True):
    """The names of the views in `folder`."""

    folder: str
    names: list[str]


class KeptView(Reply, frozen=True):
    """A view's text, YAML; `path` as it stands on the robot."""

    path: str
    text: str


@told_class("client")
class ScriptRequests(Caller):
    """Scripts and kept views."""

    @ask("ListScripts", slow=True)
    def scripts(self) -> Scripts:
        """Return the scripts in the logger's script folder."""

    @ask(slow=True)
    def read_script(self, path: str = "") -> ScriptText:
        """Return the text of a script on the robot's side.

        Args:
            path: within the script folder; empty: the running configuration as a script.
        """

    @ask(slow=True)
    def diff_script(self, path: str = "") -> ScriptDiff:
        """Return what loading a script would change.

        Args:
            path: within the script folder; empty: the logger's own script.
        """

    @change(lane=Lane.DISK)
    def load_script(self, path: str = "", revision: int = -1, cut: bool = False) -> EditsApplied:
        """Apply a script on the robot's side.

        Args:
            path: within the script folder; empty: the logger's own.
            revision: that of the table it is based on; -1: whichever.
            cut: while the logger runs, too: it goes on as changed, in another stretch, as with `apply`.

        Returns:
            The new revision, how many elements changed, and the names that the table lacks.

        Raises:
            RefusedError: the logger runs (without `cut`) or can't be cut now, or the script has problems; nothing was
                changed.
        """

    @change(lane=Lane.DISK, timeout_s=15.0)
    def save_script(self, path: str = "", overwrite: bool = False) -> str:
        """Write the configuration to a script on the robot's side.

        Args:
            path: within the script folder; empty: the logger's own.
            overwrite: replace a script that is there.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: it is there already, or the system refuses.
        """

    @ask("ListKeptViews", slow=True)
    def _kept_views(self) -> KeptViews:
        """Return the names of the views that are kept beside the logger's script, and the folder on the robot."""

    @ask("ReadKeptView", slow=True)
    def _kept_view(self, name: str) -> KeptView:
        """Return a view that is kept beside the logger's script: its text, YAML, and its path on the robot."""

    @change(control=False, lane=Lane.DISK, timeout_s=15.0)
    def _keep_view(self, name: str, text: str, overwrite: bool = False) -> str:
        """Keep a view beside the logger's script, for whoever looks at this logger.

        Its name has letters, digits, `- _ . +` and blanks, at most 80; its text at most 256 kB.
        """
