"""Everything that can be done, once: key bar, help, command palette and `:` words are made from this list.

`keys` are those of the classic keymap, and of the usual one where the table of `keymap` has no others for a command.

A command with id `x` is carried out by the method `command_x` of the screen, else of `CommandRunner`, else of the app:
by key, by word and from the palette; those that do the same by another amount share one. A new one touches its entry,
its row in `keymap` if it stands in a menu, that method and its test. Keys avoid what terminals eat: `ctrl+h/i/j/m`,
`alt+letter`, `ctrl+enter`. This imports nothing of `silo_tui`.
"""

import unicodedata
from collections.abc import Mapping, Sequence
from functools import cache, partial
from types import MappingProxyType

import msgspec
from textual.keys import REPLACED_KEYS

from silo.files.formats import SAVED_NAMES
from silo.settings.options import OPTION

PAGE = "`silo-tui --serve`, typed in a shell, shows all of it as a web page, in a browser"


class Typed(msgspec.Struct, frozen=True):
    """How a command is typed after `:`.

    `completes` names what its argument may be (see `CommandRunner.choices`). `usage` and `help` are its line on the
    help page, `place` the order of these lines; without a usage it has none. `reads`: its method is told what was
    typed, as a `Spelled`.
    """

    words: tuple[str, ...]
    completes: str = ""
    usage: str = ""
    help: str = ""
    place: int = 0
    reads: bool = False


class Command(msgspec.Struct, frozen=True):
    """One thing that can be done.

    `scopes` are the screens where its keys count (`any`: all of them; none: it can only be typed). `footer` is its
    place in the key bar, 0: none. `writes` commands change the logger or its table: they are refused with
    `--read-only`. Those that `asks` need a logger that answers; where the link is lost, those that
    `retries` look for it at once instead. What `robot` does is of no use once the robot program is gone; the rest its
    helper process does. `hidden` ones are left out of the palette. Several may share a method, that
    of what they do, which is told what is `given`.
    """

    id: str
    keys: str
    label: str
    help: str
    group: str
    scopes: tuple[str, ...]
    footer: int = 0
    writes: bool = False
    asks: bool = False
    retries: bool = False
    robot: bool = False
    hidden: bool = False
    shown_key: str = ""
    typed: Typed | None = None
    does: str = ""
    given: str | int = ""

    @property
    def method(self) -> str:
        """What carries it out."""
        return f"command_{self.does or self.id}"

    @property
    def key_text(self) -> str:
        """All keys as people write them."""
        return (", " if " " in self.keys else " ").join(map(key_text, self.keys.split(",")))

    @property
    def footer_key(self) -> str:
        """The one key that stands in the key bar."""
        return self.shown_key or key_text(self.keys.split(",", 1)[0])


KEY_TEXTS = {
    "slash": "/", "asterisk": "*", "question_mark": "?", "colon": ":", "equals_sign": "=", "exclamation_mark": "!",
    "less_than_sign": "<", "backslash": "\\", "greater_than_sign": ">",
    "escape": "Esc", "enter": "Enter",
    "space": "space", "up": "↑", "down": "↓", "left": "←", "right": "→", "plus": "+", "minus": "-", "underscore": "_",
    "pageup": "PgUp", "pagedown": "PgDn", "home": "Home", "end": "End", "full_stop": ".", "tab": "Tab", "comma": ",",
    "circumflex_accent": "^", "dollar_sign": "$",
    "shift+left": "⇧←", "shift+right": "⇧→", "ctrl+r": "^r", "ctrl+p": "^p", "ctrl+d": "^d", "ctrl+u": "^u",
    "ctrl+l": "^l", "ctrl+q": "^q", "ctrl+z": "^z", "f1": "F1", "f2": "F2",
    "right_square_bracket": "]", "left_square_bracket": "[",
    "right_curly_bracket": "}", "left_curly_bracket": "{",
}  # fmt: skip


def key_text(key: str) -> str:
    """Return a key as people write it: `^d`, `F2`, `#`; of a menu its letter before: `e d`."""
    if " " in key:
        return " ".join(map(key_text, key.split()))
    if key in KEY_TEXTS or len(key) == 1:
        return KEY_TEXTS.get(key, key)
    for modifier, sign in (("ctrl+", "^"), ("shift+", "⇧")):
        if key.startswith(modifier):
            return sign + key_text(key.removeprefix(modifier))
    try:
        sign = unicodedata.lookup(REPLACED_KEYS.get(key, key).replace("_", " ").upper())
    except KeyError:
        sign = ""
    return sign if sign.isprintable() and sign else key.upper() if key[1:].isdecimal() else key.capitalize()


