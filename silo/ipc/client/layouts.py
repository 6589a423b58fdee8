"""Views of the terminal that are kept on the robot."""

from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import KeepView, KeptView, KeptViews, ListKeptViews, ReadKeptView


@told_class("client")
class KeptViewCalls(Calls):
    """Views of the terminal that are kept on the robot."""

    def kept_views(self) -> KeptViews:
        """Return the names of the views that are kept beside the logger's script.

        Returns:
            Their names, and the folder on the robot.
        """
        return self._call(ListKeptViews(client=self._name))

    def kept_view(self, name: str) -> KeptView:
        """Return a view that is kept beside the logger's script.

        Args:
            name: of the view.

        Returns:
            Its text, YAML, and its path on the robot.

        Raises:
            RefusedError: there is none of that name, or it can't be read.
        """
        return self._call(ReadKeptView(name=name, client=self._name))

    def keep_view(self, name: str, text: str, overwrite: bool = False) -> str:
        """Keep a view beside the logger's script, for whoever looks at this logger.

        Args:
            name: letters, digits, `- _ . +` and blanks, at most 80.
            text: the view, at most 256 kB.
            overwrite: whether one of that name may be replaced.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: the name or the text can't be, there is one already, or it can't be written; nothing was
                changed.
        """
        return self._call(KeepView(name=name, text=text, overwrite=overwrite, client=self._name)).text
