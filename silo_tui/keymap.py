"""The two layers of keys, and how what is pressed becomes a command: the first layer, or a menu and a letter in it.

One table says where the keys of a command are others than those of `actions` (classic). A test holds it: no key twice
on a screen, no menu that is a command too, `D` in no menu, and what it deletes by no other key.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from types import MappingProxyType

from silo_tui import actions
from silo_tui.actions import (
    BY_ID,
    COMMANDS,
    FILE_SCOPES,
    IN_BAR_BY_MENU,
    NOT_EDITED,
    PLACES,
    Command,
    commands_for,
    commands_like,
    footer_for,
    key_of,
    key_text,
    places_of,
    typed_on,
    with_keys,
)

OPENERS = {"g": "menu_go", "e": "menu_edit", "v": "menu_view", "r": "menu_record", "p": "menu_plots"}
MENUS = frozenset(OPENERS.values()) | {"menus"}
DESTROYS = "D"  # always asks, is answered by `y`
TURNED = {"next_sample": "previous_sample", "next_event": "previous_event", "closer": "wider", "later": "earlier"}
TURNED |= {back: on for on, back in TURNED.items()}

_TABLE = (
    # ------------------------------------------------------------------------------ first layer: moving
    ("j,down", "level_down"),
    ("k,up", "level_up"),
    ("shift+left,H", "cursor_far_left turn_far_down"),
    ("shift+right,L", "cursor_far_right turn_far_up"),
    ("pagedown,ctrl+d", "half_down list_page_down"),
    ("pageup,ctrl+u", "half_up list_page_up"),
    ("home,g g", "top list_top"),
    ("home", "oldest"),
    ("g g", "plot_top detail_top"),
    ("end", "newest"),
    # -------------------------------------------------------------------------------- finding, marking
    ("slash,p f", "find"),
    ("m,p m", "add_plot"),
    ("n", "next_found"),
    ("N", "previous_found"),
    ("o,v o", "sort list_order"),
    # ------------------------------------------------------------------------------------ into, beside
    ("enter,r c", "trigger_capture"),
    ("r c", "last_capture"),
    ("enter", "into"),
    ("m", "plot"),
    ("plus,minus,v f", "fold"),
    ("tab,p a", "arrange_plots"),
    ("tab,p v", "mode response_mode"),
    # ------------------------------------------------------------------------------- what changes something
    ("ctrl+r,U", "redo"),
    ("w,p w", "export_plots"),
    (DESTROYS, "delete_recording forget_derived trigger_remove alarm_remove"),
    ("ctrl+l,v r", "refresh detail_refresh response_again try_link list_read look_again"),
    # -------------------------------------------------------------------------------------------- the program
    ("full_stop", "again"),
    ("comma", "again_back"),
    *((letter, opener) for letter, opener in OPENERS.items()),
    # -------------------------------------------------------------------------------------------------- go to
    ("g h", "go_home"),
    ("g m", "messages"),
    ("g l", "loggers"),
    ("g r", "recordings"),
    ("f3,g f", "runs"),
    ("g e", "events"),
    ("g t", "triggers"),
    ("g a", "alarms"),
    ("g s,f2", "settings"),
    ("g p", "parameters"),
    ("g n", "goto"),
    ("g o", "open"),
    ("g d", "demo"),
    ("g b", "browser"),
    # --------------------------------------------------------------------------------------------------- edit
    ("e e", "edit scope_settings trigger_edit"),
    ("e e,e a", "alarm_limits"),
    ("e a", "limits_of_row"),
    ("enter,e e", "change_setting type_parameter"),
    ("e d", "edit_divider"),
    ("e s", "edit_size"),
    ("e b", "next_buffer"),
    ("e p", "next_action"),
    ("e t", "toggle"),
    ("e equals_sign", "edit_all"),
    ("e x", "discard default_setting default_parameter"),
    ("e c", "control"),
    ("e l", "load_script load_into_loggers load_preset"),
    ("e w", "save_script"),
    ("w,e w", "save_preset"),
    # --------------------------------------------------------------------------------------------------- view
    ("v c", "columns runs_column"),
    ("v i", "inspector"),
    ("v f", "all_entries"),
    ("v e", "component next_entry"),
    ("v z", "zero"),
    ("v u", "unmark"),
    ("v t", "theme"),
    ("v v", "view"),
    ("v p", "picture"),
    ("v b", "compare_preset compare_runs"),
    # -------------------------------------------------------------------------------------------------- plots
    ("p n", "next_sample"),
    ("p N", "previous_sample"),
    ("p e", "next_event"),
    ("p E", "previous_event"),
    ("p b", "cursor_b"),
    ("p 0", "all_held"),
    ("p c", "catch scope_mode"),
    ("p j", "join_plots"),
    ("p i", "isolate_plot"),
    ("p r", "drop_plot"),
    ("p y", "scale"),
    ("p l", "log_axis level"),
    ("p z", "detail_swap"),
    ("plus,equals_sign,p plus", "closer"),
    ("minus,p minus", "wider"),
    ("pageup,ctrl+u,p pageup", "earlier"),
    ("pagedown,ctrl+d,p pagedown", "later"),
    ("p t", "mode_time"),
    ("p s", "mode_spectrum"),
    ("p x", "mode_xy"),
    ("p h", "mode_histogram"),
    # ------------------------------------------------------------------------------------------------- record
    ("r n", "new_of_row plot_trigger trigger_new alarm_new"),
    ("r r", "record"),
    ("r s", "stop_recording"),
    ("r t", "trigger_toggle arm_trigger"),
    ("r f", "trigger_force scope_force"),
    ("r k", "acknowledge"),
    ("r m", "set_marker"),
    ("f5,r g", "episode_good"),
    ("f6,r b", "episode_bad"),
    ("f7,r a", "episode_redo"),
    ("f8,r e", "episode"),
    ("r d", "derive"),
    ("r x", "excite"),
    ("r o", "overlay_recording overlay_runs"),
)
TWO_LAYERS = {command: keys for keys, commands in _TABLE for command in commands.split()}
TWO_LAYERS |= {each.id: each.keys for each in COMMANDS if each.keys and each.id not in TWO_LAYERS}
# the key bar, one order on every screen; and who gives way first where it has no room for all
_BAR = (  # r; what stands in a menu
    "space enter r; m plus minus h,left pageup pagedown end slash p e g v r o a u S w D full_stop escape"
)
_GIVES_WAY = (
    "full_stop add_plot o minus plus end pagedown pageup w D v detail r monitor mark S space save_data u m h,left "
    "write_settings pause slash trigger_remove alarm_remove e p escape turn_down g r; enter closer a"
)
BASES: dict[str, Mapping[str, str]] = {"two-layer": TWO_LAYERS, "classic": {}}
# where the letters mean other things on lists, or are free for keys of the user's own
NARROWER: dict[str, Mapping[str, tuple[str, ...]]] = {
    "two-layer": {},
    "classic": {"apply": ("table",), "start_stop": ("table", "monitor"), "restart": ("table", "monitor")},
}
DEFAULT = "two-layer"


def keys_in(keymap: str, command: str, own: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the keys of a command: those that the user gave it, and its place in a menu, which it never loses."""
    given = BASES[keymap].get(command, BY_ID[command].keys)
    if command not in own or " " in own[command]:
        return own.get(command, given)
    return ",".join([own[command], *(key for key in given.split(",") if " " in key)])