_TABLE = ("table",)
_MONITOR = ("monitor",)
_DETAIL = ("detail",)
_LOGGERS = ("loggers",)
_SETTINGS = ("settings",)
_RECORDINGS = ("recordings",)
_TRIGGERS = ("triggers",)
_ALARMS = ("alarms",)
_PARAMETERS = ("parameters",)
_RUNS = ("runs",)
_COMPARED = ("comparison",)
_RESPONSE = ("response",)
_CONDITIONS = _TRIGGERS + _ALARMS
_EVENTS = ("events",)
_BOTH = ("table", "monitor")
# the same screens on a file: what changes a logger has no place there
_FILE = ("file",)
_FILE_MONITOR = ("file_monitor",)
_FILE_DETAIL = ("file_detail",)
_FILE_EVENTS = ("file_events",)
_TABLES = _TABLE + _FILE
_MONITORS = _MONITOR + _FILE_MONITOR
_DETAILS = _DETAIL + _FILE_DETAIL
_SCOPE = ("scope",)
_PLOTS = _MONITORS + _DETAILS
_LIVE_PLOTS = _MONITOR + _DETAIL
_HAPPENED = _EVENTS + _FILE_EVENTS
_MARKING = _BOTH + _DETAIL + _EVENTS
_ASIDE = _CONDITIONS + _PARAMETERS + _RECORDINGS + _EVENTS
_OF_LOGGER = _BOTH + _DETAIL + _SCOPE + _ASIDE
_MARKED = _CONDITIONS + _PARAMETERS + _RECORDINGS + _LOGGERS + _RUNS
_ORDERED = _MARKED + _HAPPENED + _COMPARED
_MESSAGES = ("messages",)
_LISTS = _ORDERED + _SETTINGS + _MESSAGES
FILE_SCOPES = _FILE + _FILE_MONITOR + _FILE_DETAIL + _FILE_EVENTS


FAR = 10  # steps

_read = partial(Typed, reads=True)
_helped = partial(Command, writes=True, asks=True)  # what changes a logger that answers, or what it left
_acts = partial(_helped, robot=True)
_edits = partial(Command, writes=True, robot=True)


def _typed(option: str) -> str:
    return f"type a {option}: {', '.join(OPTION[option].examples)}"


def _words(option: str) -> str:
    return ", ".join(word.phrase or word.word for word in OPTION[option].words)


