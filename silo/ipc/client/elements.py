"""The element table, edits of it, and scripts."""

from collections.abc import Sequence

from silo.arguments import shown
from silo.calls import told_class
from silo.errors import ElementError
from silo.ipc.client.calling import Calls
from silo.ipc.messages import (
    ApplyEdits,
    DiffScript,
    EditsApplied,
    GetTable,
    ListScripts,
    LoadScript,
    ReadScript,
    SaveScript,
    ScriptDiff,
    Scripts,
    ScriptText,
)
from silo.model import Edit, Table


@told_class("client")
class ElementCalls(Calls):
    """The element table and its scripts."""

    def table(self) -> Table:
        """Return the element table with its revision."""
        return self._call(GetTable(client=self._name)).table

    def apply(self, edits: Sequence[Edit], revision: int) -> EditsApplied:
        """Apply edits as one transaction, all or none.

        Args:
            edits: what to change.
            revision: that of the table they are based on; -1: whichever.

        Returns:
            The new revision, and how many elements changed.

        Raises:
            ElementError: they are no list of edits.
            RefusedError: the logger runs, the table has changed since, or an edit can't be; nothing was changed.
        """
        if isinstance(edits, str) or not isinstance(edits, Sequence):
            raise ElementError(f"edits must be a list of silo.model.Edit, got {shown(edits)}; nothing was changed")
        request = ApplyEdits(revision=revision, edits=list(edits), client=self._name)
        return self._call(request)

    def scripts(self) -> Scripts:
        """Return the scripts in the logger's script folder."""
        return self._call(ListScripts(client=self._name))

    def read_script(self, path: str = "") -> ScriptText:
        """Return the text of a script on the robot's side.

        Args:
            path: within the script folder; empty: the running configuration as a script.
        """
        return self._call(ReadScript(path=path, client=self._name))

    def diff_script(self, path: str = "") -> ScriptDiff:
        """Return what loading a script would change.

        Args:
            path: within the script folder; empty: the logger's own script.
        """
        return self._call(DiffScript(path=path, client=self._name))

    def load_script(self, path: str = "", revision: int = -1) -> EditsApplied:
        """Apply a script on the robot's side.

        Args:
            path: within the script folder; empty: the logger's own.
            revision: that of the table it is based on; -1: whichever.

        Returns:
            The new revision, how many elements changed, and the names that the table lacks.

        Raises:
            RefusedError: the logger runs, or the script has problems; nothing was changed.
        """
        return self._call(LoadScript(path=path, revision=revision, client=self._name))

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
        request = SaveScript(path=path, overwrite=overwrite, client=self._name)
        return self._call(request).text