def with_alike(keymap: str, own: Mapping[str, str]) -> Mapping[str, str]:
    """Return keys of the user with those of commands that are the same on other screens, where a key is free."""
    found = dict(own)
    for command, key in own.items():
        label, first = BY_ID[command].label, keys_in(keymap, command).split(",")[0]
        for each in COMMANDS if TWO_LAYERS.get(command) != DESTROYS else ():  # it deletes many a thing
            if each.label == label and each.id not in found and keys_in(keymap, each.id).split(",")[0] == first:
                taken = clashes(keymap, {**found, each.id: key})
                found |= {} if any(each.id in clash[:2] for clash in taken) else {each.id: key}
    return found


def use_keys(keymap: str, own: Mapping[str, str]) -> None:
    """Let all keys be these, and all that is shown and said name them."""
    own = with_alike(keymap, own)
    keys = {command: keys_in(keymap, command, own) for command in {**BASES[keymap], **own}}
    actions.use_keys(keys, NARROWER[keymap])
    in_bar.cache_clear()


def command_of(key: str, scope: str) -> Command | None:
    """Return what a key of the first layer does on a screen."""
    return next((each for each in commands_for(scope) if key in each.keys.split(",")), None)


def in_menu(opener: str, scope: str) -> dict[str, list[Command]]:
    """Return what a menu holds, by letter, in the order of the table; what counts on this screen comes first."""
    if opener == "menus":
        return {key: [BY_ID[each]] for key, each in OPENERS.items()}
    letter = next(key for key, each in OPENERS.items() if each == opener)
    found: dict[str, list[Command]] = {}
    for command, place in TWO_LAYERS.items():
        keys = with_keys(BY_ID[command]).keys
        for path in (keys if " " in keys else place).split(","):
            if path.startswith(f"{letter} "):
                found.setdefault(path.removeprefix(f"{letter} "), []).append(BY_ID[command])
    for commands in found.values():
        commands.sort(key=lambda each: (scope not in each.scopes, not counts(each, scope)))
    return found