# fmt: off
COMMANDS: tuple[Command, ...] = (
    # ------------------------------------------------------------------------------------------------- moving
    Command("down", "j,down", "Down", "next element", "Move", _TABLES, hidden=True, does="step", given=1),
    Command("up", "k,up", "Up", "previous element", "Move", _TABLES, hidden=True, does="step", given=-1),
    Command("top", "g,home", "Top", "first element", "Move", _TABLES, does="end", given=False),
    Command("bottom", "G,end", "Bottom", "last element", "Move", _TABLES, does="end", given=True),
    Command("half_down", "ctrl+d,pagedown", "Page down", "half a page down", "Move", _TABLES,
            does="half_page", given=1),
    Command("half_up", "ctrl+u,pageup", "Page up", "half a page up", "Move", _TABLES, does="half_page", given=-1),
    Command("left", "h,left", "Field left", "previous field", "Move", _TABLE, hidden=True),
    Command("right", "l,right,tab", "Field right", "next field", "Move", _TABLE, hidden=True),
    # ------------------------------------------------------------------------------------------ finding, marking
    Command("filter", "slash", "Filter", "show only some elements", "Find and mark", _TABLES, 2,
            typed=_read(("filter",))),
    Command("mark", "space", "Mark", "mark or unmark, and move on", "Find and mark", _TABLES, 1,
            typed=_read(("mark",))),
    Command("mark_shown", "asterisk", "Mark all", "mark all that are shown (again: unmark)", "Find and mark",
            _TABLES, 13),
    Command("range", "V", "Range", "begin a range, move, the same key marks it", "Find and mark", _TABLES),
    Command("sort", "o", "Order", "choose an order; its letter again turns it round", "Find and mark", _TABLES, 3,
            typed=_read(("sort",), "sorts", ":sort div", "order by a column", 6)),
    Command("into", "", "Into", "plot the element; fold a name space, or unfold it", "Look", _TABLES),
    Command("fold", "z", "Fold", "fold or unfold a name space, a vector into its entries", "Find and mark", _TABLES, 4),
    Command("component", "n", "Vector", "norm of a vector, its first entry, the next ...", "Look", _TABLES),
    Command("columns", "C", "Columns", "settings or values, statistics, timing", "Look", _TABLES),
    Command("zero", "Z", "Zero", "reset min, max, mean: from now on (of the last seconds: derive max(x, 10s))", "Look",
            _TABLE + _MONITOR),
    # ------------------------------------------------------------------------------------------------- editing
    _edits("edit", "e,enter", "Edit", "edit the field that ← → chose, else ask which", "Edit", _TABLE, 5),
    _edits("toggle", "t", "On/Off", "switch logging on or off", "Edit", _TABLE, 13, does="edit_field",
            given="ENABLED"),
    _edits("edit_divider", "d", "Divider", _typed("divider"), "Edit", _TABLE, does="edit_field",
            given="DIVIDER"),
    _edits("edit_size", "s", "Size", _typed("size"), "Edit", _TABLE, does="edit_field", given="SIZE"),
    _edits("next_buffer", "b", "Buffer", _words("buffer"), "Edit", _TABLE, does="edit_field",
            given="BUFFER"),
    _edits("next_action", "p", "Action", _words("action"), "Edit", _TABLE, does="edit_field",
            given="ACTION"),
    _edits("edit_all", "equals_sign", "Set to", "type a value, or words: div=5 size=10s buf=loop", "Edit", _TABLE),
    Command("undo", "u", "Undo", "take the last edit back", "Edit", _TABLE + _PARAMETERS, 14, typed=Typed(("undo",))),
    Command("redo", "ctrl+r", "Redo", "do it again", "Edit", _TABLE + _PARAMETERS, typed=Typed(("redo",))),
    _acts("apply", "a", "Apply", "show what would change, and apply it", "Edit", _OF_LOGGER, 6,
          typed=Typed(("apply",))),
    Command("discard", "x", "Discard", "drop pending edits of the element, or of all marked; forget a derived signal",
            "Edit", _TABLE, typed=Typed(("discard",))),
    _acts("forget_derived", "", "Delete", "forget the derived signal, after a question", "Edit", _TABLE),
    # -------------------------------------------------------------------------------------------------- logger
    _acts("start_stop", "S", "Start/Stop", "start or stop logging", "Logger", _OF_LOGGER, 8,
          typed=_read(("start", "stop"))),
    _acts("restart", "R", "Restart", "stop and start again", "Logger", _OF_LOGGER, typed=Typed(("restart",))),
    _helped("save_data", "w", "Save", "write the logged data to files", "Logger", _TABLE, 9,
            typed=_read(("data",), "types", f":data {' '.join(SAVED_NAMES)} NAME", "save data", 4)),
    _acts("load_script", "L", "Load script", "settings that were saved: see what differs; load them", "Logger", _TABLE,
            typed=_read(("load",), "scripts", ":load x.yaml", "load a script", 1)),
    _helped("save_script", "W", "Save script", "store the configuration as a file on the robot", "Logger", _TABLE,
            typed=_read(("save",), "scripts", ":save x.yaml", "save the script", 2)),
    Command("refresh", "r", "Refresh", "read the table again", "Logger", _TABLE, asks=True,
            retries=True, typed=Typed(("refresh",))),
    # ------------------------------------------------------------------------------------------------- looking
    Command("monitor", "m", "Plot", "plot what is marked, or the element under the cursor", "Look", _TABLE, 7,
            typed=Typed(("monitor",))),
    Command("inspector", "i", "Inspector", "show or hide all about the element, beside or below", "Look", _TABLES),
    Command("plot_down", "j,down", "Next", "next plot", "Plots", _MONITORS, does="choose_plot", given=1),
    Command("plot_up", "k,up", "Previous", "previous plot", "Plots", _MONITORS, does="choose_plot", given=-1),
    Command("plot_top", "g", "First", "first plot", "Plots", _MONITORS, does="choose_end", given=False),
    Command("plot_bottom", "G", "Last", "last plot", "Plots", _MONITORS, does="choose_end", given=True),
    Command("pause", "space", "Pause", "freeze what is shown, and as much before it", "Plots", _LIVE_PLOTS, 1),
    Command("closer", "plus,equals_sign", "Zoom", "shorter time span, or range of frequencies", "Plots",
            _PLOTS + _SCOPE, 2, shown_key="+", does="zoom", given=True),
    Command("wider", "minus", "Zoom out", "longer time span, or range of frequencies", "Plots", _PLOTS + _SCOPE,
            does="zoom", given=False),
    Command("cursor_left", "h,left", "Cursor", "cursor to the left", "Plots", _PLOTS + _SCOPE, 4, shown_key="←→",
            does="move_cursor", given=-1),
    Command("cursor_right", "l,right", "Cursor right", "cursor to the right", "Plots", _PLOTS + _SCOPE,
            does="move_cursor", given=1),
    Command("cursor_far_left", "shift+left", "Far left", "cursor ten to the left", "Plots", _PLOTS + _SCOPE,
            does="move_cursor", given=-FAR),
    Command("cursor_far_right", "shift+right", "Far right", "cursor ten to the right", "Plots", _PLOTS + _SCOPE,
            does="move_cursor", given=FAR),
    Command("scale", "y", "Y scale", "hold the y scale, or let it follow", "Plots", _PLOTS, 5),
    Command("catch", "c", "Catch", "the scope: crossings of a level stand still", "Plots", _LIVE_PLOTS, asks=True,
            robot=True),
    Command("scope_mode", "c", "Mode", "normal, single, auto", "Scope", _SCOPE, 1),
    Command("level_down", "less_than_sign", "Level", "level down", "Scope", _SCOPE, 2, shown_key="< >",
            does="move_level", given=-1),
    Command("level_up", "greater_than_sign", "Level up", "level up", "Scope", _SCOPE, does="move_level", given=1),
    Command("scope_force", "exclamation_mark", "Force", "show what is there now", "Scope", _SCOPE, 3),
    Command("scope_settings", "e", "Settings", "edge, level, pre share, mode", "Scope", _SCOPE, 4),
    Command("scope_hold", "space", "Hold", "hold the picture, or go on; after single arm again", "Scope", _SCOPE, 5),
    Command("next_entry", "n", "Entry", "the next entry of the vector", "Plots", _MONITORS),
    Command("all_entries", "z", "Unfold", "all entries of the vector, or the chosen one alone", "Plots", _MONITORS),
    Command("log_axis", "Y", "Log axis", "y axis linear, or by powers of ten", "Plots", _MONITORS),
    Command("detail", "enter", "Large", "one large plot with axes", "Plots", _MONITORS, 6),
    Command("join_plots", "J", "Join", "this plot and the next one in one", "Plots", _MONITORS),
    Command("isolate_plot", "I", "Isolate", "the signal in a plot of its own again", "Plots", _MONITORS),
    Command("arrange_plots", "tab", "Views", "each alone, one plot per unit, as few as can be", "Plots", _MONITORS, 9),
    Command("cursor_b", "B", "Cursor B", "second cursor at A, or lift it: facts between", "Plots", _PLOTS, 6),
    Command("next_sample", "full_stop", "Next sample", "cursor to the next sample of the plot", "Plots", _PLOTS,
            does="step_sample", given=1),
    Command("previous_sample", "comma", "Sample before", "cursor to the sample before", "Plots", _PLOTS,
            does="step_sample", given=-1),
    Command("find", "f", "Find", "what is typed: > 5, last above 5, highest, hole, -3s ...", "Plots", _PLOTS, 4),
    Command("next_found", "right_square_bracket", "Next found",
            "next of what was looked for, or of the peaks", "Plots", _PLOTS, does="find_on", given=1),
    Command("previous_found", "left_square_bracket", "Found before",
            "the one before", "Plots", _PLOTS, does="find_on", given=-1),
    Command("next_event", "right_curly_bracket", "Next event", "next hole, trigger, marker", "Plots",
            _PLOTS + _HAPPENED, does="step_event", given=1),
    Command("previous_event", "left_curly_bracket", "Event before", "the event before", "Plots", _PLOTS + _HAPPENED,
            does="step_event", given=-1),
    Command("earlier", "pageup,ctrl+u", "Earlier", "half a window back, live too", "Plots", _PLOTS, 7, shown_key="PgUp",
            does="pan", given=-1),
    Command("later", "pagedown,ctrl+d", "Later", "half a window on", "Plots", _PLOTS, 8, shown_key="PgDn", does="pan",
            given=1),
    Command("oldest", "home,circumflex_accent", "Oldest", "the oldest that is held", "Plots", _PLOTS),
    Command("newest", "end,dollar_sign", "Newest", "now; in a file its end", "Plots", _PLOTS, 9, shown_key="End"),
    Command("all_held", "0", "All", "all that is held", "Plots", _PLOTS, 9),
    Command("export_plots", "w", "Write", "what is shown to a CSV, PNG or SVG file here", "Plots", _PLOTS,
            11),
    Command("drop_plot", "x", "Remove", "take the plot off the screen", "Plots", _MONITORS, 10),
    Command("add_plot", "m", "Plot", "plot more signals, added by their names", "Plots", _PLOTS, 9,
            typed=_read(("plot", "xy"), "names", ":plot NAME ...",
                        "plot more signals, added by their names; :xy over the chosen one", 6)),
    Command("mode", "tab,v", "View", "over time, x-y, spectrum, histogram", "Large plot", _DETAILS, 1),
    Command("level", "Y", "Log/dB", "y axis by powers of ten; of a spectrum also dB", "Large plot", _DETAILS, 2),
    Command("mode_time", "", "Over time", "the signals over time", "Large plot", _PLOTS, does="show_as", given="time"),
    Command("mode_spectrum", "", "Spectrum", "amplitudes by frequency, peaks", "Large plot", _PLOTS, does="show_as",
            given="spectrum"),
    Command("mode_xy", "", "X-Y", "one signal over another", "Large plot", _PLOTS, does="show_as", given="x-y"),
    Command("mode_histogram", "", "Histogram", "how often which value", "Large plot", _PLOTS, does="show_as",
            given="histogram"),
    Command("detail_swap", "X", "Swap", "swap x and y", "Large plot", _DETAILS, 8),
    Command("detail_down", "j,down", "Next", "next signal of the plots", "Large plot", _DETAILS, does="turn_to",
            given=1),
    Command("detail_up", "k,up", "Previous", "the signal before", "Large plot", _DETAILS, does="turn_to", given=-1),
    Command("detail_top", "g", "First", "first signal of the plots", "Large plot", _DETAILS,
            does="turn_to_end", given=False),
    Command("detail_bottom", "G", "Last", "last signal of the plots", "Large plot", _DETAILS,
            does="turn_to_end", given=True),
    Command("detail_refresh", "r", "Refresh", "draw with what came since", "Large plot", _DETAIL, 7),
    Command("try_link", "r", "Try now", "look for the logger at once, where the link is lost", "Go", _MONITOR + _SCOPE,
            asks=True, retries=True),
    # --------------------------------------------------------------------------------------------------- files
    Command("plot", "m,enter", "Plot", "plot what is marked, or the element under the cursor", "Look", _FILE, 3),
    # --------------------------------------------------------------------------------------------------- lists
    Command("list_down", "j,down", "Down", "next line", "Lists", _LISTS, hidden=True, does="list_step", given=1),
    Command("list_up", "k,up", "Up", "line above", "Lists", _LISTS, hidden=True, does="list_step", given=-1),
    Command("list_top", "g,home", "Top", "first line; of events the newest, and what comes", "Lists", _LISTS),
    Command("list_bottom", "G,end", "Bottom", "last line", "Lists", _LISTS),
    Command("list_page_down", "ctrl+d,pagedown", "Page down", "a page down", "Lists", _LISTS,
            does="list_page", given=1),
    Command("list_page_up", "ctrl+u,pageup", "Page up", "a page up", "Lists", _LISTS, does="list_page", given=-1),
    Command("list_filter", "slash", "Filter", "only lines with these words; events: -E no edits, M marks alone",
            "Lists", _LISTS, 8),
    Command("list_order", "o", "Order", "choose an order; its letter again turns it round", "Lists", _ORDERED, 9),
    Command("list_mark", "space", "Mark", "mark or unmark, and move on", "Lists", _MARKED, 2),
    Command("list_mark_all", "asterisk", "Mark all", "mark all that are shown (again: unmark)", "Lists", _MARKED),
    Command("list_range", "V", "Range", "begin a range, move, the same key marks it", "Lists", _MARKED),
    Command("list_read", "r", "Read again", "ask for the list again, and order it anew", "Lists", _ASIDE + _RUNS,
            asks=True, retries=True),
    # -------------------------------------------------------------------------------------------------- events
    _helped("set_marker", "M", "Marker", "mark the tick on the screen (paused: at cursor A) with some words", "Events",
            _MARKING, typed=Typed(("marker",))),
    _helped("episode_good", "f5", "Episode good", "the newest episode went well; it ends one begun by hand", "Events",
            _MARKING, does="say_of_episode", given="good"),
    _helped("episode_bad", "f6", "Episode bad", "the newest went badly", "Events", _MARKING, does="say_of_episode",
            given="bad"),
    _helped("episode_redo", "f7", "Episode redo", "the newest episode went badly and is to be done again", "Events",
            _MARKING, does="say_of_episode", given="redo"),
    _helped("episode", "f8", "Episode", "begin an episode by hand; its name is asked for", "Events", _MARKING,
            typed=_read(("episode",), "", ":episode begin NAME", "an episode: begin, end, good, bad, redo", 9)),
    Command("events", "E", "Events", "what happened, and who did it", "Go",
            _TABLES + _PLOTS + _CONDITIONS + _PARAMETERS + _RECORDINGS,
            typed=Typed(("events",))),
    Command("go_to_event", "enter", "Go there", "the plots stand still where it happened", "Events", _HAPPENED, 1),
    Command("write_events", "w", "Write", "the lines that are shown to a CSV file here", "Events", _HAPPENED, 5),
    # ------------------------------------------------------------------------------------------------- loggers
    Command("loggers", "ctrl+l", "Loggers", "all loggers, how each stands; choose another, command many", "Go",
            _BOTH + _DETAIL + _ASIDE, typed=Typed(("loggers", "fleet"))),
    Command("open_logger", "enter", "Open", "open this logger", "Loggers", _LOGGERS, 1),
    Command("start_stop_loggers", "S", "Start/Stop",
            "start or stop it, or all that are marked, after a question that names them", "Loggers", _LOGGERS, 3,
            writes=True, does="many", given="start_stop"),
    Command("restart_loggers", "R", "Restart", "stop and start it again, or all that are marked", "Loggers", _LOGGERS,
            writes=True, does="many", given="restart"),
    Command("save_loggers", "w", "Save", "write its data to files on the robot, or of all that are marked", "Loggers",
            _LOGGERS, 4, writes=True, does="many", given="save"),
    Command("load_into_loggers", "L", "Load script", "load a configuration into it, or into all that are marked",
            "Loggers", _LOGGERS, 5, writes=True, does="many", given="load"),
    Command("look_again", "r", "Look again", "forget those that are gone; try what could not be reached", "Loggers",
            _LOGGERS, 8),
    Command("demo", "D", "Demo", "start a simulated robot and open it", "Loggers", _LOGGERS, 7),
    # ---------------------------------------------------------------------------------------------- recordings
    Command("recordings", "F", "Recordings", "what was saved on the robot: open, fetch, delete", "Go",
            _BOTH + _DETAIL + _CONDITIONS + _PARAMETERS + _EVENTS, asks=True, typed=Typed(("files",))),
    Command("open_recording", "enter", "Open", "look into it here; Esc comes back", "Recordings", _RECORDINGS, 1),
    Command("fetch_recording", "w", "Fetch", "copy it to this machine; goes on where a link was cut", "Recordings",
            _RECORDINGS, 2, asks=True),
    Command("overlay_recording", "O", "Overlay", "lay it over the live plots, by time since start; again: lift it",
            "Recordings", _RECORDINGS, 3),
    _helped("delete_recording", "x", "Delete", "delete it on the robot, after a question", "Recordings", _RECORDINGS,
            4),
    _acts("record", "N", "Record", "a new recording of all, marked or named signals, for days", "Recordings",
            _RECORDINGS, 5, typed=_read(("record",))),
    _acts("stop_recording", "t", "Stop rec", "end a recording that runs; its parts stay", "Recordings", _RECORDINGS, 6,
          typed=Typed(("endrecording",))),
    # ------------------------------------------------------------------------------------- runs of this machine
    Command("runs", "f3", "Runs", "the runs of a folder of this machine, by what was measured", "Go",
            _TABLES + _PLOTS + _HAPPENED + _CONDITIONS + _PARAMETERS + _RECORDINGS + _LOGGERS,
            typed=_read(("runs",), "logs", ":runs FOLDER", "the runs of a folder of this machine", 8)),
    Command("open_run", "enter", "Open", "look into it; Esc comes back", "Runs", _RUNS, 1),
    Command("plot_compared", "enter", "Plot", "the signal of both runs, one over the other", "Runs", _COMPARED, 1),
    Command("overlay_runs", "O", "Overlay", "what is marked over each other, by time since start or an event", "Runs",
            _RUNS, 3),
    Command("compare_runs", "equals_sign", "Compare", "what differs between two that are marked", "Runs",
            _RUNS + _RECORDINGS, 6),
    Command("runs_column", "C", "Column", "a statistic among the columns; again: without it", "Runs", _RUNS, 4),
    # -------------------------------------------------------------------------------------- triggers and alarms
    Command("triggers", "T", "Triggers", "conditions that save what was logged around them", "Go",
            _TABLE + _MONITOR + _DETAIL + _ALARMS + _PARAMETERS + _RECORDINGS + _EVENTS, typed=Typed(("triggers",))),
    Command("alarms", "A", "Alarms", "what is, or was, beyond its limits", "Go",
            _TABLE + _MONITOR + _DETAIL + _TRIGGERS + _PARAMETERS + _RECORDINGS + _EVENTS, typed=Typed(("alarms",))),
    Command("plot_conditions", "m", "Plot", "plot what the line, or what is marked, is about", "Triggers and alarms",
            _CONDITIONS + _PARAMETERS, 7),
    _acts("trigger_toggle", "t", "Arm/Off", "have the trigger watch, or no more", "Triggers", _TRIGGERS, 1),
    _acts("trigger_edit", "e", "Edit", "change the trigger", "Triggers", _TRIGGERS, 2),
    _acts("trigger_new", "N", "New", "make a trigger", "Triggers", _TRIGGERS, 3),
    _acts("trigger_force", "exclamation_mark", "Force", "fire now, whatever the condition says", "Triggers", _TRIGGERS,
            4),
    Command("trigger_capture", "enter", "Open last", "plot what it captured last, the fire under the cursor",
            "Triggers", _TRIGGERS, 5),
    _acts("trigger_remove", "x", "Delete", "forget the trigger; its files stay", "Triggers", _TRIGGERS, 6),
    _acts("plot_trigger", "N", "New trigger", "a trigger at the level under the cursor", "Plots", _MONITOR + _SCOPE),
    _acts("new_of_row", "N", "New", "a trigger, or limits, of the element under the cursor", "Look", _TABLE),
    Command("last_capture", "", "Last capture", "plot what was captured last, of whichever trigger", "Look", _TABLE),
    _acts("arm_trigger", "", "Arm/Off", "have the only trigger watch, or no more", "Look", _TABLE),
    _acts("limits_of_row", "", "Limits", "limits of the element under the cursor, or of all marked", "Edit", _TABLE),
    _helped("acknowledge", "K", "Acknowledge", "say that you have seen the alarm", "Alarms", _ALARMS, 1),
    Command("alarm_worst", "enter", "Worst", "plot it, the worst sample under the cursor", "Alarms", _ALARMS, 2),
    _acts("alarm_limits", "e", "Limits", "other limits for the signal", "Alarms", _ALARMS, 3),
    _acts("alarm_new", "N", "New", "give a signal limits", "Alarms", _ALARMS, 4),
    _acts("alarm_remove", "x", "Delete", "take the limits of the signal away", "Alarms", _ALARMS, 5),
    # ---------------------------------------------------------------------------------------------- parameters
    Command("parameters", "P", "Parameters", "what the program offers to be tuned: turn it, undo it, keep presets",
            "Go", _BOTH + _DETAIL + _CONDITIONS + _RECORDINGS + _EVENTS, asks=True,
            typed=Typed(("parameters", "param"))),
    _acts("turn_down", "h,left,less_than_sign", "Turn", "the parameter a step down; the word before", "Parameters",
            _PARAMETERS, 1, shown_key="←→", does="turn", given=-1),
    _acts("turn_up", "l,right,greater_than_sign", "Turn up", "the parameter a step up; the word after", "Parameters",
            _PARAMETERS, does="turn", given=1),
    _acts("turn_plotted_down", "less_than_sign", "Turn", "turn the parameter in the plot a step down", "Parameters",
            _MONITOR, shown_key="< >", does="turn_plotted", given=-1),
    _acts("turn_plotted_up", "greater_than_sign", "Turn up", "turn the parameter in the plot a step up", "Parameters",
            _MONITOR, does="turn_plotted", given=1),
    _acts("turn_far_down", "shift+left", "Far", "ten steps down", "Parameters", _PARAMETERS, 2, shown_key="⇧←→",
            does="turn", given=-FAR),
    _acts("turn_far_up", "shift+right", "Far up", "ten steps up", "Parameters", _PARAMETERS, does="turn", given=FAR),
    _acts("type_parameter", "e,enter", "Edit", "type its value", "Parameters", _PARAMETERS, 3),
    _acts("default_parameter", "x", "Default",
            "back to the default, or those of all that are marked, after a question", "Parameters", _PARAMETERS, 4),
    _acts("excite", "U", "Excite", "move it around its value for a while, to measure; any key ends it", "Parameters",
            _PARAMETERS, 12,
            typed=_read(("excite",), "", ":excite kp step amplitude 2 for 3s", "excite a parameter", 9)),
    Command("bode", "", "Bode", "how one signal answers to another: Bode plot, step response", "Look", (),
            typed=_read(("bode",), "names", ":bode IN OUT", "how one signal answers to another; FROM TO: seconds", 11)),
    Command("response_mode", "tab,v", "View", "the Bode plot, or the answer to a step", "Response", _RESPONSE, 1),
    Command("response_again", "r", "Refresh", "read what came since, and draw it", "Response", _RESPONSE, 2),
    Command("save_preset", "w", "Save", "all values to a preset on this machine", "Parameters", _PARAMETERS, 5),
    _acts("load_preset", "L", "Load", "a preset, after a question that shows what it changes", "Parameters",
            _PARAMETERS, 6),
    Command("compare_preset", "c", "Compare", "with a preset, or no longer", "Parameters", _PARAMETERS, 9),
    # ------------------------------------------------------------------------------------------------ settings
    Command("settings", "f2", "Settings", "colours, keys, columns, mouse and the like", "Go", ("any",),
            typed=Typed(("settings",))),
    Command("change_setting", "e,enter", "Change", "the next word, a number to type, a key to press", "Settings",
            _SETTINGS, 1),
    Command("earlier_word", "h,left", "Choose", "the word before", "Settings", _SETTINGS, 2, shown_key="←→",
            does="choose_word", given=-1),
    Command("later_word", "l,right", "Word after", "the word after", "Settings", _SETTINGS, does="choose_word",
            given=1),
    Command("default_setting", "x", "Default", "as it is without a file", "Settings", _SETTINGS, 4),
    Command("write_settings", "w", "Write file", "keep the settings for next time", "Settings", _SETTINGS, 3),
    # ------------------------------------------------------------------------------------------------------ app
    Command("command", "colon", "Command", "type a command, Tab completes it", "Go",
            _TABLE + _MONITOR + _DETAIL + _ASIDE + _LOGGERS + _SETTINGS + _RUNS + _COMPARED + _RESPONSE + _MESSAGES
            + FILE_SCOPES, 11),
    Command("menus", "backslash", "Menus", "the five menus: go, edit, view, record, plots", "Go", ("any",)),
    Command("menu_go", "", "Go", "the menu of screens, names, files", "Menus", ("any",), 2, does="menus",
            given="menu_go"),
    Command("menu_edit", "", "Edit", "the menu of changes to what the cursor is on", "Menus", ("any",), 2,
            does="menus", given="menu_edit"),
    Command("menu_view", "", "View", "the menu of what is shown, and how", "Menus", ("any",), 2, does="menus",
            given="menu_view"),
    Command("menu_record", "", "Rec", "the menu of recordings, triggers, markers", "Menus", ("any",), 2, does="menus",
            given="menu_record"),
    Command("menu_plots", "", "Plots", "the menu of plots: find, cursors, axes, what joins what", "Menus", ("any",), 2,
            does="menus", given="menu_plots"),
    Command("again", "", "Again", "what was done last by menus e, v, p once more, with its value", "Go", ("any",)),
    Command("again_back", "", "Other way", "what was done last by the menu p the other way round", "Go", ("any",),
            does="again", given="back"),
    Command("help", "question_mark,f1", "Help", "this page", "Go", ("any",), 10, shown_key="?", typed=Typed(("help",))),
    Command("palette", "ctrl+p", "Palette", "search everything that can be done", "Go", ("any",), hidden=True),
    Command("back", "escape", "Back", "out of whatever is open; clears range, filter, marks", "Go", ("any",),
            hidden=True),
    Command("quit", "q,ctrl+c", "Quit", "end silo-tui; loggers go on, a demo ends with it", "Go", ("any",), 12,
            typed=Typed(("quit", "q"))),
    Command("suspend", "ctrl+z", "Suspend", "back to the shell for a while; fg comes back", "Go", ("any",)),
    Command("quit_now", "ctrl+q", "Quit", "end silo-tui at once, without a question", "Go", ("any",),
            hidden=True, typed=Typed(("q!",))),
    # ----------------------------------------------------------------------------------------------- only typed
    _edits("set", "", "Edit", "edit what is marked", "Edit", (),
            typed=_read(("set",), "settings", ":set NAME div=5 size=10s", "edit what is named, or marked:", 3)),
    Command("control", "", "Control", "who is connected; take, release or give away control", "Logger",
            _BOTH + _DETAIL + _ASIDE, asks=True,
            typed=_read(("control",), "control", ":control take|release|give NAME",
                        "one operator at a time; without words, who is connected", 9)),
    _acts("derive", "", "Derive", "make or change a signal that is computed from others", "Look", _TABLE,
            typed=_read(("derive",), "derived", ":derive NAME EXPRESSION", "a signal computed from others", 10)),
    _acts("restore", "", "Restore", "set again triggers, limits, derived signals and edits that went with the program",
            "Edit", _TABLE, typed=Typed(("restore",))),
    Command("go_home", "", "Home: table", "back to the table", "Go", ("any",), typed=Typed(("home",))),
    Command("tour", "", "Tour", "six steps to try on the logger that is open; again: ends it", "Go", ("any",),
            typed=Typed(("tour",))),
    Command("browser", "", "In a browser", PAGE, "Go", ("any",),
            typed=Typed(("browser", "serve", "web"), usage=":browser", help=PAGE, place=11)),
    Command("messages", "", "Messages", "all that was said here: answers to keys, news of the robot", "Go", ("any",),
            typed=Typed(("messages",))),
    Command("goto", "", "Go to a name", "put the cursor on an element", "Move", (),
            typed=_read(("goto",), "names", ":goto NAME", "put the cursor there", 5)),
    Command("unmark", "", "Unmark", "unmark everything", "Find and mark", (), typed=Typed(("unmark",))),
    Command("theme", "", "Theme", "choose other colours", "Go", ("any",), typed=_read(("theme",), "themes")),
    Command("view", "", "Hottest, stuck, …", "problems, the hottest, the noisiest, what is stuck or near a limit; a "
            "view that was kept, or keep this one", "Look", _TABLE,
            typed=_read(("view",), "views", ":view [save] NAME",
                        "put a view on the screen, or keep it; robot:NAME is on the robot", 8)),
    Command("open", "", "Open a file", "look into a saved log of this machine; Esc comes back", "Go", (),
            typed=_read(("open",), "logs", ":open FILE", "look into a saved log of this machine", 9)),
    Command("picture", "", "Picture", "a screenshot: the screen as a picture", "Go", (),
            typed=_read(("picture",), "", ":picture FILE.svg", "a screenshot, to a file; else silo-tui.svg", 7)),
)
# fmt: on

