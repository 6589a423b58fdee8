"""What the tables of a logger and of a file share: layout, cursor, filter, marks, order."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Static

from silo.core.arrays.columns import HOLE_TEXTS, Gap
from silo.core.names import did_you_mean, glob_of_regex, nearest
from silo.core.quantities.writing import and_more, many
from silo.rpc.frames import Frame
from silo_tui.actions import BY_ID, Command, commands_for, key_of, with_keys
from silo_tui.context import SiloScreen
from silo_tui.modal import ask
from silo_tui.model.drawing.braille import SHADE
from silo_tui.model.table import filter as filters
from silo_tui.model.table.cells import UNSEEN
from silo_tui.model.table.columns import BEFORE, NAME, TREE, TableColumn
from silo_tui.model.table.tree import parts_of
from silo_tui.model.words.command_line import BY_KEY, WHAT_TO_PLOT, Spelled
from silo_tui.model.words.names import next_levels
from silo_tui.model.words.text import cut
from silo_tui.screens.dialogs.questions import Choice, OrderDialog, Question
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import OPEN_FILE, KeyBar
from silo_tui.widgets.element_table import ElementTable, TableHead
from silo_tui.widgets.inputs import Fleeting, Line
from silo_tui.widgets.inspector import Inspector
from silo_tui.widgets.messages import InfoLine

if TYPE_CHECKING:
    from silo_tui.screens.plots.plot_screen import PlotScreen

WIDE = 110
INSPECTOR_FROM = 170  # cells from which the inspector opens by itself
DEBOUNCE_S = 0.15
FILTER_HINTS = """words in any order   a|b either   -not   ~regex   "with blank"   /glob/*
unit:Nm on:no div>1 size>=1k kind:vector   value>60 |value|>60 std>1 rate<95%
changed<1s   marked pending edited problem nan frozen slow monotone off"""
BEFORE_ROOM = 12  # cells of a filter in the key bar
AWAY = {"loggers": "the loggers", "quit": "quits"}  # where Esc has nothing to leave
OF_ROWS = ("mark", "mark_shown", "range", "fold", "component", "into", "new_of_row", "limits_of_row")
OF_MARKED = ("monitor", "plot", "edit", "edit_all")  # which may stand elsewhere
FILTER_KEYS = "Enter keeps the filter  Tab completes  Esc clears it"


class ElementsScreen(SiloScreen):
    """Elements with what is known of them; its children say what that is and what can be done with it."""

    filter_hint = ""
    inspector_least = 32  # its cells where there is little room

    def __init__(self, session: Session, columns: Sequence[TableColumn]) -> None:
        super().__init__()
        self.session = session
        self.table = ElementTable(session, columns)
        self.inspector = Inspector(session)
        self.info = InfoLine(session)
        self.info.legend = lambda: self._legend
        self.table_head = TableHead(self.table)
        self.inspector_wanted: bool | None = None  # None: by the width of the screen

    @property
    def subject(self) -> str:
        rows, row = self.session.rows, self.session.rows.row
        if rows.anchor is not None or rows.marked.any():
            return rows.targets_words
        if row is None:
            return rows.branch.path if rows.branch is not None else ""
        return self.session.short_name(self.session.table.names[row])

    def compose(self) -> ComposeResult:
        yield from self.bars()
        with Horizontal(id="body"):
            with Vertical(id="left"):
                yield self.table_head
                yield self.table
            yield self.inspector
        yield Static("", id="empty", markup=False)
        yield self.info
        yield Static("", id="filter-notes", markup=False)
        # right below the screen: what it tells would come later than the next key by another level
        yield Line(self._complete_filter, self.filter_hint, "filter-line")
        yield from self.lines()
        yield KeyBar()

    def lines(self) -> ComposeResult:
        """Yield further lines to type in."""
        yield from ()

    @property
    def _legend(self) -> str:
        """What a sign in small plots is, where one has it."""
        shade = f"{SHADE} {HOLE_TEXTS[Gap.NONE]}" if self.table.shaded or self.inspector.shaded else ""
        facts, names = self.session.table.facts, map(self.table.sight.shown_name, self.table.rows_on_screen())
        unseen = "changed" in self.table.titles and any(facts.detail(each, "change_seen") == 0 for each in names)
        return " │ ".join(filter(None, (f"{UNSEEN} no change seen yet" * unseen, shade)))

    def on_mount(self) -> None:
        self.table.focus()
        self.settings_changed()
        self._lay_out(self.app.size.width)

    def on_resize(self, event: events.Resize) -> None:
        self._lay_out(event.size.width)

    def _lay_out(self, width: int) -> None:
        wanted = width >= INSPECTOR_FROM if self.inspector_wanted is None else self.inspector_wanted
        self.inspector.display = wanted
        below = width < WIDE  # no room beside the table: under it, over the whole width
        self.query_one("#body").set_class(below, "below")
        self.inspector.below = below
        inspector_width = width if below else self.inspector_width(width)
        self.inspector.styles.width = inspector_width
        self.lay_out_table(width, width - (inspector_width if wanted and not below else 0))
        self.table_head.refresh()
        self.request_view_soon()

    def inspector_width(self, width: int) -> int:
        """Return the cells of the inspector on a screen of `width` cells."""
        least = self.inspector_least
        return least if width < 140 else min(64, least + 2 + (width - 130) // 3)

    @abstractmethod
    def lay_out_table(self, width: int, rest: int) -> None:
        """Choose the columns; `rest` of the screen's `width` cells is for the table."""

    # ------------------------------------------------------------------------------------ what the app tells us

    def table_changed(self) -> None:
        self.table.rows_changed()
        self.table_head.refresh()
        self.inspector.refresh()
        self.info.refresh()
        self.update_keys()
        self.show_why_empty()
        self.request_view_soon()

    def second_passed(self) -> None:
        super().second_passed()
        if self.session.reading:
            self.info.changed()

    def show_why_empty(self) -> None:
        """Say why no element is shown, as long as none is."""
        why = "" if len(self.session.rows.shown) else self.why_empty()
        for empty in self.query("#empty").results(Static):  # none while the screen goes
            empty.display = bool(why)
            empty.update(why)

    def status_changed(self) -> None:
        super().status_changed()
        self.info.refresh()
        self.table.live_changed()
        self.inspector.refresh()

    def live_changed(self, frame: Frame) -> None:
        self.table.live_changed()
        super().live_changed(frame)
        if self.inspector.display:
            self.inspector.live_changed()

    @property
    def filter_before(self) -> str:
        """The filter that Esc goes back to; empty where it leaves none."""
        return ""

    def why_empty(self) -> str:
        """Return why no element is shown, and what to do about it; empty where one need not be told."""
        if not len(self.session.table):
            return ""
        esc = f"goes back to {before!r}" if (before := self.filter_before) else "clears it"
        return f"No element passes the filter {self.session.rows.filter.text!r} ({self._why_none()}). Esc {esc}."

    # ------------------------------------------------------------------------------------------------ the view

    def on_element_table_moved(self) -> None:
        """Let other panes follow cursor and scroll at once, the view soon."""
        if self.inspector.display:
            self.inspector.refresh()
        self.table_head.refresh()
        self.info.refresh()
        self.update_keys()
        self.request_view_soon()

    def request_view_soon(self) -> None:
        """Request the view when the rows on the screen have settled."""
        self.once_settled("view", DEBOUNCE_S, self.request_view)

    # -------------------------------------------------------------------------------------------------- moving

    def _move(self, position: int) -> None:
        self.session.rows.move_to(position)
        self.table.show_cursor()

    def command_step(self, lines: int) -> None:
        self._move(self.session.rows.position + lines)

    def command_end(self, last: bool) -> None:
        self._move(len(self.session.rows.tree.lines) - 1 if last else 0)

    def command_half_page(self, pages: int) -> None:
        self.command_step(pages * max(1, self.table.size.height // 2))

    # ------------------------------------------------------------------------------------ filter, marks, order

    def command_filter(self, typed: Spelled = BY_KEY) -> None:
        if typed is not BY_KEY:
            self._filter_by(typed.rest)
            return
        over = self.query_one("#filter-line", Line).begin_over(self.session.rows.filter.text)
        self.query_one(KeyBar).show_instead(over + FILTER_KEYS)
        self.info.display = False
        self._show_filter()

    def _is_empty(self) -> bool:
        """Return whether there is no row that a key could be about, and say so."""
        if not len(self.session.rows.shown):
            self.say("no element is here")
        return not len(self.session.rows.shown)

    def command_mark(self, typed: Spelled = BY_KEY) -> None:
        if self._is_empty():
            return
        rows = self.session.rows
        if typed is not BY_KEY:
            mask = filters.parse(typed.rest).mask(rows.table, rows.marked) if typed.arguments else rows.shown
            rows.marked[mask] = True
            self.table_changed()
            return
        if (branch := rows.branch) is not None:
            rows.toggle_mark()
            done = "marked" if rows.marked[branch.rows].all() else "no longer marked"
            self.say(f"{many(len(branch.rows), 'element')} of {branch.path} {done}")
            self._marks_changed()
            return
        self.info.give_way()
        rows.toggle_mark()
        if rows.entry is not None and rows.row is not None:
            done = "marked" if rows.marked[rows.row] else "no longer marked"
            self.say(f"{self.session.short_name(rows.table.names[rows.row])} {done}, with all its entries")
        self.command_step(1)

    def command_mark_shown(self) -> None:
        if not self._is_empty():
            rows = self.session.rows
            done = "marked" if rows.mark_shown() and rows.marked[rows.shown].all() else "unmarked"
            self.say(f"{done} all {len(rows.shown)} that are shown")
            self._marks_changed()

    def command_range(self) -> None:
        if self._is_empty():
            return
        rows = self.session.rows
        if rows.anchor is None:
            rows.begin_range()
        else:
            self.say(f"range of {rows.end_range()} marked")
        self._marks_changed()

    def _marks_changed(self) -> None:
        self.table.live_changed()
        self.info.refresh()

    def why_not_now(self, command_id: str) -> str:
        """Return why nothing can be unmarked, or that no row is there."""
        if command_id == "unmark":
            return "" if self.session.rows.marked_count else "none marked"
        return "no element is here" if self._lacks_rows(command_id) else super().why_not_now(command_id)

    def command_unmark(self) -> None:
        self.info.give_way()  # how many were marked is no longer so
        self.session.rows.clear_marks()
        self.context.table_changed()

    def command_goto(self, typed: Spelled) -> None:
        """Go to an element, from any screen; a part of its name is enough. In a tree to a name space, too."""
        self._go_to(typed.rest)
        if self.context.upper_screen is not self:
            self.action_command("go_home")
        self.context.table_changed()
        self.table.show_cursor(self.table.size.height // 2)  # a name space with what it holds

    def _go_to(self, name: str) -> None:
        table, rows = self.session.table, self.session.rows
        row = next((at for each in (name, table.prefix + name) if (at := table.row(each)) is not None), None)
        if row is None and rows.move_to_space(name) and rows.branch is not None:
            self.say(f"{rows.branch.path}: keys are about all {many(len(rows.branch.rows), 'element')} of it")
            return
        if row is None:
            words = name.casefold().split()
            found = [at for at, names in enumerate(table.searched)
                     if any(all(word in each for word in words) for each in names)]  # fmt: skip
            if not found or not name:
                raise ValueError(
                    f"no element has {name!r} in its name; {key_of('filter')} says which of its words none has"
                )
            row = next((each for each in found if rows.own_name(each) in words), found[0])
            if len(found) > 1:
                self.say(f"the first of {len(found)} that have {name!r}; {key_of('filter')} {name} shows all")
        if not rows.move_to_row(row):
            self._filter_by("")
            rows.move_to_row(row)

    def command_sort(self, typed: Spelled = BY_KEY) -> None:
        rows = self.session.rows
        if typed is not BY_KEY:
            order = BEFORE.get(typed.rest, typed.rest)
            if order not in rows.orders:
                raise ValueError(f"sort by one of {', '.join(rows.orders)}")
            self._order_by(order)
            return
        ask(self, OrderDialog(list(rows.orders.values()), rows.sort, rows.arrow), self._order_by)

    def _order_by(self, order: str) -> None:
        self.session.rows.order_by(order)
        if order != NAME:  # who goes back to names stays where he is; else one wants to see what is on top
            self.session.rows.move_to(0)
        self.order_changed()
        self.table_changed()

    def order_changed(self) -> None:
        """Follow another order: heads, and what has to be known for it."""
        self.table_head.refresh()

    def show_set(self, name: str) -> bool:
        """Show another set of columns; False where there is none of that name."""
        if name in self.table.sets:
            self.table.column_set = name
        self._lay_out(self.app.size.width)
        return name in self.table.sets

    def command_columns(self) -> None:
        """Show the next set that brings other columns: on a wide screen some stand beside one another."""
        sets, before = self.table.sets, self.table.titles
        at = sets.index(self.table.column_set)
        for name in (*sets[at + 1 :], *sets[: at + 1]):
            self.show_set(name)
            if self.table.titles != before:
                break
        has_statistics = "mean" in self.table.titles
        beside = " and statistics" if has_statistics and name != "statistics" else ""
        told = self.statistics_words() if has_statistics else ""
        left_out = and_more(self.table.laid.left_out, 3)
        self.say(f"columns: {name}{beside}{told}" + (f"; {left_out} at a wider terminal" if left_out else ""))
        self.table_changed()

    @abstractmethod
    def statistics_words(self) -> str:
        """Return of which samples the statistics are."""

    def command_fold(self) -> None:
        rows = self.session.rows
        was, words = rows.sort, rows.fold()
        back = f"; {key_of('sort')} {rows.orders[NAME].letter} brings the list back" if rows.sort != was else ""
        self.say(words + back)
        self.table_changed()

    def command_into(self) -> None:
        rows = self.session.rows
        if rows.row is not None and rows.row not in rows.targets():  # others are marked
            self.plot_rows([rows.row])
        else:
            self.action_command("fold" if rows.branch is not None else "plot" if self.scope == "file" else "monitor")

    def command_plot(self) -> None:
        self.sure_of_hidden(lambda: self.plot_rows(self.session.rows.targets().tolist()), "Plot")

    command_monitor = command_plot  # as it is called over a logger

    def command_add_plot(self, typed: Spelled) -> None:
        """Plot what is named, whatever is marked."""
        if not typed.arguments:
            raise ValueError(WHAT_TO_PLOT)
        self.plot_rows(list(dict.fromkeys(row for row, _ in self.session.named(typed.arguments, scalars=True))))

    @abstractmethod
    def plot_rows(self, chosen: Sequence[int]) -> None:
        """Show plots of these elements."""

    def command_component(self) -> None:
        self.say(self.session.rows.next_component())
        self.table_changed()

    def on_table_head_picked(self, event: TableHead.Picked) -> None:
        """Order by the column whose head was clicked; a second click turns the order round."""
        self._order_by(event.order)
        self.table_head.refresh()

    def sure_of_hidden(self, then: Callable[[], None], verb: str = "Change") -> None:
        """Ask first where what is marked is hidden: nobody sees what would be changed, or plotted."""
        rows = self.session.rows
        names = [self.session.short_name(rows.table.names[row]) for row in rows.hidden_targets()]
        hidden, count = len(names), len(rows.targets())
        if not hidden:
            then()
            return
        body = "Hidden by the filter:\n" + and_more(names, 8, "\n")
        title = f"{hidden} of the {many(count, 'marked element')} are hidden. {verb} all {count}?"
        choices = [Choice("", "No"), Choice("all", f"All {count}", "y")]
        if count > hidden:
            choices.append(
                Choice("shown", f"Only the {count - hidden} that are shown; the others lose their marks", "s")
            )
        elif rows.row is not None:
            here = self.session.short_name(rows.table.names[rows.row])
            choices.append(Choice("here", f"Only {here}, where the cursor is; the marks go", "c"))

        def answered(answer: str) -> None:
            if answer == "shown":
                rows.marked[rows.hidden_targets()] = False
            if answer == "here":
                rows.clear_marks()
            self._marks_changed()
            then()

        ask(self, Question(title, body, choices), answered)

    def show_plots(self, screen: "PlotScreen") -> None:
        """Show plots of what is marked or under the cursor; of a vector whose entry is looked at alone, that one."""
        rows = self.session.rows
        alone = {rows.table.names[row]: entry for row in rows.targets() if (entry := rows.entry_alone(row)) is not None}
        plots = screen.stack.plots
        kept = [each for each in plots if alone.get(each.element.name, each.position) == each.position]
        if kept != plots:
            screen.stack.keep(kept)
        self.app.push_screen(screen)

    @property
    def _inspector_opened(self) -> bool:
        """Whether the inspector is there because somebody asked for it."""
        return bool(self.inspector_wanted) and self.app.size.width < INSPECTOR_FROM

    def command_inspector(self) -> None:
        self.inspector_wanted = not self.inspector.display
        self._lay_out(self.app.size.width)

    def label_now(self, command: Command) -> str:
        """Return it; nothing of what is about rows where there are none.

        What is folded is a vector into one line, or a name space, of which only a tree has lines.
        """
        rows, label = self.session.rows, super().label_now(command)
        if label != OPEN_FILE and self._lacks_rows(command.id):
            return ""
        if command.id != "fold":
            return label
        if rows.vector:
            return "Fold" if rows.vector in rows.unfolded else "Entries"
        return command.label if rows.sort == TREE else ""

    def _lacks_rows(self, command_id: str) -> bool:
        """Whether a command is about rows, or marks, and there are none."""
        rows = self.session.rows
        return not len(rows.shown) and (
            command_id in OF_ROWS
            or ((command_id in OF_MARKED or BY_ID[command_id].does == "edit_field") and not len(rows.targets()))
        )

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what a range or a filter asks for, or a name space under the cursor."""
        rows = self.session.rows
        if rows.anchor is not None:
            return (("range", "Mark the range"), ("back", "Leave it"))
        into = []
        if rows.branch is not None:
            into = [("into", "Unfold" if rows.branch.path in rows.folded else "Fold")]
        elif rows.sort == TREE and rows.vector:
            into = [("fold", self.label_now(BY_ID["fold"]))]
        if self._inspector_opened:
            return (*into, ("back", "Close"))
        if not rows.filter.text:
            return into
        plot = next(each for each in ("monitor", "plot") if self.scope in BY_ID[each].scopes)
        then = [plot] if rows.marked_count else ["mark_shown"] if len(rows.shown) else []
        if then and not self.session.table.pending_count[0]:  # what edits ask for needs the room
            then += [plot, "mark", *(["menu_view"] if with_keys(BY_ID["menu_view"]).keys else [])]
        called = {"mark_shown": "Mark all", "menu_view": "View"}
        each_once = [(each, called.get(each) or self.label_now(BY_ID[each])) for each in dict.fromkeys(then)]
        back = f"Back to {cut(before, BEFORE_ROOM)}" if (before := self.filter_before) else "No filter"
        return (*into, ("filter", "Filter"), ("back", back), *each_once)

    def command_back(self) -> None:
        """Leave the inspector that was asked for, the range, the filter, the marks, the tour; never pending edits."""
        rows, told, is_hint = self.session.rows, "", False
        if self._inspector_opened:
            self.inspector_wanted = None
            self._lay_out(self.app.size.width)
        elif rows.anchor is not None:
            rows.anchor = None
        elif rows.filter.text:
            self._filter_by("")
        elif rows.marked_count:
            rows.clear_marks()
        elif self.context.tour is not None:
            self.context.tour, told = None, "the tour ends; :tour begins it again"
            self.show_news(self.context.news)
        else:
            here = {command.id for command in commands_for(self.scope)}
            ways = [f"{key_of(each)} {words}" for each, words in AWAY.items() if each in here and key_of(each)]
            told, is_hint = f"nothing to leave here: {', '.join(ways)}", True
        self.say(told, hint=is_hint)
        self.table_changed()

    # --------------------------------------------------------------------------------------------- typed lines

    def on_input_changed(self, event: Input.Changed) -> None:
        if event.input.id == "filter-line" and event.input.display:
            self._filter_by(event.input.value)  # of keys that came at once, what they made

    def on_line_touched(self) -> None:
        """Name the keys of the filter alone."""
        self.query_one(KeyBar).show_instead(FILTER_KEYS)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Take what was entered in one of the lines; a cell was taken when it was checked."""
        self._back_to_table()
        if event.line.id == "filter-line":  # typed and entered at once, the line is gone before it says that it changed
            self._filter_by(event.value)
            self.info.give_way()  # what was said may be of what the filter before hid

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Leave a line; the filter is cleared too."""
        self._back_to_table()
        self.info.give_way()
        if event.line.id == "filter-line":
            self._filter_by("")

    def _filter_by(self, words: str) -> None:
        before = self.session.rows.filter.quantities
        self.session.rows.set_filter(words)
        if self.session.rows.filter.quantities != before:
            self._lay_out(self.app.size.width)
        self.table_changed()
        self._show_filter()

    def _show_filter(self) -> None:
        """Show what passes the filter while it is typed, and what is the matter with it."""
        line, notes = self.query_one("#filter-line", Line), self.query_one("#filter-notes", Static)
        notes.display = line.display
        if not line.display:
            return
        rows, found = self.session.rows, self.session.rows.filter
        hidden = f" │ {rows.hidden_marked} marked are hidden" if rows.hidden_marked else ""
        count = f"{len(rows.shown)} of {len(self.session.table)}{hidden}"
        room = self.app.size.width - 2 - len(count)
        words = filters.explained(line.value) if line.value else FILTER_HINTS
        if found.problems:
            begin, end = found.places[0]
            words = f"{' ' * begin}{'^' * (end - begin)} {found.problems[0]}; left out meanwhile"
            if len(words) >= room:  # the reason whole, where both have no room on one line
                words = f"{found.problems[0]}\n{' ' * begin}{'^' * (end - begin)}"
        elif found.measured and not rows.is_measured:
            words = "… being measured: all are shown until then"
        elif not len(rows.shown) and len(self.session.table):
            words = self._why_none()
        elif line.value and (by := found.by_component(self.session.table, rows.marked, rows.shown.tolist())):
            words = f"{len(by)} by a component: {self.session.short_name(self.session.table.names[by[0]])}"
            words += " …" if len(by) > 1 else ""
        elif line.value and (by := found.by_description(self.session.table, rows.marked, rows.shown.tolist())):
            words = f"{len(by)} by what is said of them: {self.session.table.elements[by[0]].description}"
        elif line.value and not words and (more := found.more_described(self.session.table, rows.marked)):
            words = f"+ {more} by what is said of them: desc:{line.value.split()[0]}"
        *above, last = words.split("\n")
        above += [last] if len(last) >= room else []
        notes.update("\n".join([*above, f"{'' if len(last) >= room else last:<{max(0, room)}}{count}"]))

    def _why_none(self) -> str:
        """Return which terms take everything away, and the names that are most like what has none."""
        table, rows = self.session.table, self.session.rows
        blocked, none = rows.filter.blocked_by(table, rows.marked), rows.filter.without_any(table, rows.marked)
        levels = {level.casefold(): level for name in table.names for level in parts_of(self.session.short_name(name))}
        near = did_you_mean(levels[one] for term in none for one in nearest(term.casefold(), levels))
        if blocked is None:
            why = f"nothing has {' or '.join(none)}{near}" if none else "each term has some, no element has all"
            return f"0 of {len(table)}: {why}"
        term, count = blocked
        if term == "frozen":  # which those are not that were constant from the first on
            return f"0 of {len(table)}: {term}: none stopped changing; std=0 has those that never changed"
        if glob := glob_of_regex(term):
            return f"0 of {len(table)}: {term} is no glob; {glob} is one, ~{term} a regular expression"
        if term.endswith("]"):
            return f"0 of {len(table)}: {term}: [ ] stands for one of the letters in it{near}"
        if set(term) & set("^$+\\") and not term.lstrip("-").startswith("~"):
            return f"0 of {len(table)}: {term} has signs of a regular expression, which begins with ~"
        return f"0 of {len(table)}; without {term}: {count}{near}"

    def _back_to_table(self) -> None:
        self.query_one("#filter-notes").display = False
        self.query_one(KeyBar).show_instead("")
        self.info.ask("")
        self.info.display = True
        self.info.refresh()
        self.table.focus()

    def _complete_filter(self, line: str) -> list[str]:
        head, _, last = line.rpartition(" ")
        units = sorted({element.unit for element in self.session.table.elements if element.unit != "-"})
        found = filters.completions(last, units)
        if "/" in last:
            found += next_levels(last, list(map(self.session.short_name, self.session.table.names)))
        return [f"{head} {term}".lstrip() for term in found]

    def on_line_completed(self, event: Line.Completed) -> None:
        """Show what else the filter may become."""
        if event.words and self.query_one("#filter-line", Line).display:
            self.query_one("#filter-notes", Static).update(event.words)