def counts(command: Command, scope: str) -> bool:
    """Return whether an entry of a menu has a use on a screen: by its key, or by its word."""
    return scope in command.scopes or "any" in command.scopes or typed_on(scope, command)


@lru_cache(maxsize=64)
def _menus_of(scope: str) -> frozenset[str]:
    """Return the menus that hold something of a screen itself, and not of its logger alone."""
    own = {each for each in TWO_LAYERS if scope in BY_ID[each].scopes and BY_ID[each].group != "Logger"}
    letters = {path.split()[0] for each in own for path in TWO_LAYERS[each].split(",") if " " in path}
    return frozenset(OPENERS[each] for each in letters) | {"menu_go"}


@lru_cache(maxsize=64)  # each key asks for it
def in_bar(scope: str, *, read_only: bool) -> list[tuple[Command, int]]:
    """Return what the key bar shows from left to right, and its rank: the lowest gives way first."""
    if not with_keys(BY_ID["menu_go"]).keys:  # classic
        shown = footer_for(scope, read_only=read_only)
        return [(command, len(shown) - place) for place, command in enumerate(shown)]
    bar, gives_way = _BAR.split(), _GIVES_WAY.split()
    found: list[tuple[int, int, Command]] = []
    for command in (*footer_for(scope, read_only=read_only), *(with_keys(BY_ID[each]) for each in ("again", "back"))):
        # by the key that it has here, as one that a user gave it stands where it always stood
        keys = ["r;"] if command.id in IN_BAR_BY_MENU else TWO_LAYERS.get(command.id, "").split(",")
        place = next((at for at, key in enumerate(bar) if key.split(",")[0] in keys[:2]), len(bar))
        if command.id in OPENERS.values() and command.id not in _menus_of(scope):
            continue
        aside = command.id == "start_stop" and scope not in ("table", "monitor", "detail", "scope")  # one of many
        name = "" if aside else command.id if command.id in gives_way else bar[place] if place < len(bar) else ""
        found.append((place, gives_way.index(name) + 2 if name else 1, command))
    return [(command, rank) for _, rank, command in sorted(found, key=lambda each: each[0])]


def where(commands: Sequence[Command], scope: str) -> tuple[str, str]:
    """Return where what shares a letter of a menu has a use, for a screen where it has none: in a word, in a sentence.

    The sentence has the keys that lead there.
    """
    scopes = dict.fromkeys(each for command in commands for each in command.scopes)
    on_file = scope in FILE_SCOPES
    if on_file and not scopes.keys() & set(FILE_SCOPES):
        return "live only", "a saved file has no logger; Esc leaves the file"
    places = [each for each in scopes if each != "any" and (each in FILE_SCOPES) == on_file]
    told = [PLACES.get(each, each) + (f" ({way})" if (way := _way_to(each, scope)) else "") for each in places]
    more = " and others" if len(told) > 3 else ""
    short = PLACES.get(places[0], places[0]) if places else ""
    return short, f"it is a key of {', '.join(told[:3])}{more}"