# what a list is for, where its key stands in a menu: the bar names the way
IN_BAR_BY_MENU = ("acknowledge", "alarm_new", "trigger_toggle", "trigger_new", "record")
NOT_EDITED = "a saved file: nothing to edit"
# what people call screens, where that isn't their scope
PLACES = {
    "monitor": "plots", "scope": "scope", "detail": "large plot", "file_monitor": "plots of a file",
    "file_detail": "large plot of a file", "file": "table of a file", "file_events": "events of a file",
    "loggers": "loggers", "response": "Bode plot", "comparison": "comparison of runs",
}  # fmt: skip
TYPED_ON_FILES = ("goto", "unmark", "theme", "picture", "bode", "open", "runs")
# what commands of lists were called while each list had its own, for keys that users gave them; till 0.5
_ONCE = {
    "list_filter": "filter_events filter_loggers filter_recordings filter_conditions find_setting",
    "list_down": "next_line next_logger next_recording condition_down next_setting",
    "list_up": "previous_line previous_logger previous_recording condition_up previous_setting",
    "list_page_down": "lines_down loggers_down recordings_down conditions_down settings_down",
    "list_page_up": "lines_up loggers_up recordings_up conditions_up settings_up",
    "list_order": "order_events order_loggers order_recordings order_conditions",
    "list_read": "read_events read_recordings read_conditions",
    "list_bottom": "oldest_line last_logger last_recording condition_bottom last_setting",
    "list_top": "follow_events first_logger first_recording condition_top first_setting",
    "list_mark": "mark_logger mark_recording mark_condition",
    "list_mark_all": "mark_loggers mark_recordings mark_conditions",
    "list_range": "range_of_loggers range_of_recordings range_of_conditions",
}
RENAMED = {old: new for new, names in _ONCE.items() for old in names.split()}
BY_ID = {command.id: command for command in COMMANDS}
BY_WORD = {word: command for command in COMMANDS if command.typed is not None for word in command.typed.words}
_own: dict[str, str] = {}  # the user's keys, by command
_narrower: dict[str, tuple[str, ...]] = {}  # where they count, if that is on fewer screens in the user's keymap


