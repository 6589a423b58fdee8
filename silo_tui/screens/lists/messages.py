"""All that was said since the start: answers to keys and news of the robot, the newest first."""

from collections.abc import Sequence

from rich.text import Text

from silo_tui.context import Message
from silo_tui.model.lists.ordering import Order
from silo_tui.screens.lists.list_screen import ListScreen

WHO = {False: "you", True: "robot"}


class MessagesScreen(ListScreen[Message]):
    """A line each; the one under the cursor is told whole below."""

    scope = "messages"
    words_share = 0.6
    orders: Sequence[Order[Message]] = (Order("time", "t", "time, the newest first", lambda told: told.at_s, True),)

    @property
    def all(self) -> Sequence[Message]:
        return list(self.context.told)

    def key_of(self, one: Message) -> str:
        """Return its time: no two are said at once."""
        return f"{one.at_s} {one.words}"

    def head(self, width: int) -> str:
        return "  time      from   what was said"

    def row_of(self, one: Message, width: int) -> Text:
        row = Text(f"  {one.clock}  {WHO[one.is_news]:<5}  {' '.join(one.words.split())}", no_wrap=True)
        row.truncate(width, overflow="ellipsis")
        return row

    def told(self, one: Message) -> str:
        return f"{WHO[one.is_news]} {one.words}"

    def about(self, one: Message) -> str:
        return one.words

    def none(self) -> str:
        return "Nothing was said yet."

    def second_passed(self) -> None:
        self.show()