def _way_to(place: str, scope: str) -> str:
    """Return the keys that lead from one screen to another, empty where none does."""
    if place == "detail":
        return f"{'' if scope == 'monitor' else _way_to('monitor', scope) + ', then '}{key_of('detail')}"
    if place == "monitor" and scope != "table":
        return f"{key_of('go_home')}, then {key_of('monitor')}"
    way = "go_home" if place == "table" else place
    return key_of(way) if way in BY_ID and {scope, "any"} & set(BY_ID[way].scopes) else ""


def edits_by(key: str, scope: str) -> bool:
    """Return whether a key edits, or commands the logger, on the screen of a logger that is like that of a file, or,
    where it has no use there, on any.
    """
    like = scope.replace("file_", "").replace("file", "table")
    there = [command for command in commands_for(like) if key in command.keys.split(",")]
    there = there or [command for command in map(with_keys, COMMANDS) if key in command.keys.split(",")]
    return scope in FILE_SCOPES and any(command.writes or command.group == "Edit" for command in there)


def why_no_use(key: str, scope: str) -> str:
    """Return why a key does nothing on a screen, and where it does something, with the keys that lead there."""
    there = [command for command in commands_like(scope) if key in command.keys.split(",")]
    if edits_by(key, scope):
        return f"{NOT_EDITED}; {key_text(key)} ({there[0].label}): {where(there, scope)[1]}" if there else NOT_EDITED
    if not there:
        were = [each for each in COMMANDS if key in each.keys.split(",")]
        own = [each for each in commands_for(scope) if scope in each.scopes and each.group not in ("Logger", "Events")]
        mine = [each for each in own if f" {key}," in f"{each.keys},"]
        if mine:  # a letter in a menu of this screen, of two that which was its key before
            one = min(mine, key=lambda each: BY_ID[each.id] not in were)
            path = next(path for path in one.keys.split(",") if path.endswith(f" {key}"))
            return f"{key_text(key)} is no key here; {one.label} is {key_text(path)}"
        if were:
            here = [each for each in were if {scope, "any"} & set(each.scopes)]
            at = "" if here else f", a key of {places_of(were[:1])}"
            return f"{key_text(key)} is no key here; {(here or were)[0].label} is {key_of((here or were)[0].id)}{at}"
        return f"{key_text(key)} is no key of silo-tui; {key_of('help')} shows those that are"
    return f"{key_text(key)} ({there[0].label}) has no use here: {where(there, scope)[1]}"


def clashes(keymap: str, keys: Mapping[str, str]) -> Iterator[tuple[str, str, str, str]]:
    """Yield a command that `keys` gives a key, the one that has it on the same screen, the key, and that screen's name.

    The letter of a menu is taken by its commands: who wants it for another one gives these others first.
    """
    keys_of = {command.id: keys_in(keymap, command.id, keys).split(",") for command in COMMANDS}
    for scope, commands in _on_screens(keymap):
        taken: dict[str, str] = {}
        for command in commands:
            for key in filter(None, keys_of[command.id]):
                other = taken.setdefault(key, command.id)
                if other != command.id:
                    mine, theirs = (command.id, other) if command.id in keys else (other, command.id)
                    yield mine, theirs, key, PLACES.get(scope, scope)


@cache
def _on_screens(keymap: str) -> list[tuple[str, list[Command]]]:
    """Return each screen with the commands that count or can be typed there, whatever their keys are."""
    scopes = dict.fromkeys(scope for command in COMMANDS for scope in command.scopes if scope != "any")
    return [(scope, [each for each in COMMANDS if _is_on(scope, each, NARROWER[keymap])]) for scope in scopes]


def _is_on(scope: str, command: Command, narrower: Mapping[str, tuple[str, ...]]) -> bool:
    scopes = narrower.get(command.id, command.scopes)
    return bool({scope, "any"} & set(scopes)) or (not scopes and typed_on(scope, command))


use_keys(DEFAULT, {})  # also for what is said before there is an app