def use_keys(keys: Mapping[str, str], narrower: Mapping[str, tuple[str, ...]] = MappingProxyType({})) -> None:
    """Let all that is shown and said name the user's keys."""
    _own.clear()
    _own.update(keys)
    _narrower.clear()
    _narrower.update(narrower)
    commands_for.cache_clear()


def with_keys(command: Command) -> Command:
    """Return a command with the keys of the user's keymap, and the user's own, if it has some."""
    keys, scopes = _own.get(command.id, command.keys), _narrower.get(command.id, command.scopes)
    return command if (keys, scopes) == (command.keys, command.scopes) else _with(command.id, keys, scopes)


@cache
def _with(command_id: str, keys: str, scopes: tuple[str, ...]) -> Command:
    command = BY_ID[command_id]
    shown = command.shown_key if set(command.keys.split(",")) <= set(keys.split(",")) else ""
    return msgspec.structs.replace(command, keys=keys, shown_key=shown, scopes=scopes)


@cache  # each key asks for it, and each painting of the key bar
def commands_for(scope: str) -> tuple[Command, ...]:
    """Return what can be done with keys on a screen; what is only typed counts where its word can be typed."""
    return tuple(
        each
        for each in map(with_keys, COMMANDS)
        if each.keys and ({scope, "any"} & set(each.scopes) or (not each.scopes and typed_on(scope, each)))
    )


