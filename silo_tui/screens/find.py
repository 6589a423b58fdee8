"""What to look for in the plots: a letter picks it, `*` looks in all signals that are plotted."""

from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from silo_tui.modal import Choices, Dialog
from silo_tui.model.find import Search, What, parse_crossing
from silo_tui.screens.finding import choices


class FindDialog(Dialog[Search | None]):
    """Answers with the search, None on Esc. A crossing asks for its level, in a line below the list."""

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False),
        Binding("j", "move(1)", show=False),
        Binding("k", "move(-1)", show=False),
    ]

    def __init__(self, name: str, signals: int, value: str) -> None:
        super().__init__()
        self._name, self._signals, self._value = name, signals, value
        self._everywhere = False
        self._ready = False

    def compose(self) -> ComposeResult:
        """Yield title, list, line for a level, what keys do."""
        with Vertical(classes="dialog"):
            yield Static("", id="find-title", classes="dialog-title", markup=False)
            yield Choices(
                *(Option(f" {choice.key}  {choice.label}", id=choice.value) for choice in choices(self._value))
            )
            yield Input(
                self._value, placeholder="20 either way, >20 rising, <20 falling", compact=True, id="find-level"
            )
            yield Static("", id="find-hint", markup=False)

    def on_mount(self) -> None:
        """Give the focus to the list; the line comes when it is needed."""
        self.query_one("#find-level").display = False
        self.query_one(OptionList).styles.max_height = 12
        self.query_one(OptionList).focus()
        self.query_one(OptionList).highlighted = 0
        self._ready = True
        self._show_value()
        self._say()

    def offer(self, value: str) -> None:
        """Offer a level, unless one is typed already."""
        self._value = self._value or value
        if self._ready:
            self._show_value()

    def _show_value(self) -> None:
        lines, lists = list(self.query("#find-level").results(Input)), list(self.query(OptionList))
        if not (lines and lists) or not self._value or lines[0].value:
            return  # a dialog that goes loses one widget after the other
        lines[0].value = self._value
        for choice in choices(self._value):
            lists[0].replace_option_prompt(choice.value, f" {choice.key}  {choice.label}")

    def _say(self, problem: str = "") -> None:
        where = f"all {self._signals} signals that are plotted" if self._everywhere else self._name
        other = "the chosen signal alone" if self._everywhere else "all plotted"
        self.query_one("#find-title", Static).update(Text(f"Find in {where}", no_wrap=True, overflow="ellipsis"))
        hint = "Enter finds it: 20 either way, >20 rising, <20 falling" if self._typing else f"* in {other}   Esc back"
        self.query_one("#find-hint", Static).update(problem or hint)

    @property
    def _typing(self) -> bool:
        return bool(self.query_one("#find-level").display)

    def on_key(self, event: events.Key) -> None:
        """Take a choice by its letter; the screen below must not get it too."""
        if self._typing:
            return
        if event.character == "*":
            self._everywhere = not self._everywhere
            self._say()
        elif event.character in {what.value for what in What}:
            self._pick(What(event.character))
        else:
            return
        event.stop()
        event.prevent_default()

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Take the choice under the cursor."""
        self._pick(What(event.option.id))

    def _pick(self, what: What) -> None:
        if what is not What.CROSSING:
            self.dismiss(Search(what, everywhere=self._everywhere))
            return
        line = self.query_one("#find-level", Input)
        line.display = True
        line.focus()
        self._say()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Answer with the crossing of what was typed."""
        try:
            found = parse_crossing(event.value)
        except ValueError as problem:
            self._say(str(problem))
            return
        self.dismiss(Search(found.what, found.level, found.direction, self._everywhere))

    def action_move(self, step: int) -> None:
        """Go to another choice."""
        options = self.query_one(OptionList)
        if step > 0:
            options.action_cursor_down()
        else:
            options.action_cursor_up()

    def action_leave(self) -> None:
        """Leave; nothing is looked for."""
        self.dismiss(None)
