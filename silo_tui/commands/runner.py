# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The `:` line, and the commands that need no screen."""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from silo.core.names import did_you_mean
from silo.core.quantities.writing import many
from silo.errors import RefusedError, SiloError
from silo.files.formats import SAVED_NAMES, is_bag_folder
from silo.settings.typed import completions
from silo_tui.actions import (
    BY_ID,
    BY_WORD,
    COMMANDS,
    FILE_SCOPES,
    NOT_EDITED,
    Command,
    key_of,
    typed_on_file,
    with_keys,
)
from silo_tui.commands import flows, view_flows
from silo_tui.context import Context, SiloScreen
from silo_tui.layouts import files, views
from silo_tui.layouts.presets import BY_NAME, PRESETS
from silo_tui.modal import ask
from silo_tui.model.words import command_line
from silo_tui.model.words.command_line import BY_KEY, Spelled
from silo_tui.model.words.paths import typed_file, typed_path
from silo_tui.model.words.people import operators
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.settings.themes import THEMES
from silo_tui.theme import theme_name

PICTURES = (".png", ".jpg", ".jpeg", ".gif", ".pdf")


class CommandRunner:
    """Carries out and completes command lines; has the commands that need no screen."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def complete(self, line: str) -> list[str]:
        """Return whole lines that `line` may become."""
        command = BY_WORD.get(line.lstrip(":").partition(" ")[0])
        choices = self.choices(command, *line.split(" ")[1:]) if command is not None else ()
        words = [word for word, one in BY_WORD.items() if not self._on_file or typed_on_file(one)]
        return command_line.complete(line, sorted(words), [each for each in choices if each not in line.split()])

    def usage(self, line: str) -> str:
        """Return what a command line does, once its word is typed."""
        word = line.lstrip(":").partition(" ")[0]
        command = BY_WORD.get(word)
        if command is None or command.typed is None:
            begun = any(known.startswith(word) for known in BY_WORD)  # Tab goes on with it
            return "" if begun else self._no_command(word)
        typed, given = command.typed, line.partition(" ")[2].strip()
        if command.id == "open" and _is_folder(os.path.expanduser(given or ".")):  # noqa: PTH111 - never fails
            takes = ", Tab takes the one in grey" if self.complete(line) else ""
            return f"{typed.usage}: Enter lists the logs in {given or 'this folder'}{takes}"
        return f"{typed.usage}: {typed.help}" if typed.usage else f"{command.label}: {command.help}"

    def choices(self, command: Command, *typed: str) -> Sequence[str]:
        """Return what the argument of a command may be, of which the last word of `typed` is typed."""
        context, begun = self._context, typed[-1] if typed else ""
        sources: dict[str, Callable[[], Sequence[str]]] = {
            "scripts": lambda: context.script_names,
            "settings": lambda: completions(begun),
            "sorts": lambda: list(context.session.rows.orders),
            "names": lambda: [
                *command_line.neighbours_first(
                    [*map(context.session.short_name, context.session.table.names)], self._here
                ),
                *context.session.table.names,
            ],
            "derived": lambda: [
                context.session.short_name(name) for name in context.session.table.names[context.session.table.own :]
            ],
            "types": lambda: SAVED_NAMES,
            "views": lambda: [
                *(("save", *([view_flows.LAST] if context.left_view else []), *BY_NAME) if not typed[1:] else ()),
                *files.names(),  # the others aren't what one keeps a view as
            ],
            "logs": lambda: command_line.logs(begun, context.session.status.folder if context.has_session else ""),
            "control": lambda: self._control_words(typed[:-1]),
            "themes": lambda: (*THEMES, *sorted(context.app.available_themes)),
        }
        needs = () if context.has_session else ("sorts", "names", "derived")
        source = (
            sources.get(command.typed.completes) if command.typed and command.typed.completes not in needs else None
        )
        return source() if source is not None else ()

    @property
    def _here(self) -> str:
        """What the cursor of the uppermost screen is on."""
        return screen.subject if (screen := self._context.upper_screen) is not None else ""

    def _control_words(self, before: Sequence[str]) -> Sequence[str]:
        if not before:
            return ("take", "force", "release", "give")
        return operators(self._context.session.status) if before == ("give",) and self._context.has_session else ()

    def run(self, line: str) -> None:
        """Carry out a command line; show what is wrong with it."""
        try:
            self._run(command_line.read(line))
        except (ValueError, SiloError) as error:
            self._context.fail(str(error))

    def _run(self, spelled: Spelled) -> None:
        command = BY_WORD.get(spelled.word)
        if command is None:
            raise ValueError(self._no_command(spelled.word))
        if self._on_file and not typed_on_file(command):
            raise RefusedError(f":{spelled.word}: {NOT_EDITED}, no logger to command")
        self._screen_for(command).action_command(command.id, spelled)

    def _no_command(self, word: str) -> str:
        """Return that there is none of that word, and what may be meant: another word, or what has a key."""
        near = [known for known in sorted(BY_WORD) if known.startswith(word[:2])]
        keyed = [with_keys(each) for each in COMMANDS if each.label.casefold().startswith(word.casefold())]
        keys = [f"{each.label} is {each.footer_key}" for each in keyed if each.keys]
        known = f"; {keys[0]}" if keys else did_you_mean(near, "`:help` shows what there is")
        return f"there is no command {word!r}{known}"

    @property
    def _on_file(self) -> bool:
        """Whether the uppermost screen is of a file."""
        return (screen := self._context.upper_screen) is not None and screen.scope in FILE_SCOPES

    def _screen_for(self, command: Command) -> SiloScreen:
        """Return the uppermost screen that carries it out, else the table, or any for what needs none."""
        stack = [each for each in self._context.app.screen_stack[::-1] if isinstance(each, SiloScreen)]
        stack = [each for each in stack if (each.scope in FILE_SCOPES) == self._on_file]
        if command.scopes and "any" not in command.scopes and not self._on_file:
            tables = [each for each in stack if each.scope == "table"]
        else:
            tables = stack[:1]
        found = [each for each in stack if hasattr(each, command.method)] or tables
        if not found and hasattr(self._context.app, command.method):  # no logger is open, nor needed
            found = stack[:1]
        if not found:
            raise RefusedError("no logger is open")
        return found[0]

    def command_start_stop(self, typed: Spelled) -> None:
        running = self._context.session.running
        if typed is not BY_KEY and running == (typed.word == "start"):
            self._context.say(f"it is {'running' if running else 'stopped'} already")
        else:
            self._context.run_flow(flows.start_stop(self._context))

    def command_restart(self) -> None:
        self._context.run_flow(flows.restart(self._context))

    def command_apply(self) -> None:
        self._context.run_flow(flows.apply(self._context))

    def command_restore(self) -> None:
        self._context.run_flow(flows.restore(self._context))

    def command_load_script(self, typed: Spelled) -> None:
        self._context.run_flow(flows.load_script(self._context, typed.first))

    def command_save_script(self, typed: Spelled) -> None:
        """Store the table; by its word without a name, as the logger's own script."""
        self._context.run_flow(flows.save_script(self._context, None if typed is BY_KEY else typed.first))

    def command_save_data(self, typed: Spelled) -> None:
        from silo_tui.screens.files.save_data import SaveDialog

        session = self._context.session
        if not session.running and not session.status.run_ticks:
            self._context.say(f"nothing was logged yet, so there is nothing to save; {key_of('start_stop')} starts")
            return
        types, name = command_line.read_save(typed.arguments)
        self._context.app.push_screen(SaveDialog(self._context, types, name, at_once=bool(typed.arguments)))

    def command_browser(self) -> None:
        self._context.say(BY_ID["browser"].help)

    def command_try_link(self) -> None:
        self._context.try_link()

    def command_record(self, typed: Spelled) -> None:
        from silo_tui.screens.dialogs import recorder

        self._context.run_flow(recorder.begin(self._context, self._context.session, signals=typed.rest))

    def command_stop_recording(self) -> None:
        from silo_tui.screens.dialogs import recorder

        self._context.run_flow(recorder.end(self._context, self._context.session))

    def command_open(self, typed: Spelled) -> None:
        if not self._context.has_session:
            raise RefusedError("no logger is open: leave silo-tui, and open the file by `silo-tui FILE`")
        path = typed_path("the log", typed.rest or ".")
        if not typed.arguments or _is_folder(path):
            cast(Any, self._context.app).command_runs(typed)  # one of them is to be chosen
            return
        from silo.analysis.opening import open_log
        from silo_tui.screens.files.opened import show_read

        context, failed = self._context, f"{typed.rest} can't be opened"
        context.open_over(
            context.app, f"opening {typed.rest}", show_read, context,
            lambda: open_log(path), failed,
        )  # fmt: skip

    def command_theme(self, typed: Spelled = BY_KEY) -> None:
        words, known = typed.arguments, self._context.app.available_themes
        if not words:
            now = self._context.app.theme.removeprefix(theme_name(""))
            choices = [Choice(each, f"{each}{', now' * (each == now)}", each[0]) for each in THEMES]
            body = f"Until silo-tui ends; {key_of('settings')}, then {key_of('write_settings')} keeps them."
            question = Question("Which colours?", body, choices, now)
            ask(self._context.app, question, lambda name: self.command_theme(Spelled("theme", (name,))))
            return
        keys = f"{key_of('settings')} {key_of('write_settings')}"
        if len(words) == 1 and words[0] in THEMES:
            app = self._context.app
            cast(Any, app).take_settings(replace(self._context.settings, theme=words[0]))
            app.theme = theme_name(words[0])  # where one of Textual's own was shown the settings know of no change
            self._context.say(f"theme: {words[0]}; {keys} writes it to the file")
            return
        name = " ".join(words)
        if name not in known:
            others = ", ".join(sorted(each for each in known if not each.startswith("silo-")))
            raise ValueError(f"themes: {', '.join(THEMES)}; Textual's: {others}")
        self._context.app.theme = name
        self._context.say(f"theme: {name}, until silo-tui ends; {keys} keeps none but {', '.join(THEMES)}")

    def command_control(self, typed: Spelled = BY_KEY) -> None:
        self._context.run_flow(flows.control_flow(self._context, typed.arguments))

    def command_view(self, typed: Spelled) -> None:
        if typed.arguments[:1] == ("save",) and len(typed.arguments) > 1:
            self._save_view(" ".join(typed.arguments[1:]))
        elif typed.arguments:
            self._context.run_flow(view_flows.open_view(self._context, typed.rest), asks_robot=False)
        elif typed is BY_KEY:
            self._context.run_flow(self._choose_view(), asks_robot=False)
        else:
            self._context.run_flow(view_flows.tell_views(self._context))

    async def _choose_view(self) -> None:
        """Ask what to look at: what one looks for first, or a view that was kept."""
        choices = [Choice(each.name, each.words, each.letter) for each in PRESETS] + view_flows.numbered(files.names())
        if (left := self._context.left_view) is not None:
            choices.append(Choice(view_flows.LAST, f"What was on the screen {left.since}", "a"))
        if self._context.session.link is not None:  # it is asked for them only then: what is here waits for nobody
            choices.append(Choice(view_flows.ROBOT, "Views that the robot keeps", "r"))
        choices.append(Choice(KEEP, "Keep what is on the screen, by a name", "w"))
        name = await self._context.app.push_screen_wait(Question("Look at what?", "", choices))
        if name == view_flows.ROBOT:
            if not (kept := view_flows.numbered(await view_flows.robots_names(self._context))):
                raise RefusedError(
                    f"the robot keeps no views: `:view save {view_flows.ROBOT}NAME` keeps what is on the screen"
                )
            name = await self._context.app.push_screen_wait(Question("Look at what?", "", kept))
        if name == KEEP and (screen := self._context.upper_screen) is not None:
            screen.begin_command("view save")
        elif name:
            await view_flows.open_view(self._context, name)

    def _save_view(self, name: str) -> None:
        layout = views.capture(self._context)
        if layout is None:
            raise RefusedError("no logger is open: there is nothing to keep")
        plots = f" with {many(len(layout.plots), 'plot')}" if layout.plots else ""
        if name.startswith(view_flows.ROBOT):
            self._context.run_flow(view_flows.keep_view(self._context, name.removeprefix(view_flows.ROBOT), layout))
            return
        file = files.place(name)
        again = file.exists()
        files.save(file, layout)
        done = "written over" if again else "kept"
        self._context.say(f"view {name} {done}{plots}: `:view {name}` opens it, or silo-tui --view {name}")

    def command_picture(self, typed: Spelled) -> None:
        given = typed.arguments[0] if typed.arguments else "silo-tui.svg"
        path = typed_file("the picture", given, ".svg")
        if path.suffix != ".svg":  # an SVG in a .png is a picture that nothing opens
            path = path.with_name(f"{path.stem if path.suffix.lower() in PICTURES else path.name}.svg")
        note = "" if path.name == Path(given).name else " (an SVG: browsers open it)"
        self._context.app.call_after_refresh(self._write_picture, path, note)  # without this command on it

    def _write_picture(self, path: Path, note: str) -> None:
        from silo_tui.screens.dialogs.exporting import picture

        with self._context.telling("can't write the picture"):
            path.write_text(picture(self._context.app), "utf-8")
            self._context.say(f"picture of the screen: {path.absolute()}{note}")


KEEP = ":keep"


def _is_folder(path: str | Path) -> bool:
    """Return whether it is a folder of logs, and no log that is a folder."""
    return os.path.isdir(path) and not is_bag_folder(Path(path))  # noqa: PTH112 - never fails