def typed_on(scope: str, command: Command) -> bool:
    """Return whether the word of a command can be typed on a screen."""
    lines = BY_ID["command"].scopes
    return command.typed is not None and scope in lines and (scope not in FILE_SCOPES or typed_on_file(command))


def key_of(command: str, *, last: bool = False) -> str:
    """Return the key of a command as the user has it, the first or the last of several, to be named in a sentence."""
    own = with_keys(BY_ID[command])
    return key_text(own.keys.rpartition(",")[2]) if last else own.footer_key


def unmark_words() -> str:
    """Return how marks are taken away, for a line that tells how many there are."""
    return f"{key_of('unmark') or ':unmark'} unmarks"


def key_that_retries(scope: str) -> str:
    """Return the key that looks for a lost link on a screen; empty where none does."""
    return next((key_of(each.id) for each in commands_for(scope) if each.retries), "")


def commands_like(scope: str) -> list[Command]:
    """Return what can be done where a screen belongs to: on loggers, or on a file."""
    on_file = scope in FILE_SCOPES
    return [
        command
        for command in map(with_keys, COMMANDS)
        if any(each == "any" or (each in FILE_SCOPES) == on_file for each in command.scopes)
    ]


def typed_on_file(command: Command) -> bool:
    """Return whether a command may be typed over a saved file: what changes or asks a logger has no place there."""
    return command.id in TYPED_ON_FILES or any(scope == "any" or scope in FILE_SCOPES for scope in command.scopes)


def places_of(commands: Sequence[Command]) -> str:
    """Return the screens where the keys of commands count, some of many; those of files where they count there alone.

    Empty for none, and for all.
    """
    scopes = dict.fromkeys(each for command in commands for each in command.scopes if each != "any")
    near = [each for each in scopes if each not in FILE_SCOPES] or list(scopes)
    places = [PLACES.get(each, each) for each in near]
    return f"{', '.join(places[:3])}{' and others' * (len(places) > 3)}"


def footer_for(scope: str, *, read_only: bool = False) -> list[Command]:
    """Return what the key bar shows, most wanted first."""
    shown = [
        command for command in commands_for(scope)
        if command.footer and not (read_only and command.writes)
        and (" " not in command.keys.split(",", 1)[0] or command.id in IN_BAR_BY_MENU)
    ]  # fmt: skip
    return sorted(shown, key=lambda command: command.footer)
