"""The driver between Textual and the terminal, without either: what is sent when, and what becomes of answers."""

import os
import sys
from types import SimpleNamespace
from typing import Any

import pytest
from textual import events
from textual.driver import Driver
from textual.drivers.linux_driver import LinuxDriver

from silo_tui.terminal import driver as module
from silo_tui.terminal.answers import ALIVE_ANSWER, ALIVE_QUERY
from silo_tui.terminal.driver import ALT_SCREEN, FAREWELL_S, URGENT_S, CellDriver
from silo_tui.terminal.pacing import FIRST_S
from silo_tui.terminal.parser import QUERY, SYNC_BEGIN, SYNC_END
from tests.tui.emulator import Emulator

WIDTH, HEIGHT = 20, 5
ANSWER, NO_MODE = b"\x1b[?2026;2$y", b"\x1b[?2026;0$y"


class Loop:
    """An event loop that does what is due when a test says so."""

    def __init__(self, clock: Any) -> None:
        self.clock, self.timers, self.soon = clock, [], []

    def call_later(self, after_s: float, do: Any) -> Any:
        timer = SimpleNamespace(at_s=self.clock.s + after_s, do=do, is_off=False)
        timer.cancel = lambda: setattr(timer, "is_off", True)
        self.timers.append(timer)
        return timer

    def call_soon_threadsafe(self, do: Any) -> None:
        self.soon.append(do)

    def turn(self) -> None:
        done, self.soon = self.soon, []
        for do in done:
            do()

    @property
    def due(self) -> list[Any]:
        return [timer for timer in self.timers if not timer.is_off]


class Glass(CellDriver):
    """A driver whose terminal is emulated: `take` writes what was handed over, as the output thread does."""

    def __init__(self, clock: Any) -> None:
        self.clock, self.out, self.taken, self.posted = clock, [], [], []
        self.size = (WIDTH, HEIGHT)
        self._loop, self._mouse, self._debug, self._key_thread = Loop(clock), True, False, None
        self.cursor_origin, self.fileno = None, -1
        self.terminal = Emulator(WIDTH, HEIGHT)
        super().__init__(None)  # type: ignore[arg-type]
        self._drawing = True

    def _get_terminal_size(self) -> tuple[int, int]:
        return self.size

    def take(self) -> str:
        """The terminal reads what was sent; the driver is told so."""
        text = "".join(self.out)
        self.out.clear()
        self.terminal.feed(text.replace(QUERY, "").replace(ALIVE_QUERY, ""))
        self._file.flush()
        self._loop.turn()
        return text

    def paint(self, *lines: str) -> str:
        self.write("".join(f"\x1b[{row};1H{words}" for row, words in enumerate(lines, 1)))
        self.flush()
        return self.take()

    def answer(self, *answers: bytes) -> None:
        self._note_answers(answers)
        self._loop.turn()

    def send_message(self, message: Any) -> None:
        self.posted.append(message)


@pytest.fixture
def clock(monkeypatch):
    found = SimpleNamespace(s=100.0)
    found.monotonic = lambda: found.s
    monkeypatch.setattr(module, "time", found)
    return found


@pytest.fixture
def driver(clock, monkeypatch):
    monkeypatch.setattr(LinuxDriver, "__init__", lambda *_, **__: None)
    monkeypatch.setattr(LinuxDriver, "write", lambda self, text: self.out.append(text))
    monkeypatch.setattr(Driver, "process_message", lambda self, message: self.posted.append(message))
    monkeypatch.setattr(module, "_told_of_terminal", lambda: (False, False))
    found = Glass(clock)
    found._file._file = SimpleNamespace(flush=lambda: None, write=found.taken.append, fileno=lambda: 7)
    return found


def shown(driver: Glass) -> list[str]:
    return [line.rstrip() for line in driver.terminal.text.split("\n")]


# --------------------------------------------------------------------------------------------------------- what is sent


def test_of_a_frame_only_what_changed_is_sent(driver):
    assert "abc" in driver.paint("abc", "def")
    assert driver.paint("abc", "dXf") == "\x1b[2;2HX\x1b[2;4H"
    assert shown(driver)[:2] == ["abc", "dXf"]
    assert driver.paint("abc", "dXf") == ""


def test_where_there_is_no_screen_nothing_is_drawn(driver):
    driver._drawing = False
    assert driver.paint("abc") == ""
    assert not driver.behind


def test_while_the_terminal_has_not_taken_a_frame_the_next_ones_become_one(driver):
    driver.write("\x1b[1;1Ha")
    driver.flush()
    assert driver.behind
    for word in "bcd":
        driver.write(f"\x1b[1;1H{word}")
        driver.flush()
    assert "b" not in "".join(driver.out)
    driver.take()
    assert "".join(driver.out) == "\x1b[1;1Hd\x1b[1;2H"
    driver.take()
    assert not driver.behind


def test_where_the_cursor_is_is_said_again_when_it_moved_alone(driver):
    driver.paint("abc")
    assert driver.paint("abc\x1b[4;6H") == "\x1b[4;6H"
    driver.paint("abc\x1b[1;30H")
    assert driver._cursor == (0, WIDTH - 1)


def test_all_is_sent_again_after_something_else_wrote_on_the_screen(driver):
    driver.paint("abc")
    driver.terminal.feed("\x1b[1;1Hrubbish\x1b[3;1Hrubbish")
    driver.repaint()
    driver.take()
    assert shown(driver) == ["abc", "", "", "", ""]


def test_what_may_move_cells_is_handed_on_after_what_came_before_and_all_is_sent_again(driver):
    driver.write("\x1b[1;1Habc\x1bc\x1b[1;1Habc")
    driver.flush()
    text = driver.take()
    assert "\x1bc" in text
    driver.flush()
    text += driver.take()
    assert text.index("abc") < text.index("\x1bc") < text.rindex("abc")


def test_a_new_screen_is_known_to_be_empty(driver):
    driver.paint("abc")
    driver.write(ALT_SCREEN)
    assert "".join(driver.out).startswith(ALT_SCREEN)
    driver.take()
    driver.terminal.feed("\x1b[2J")
    assert driver.paint("   ", "x") == "\x1b[2;1Hx\x1b[2;2H"
    assert driver._screens == 1


def test_a_terminal_of_another_size_is_drawn_anew(driver):
    driver.paint("abcdefghijklmnopqrst")
    driver.size = (10, 3)
    driver.terminal = Emulator(10, 3)
    driver.paint("0123456789", "x")
    assert shown(driver) == ["0123456789", "x", ""]


def test_what_another_thread_writes_is_no_picture(driver):
    driver._owner = -1
    driver.write("\x1b[?1003h")
    assert driver.out == ["\x1b[?1003h"]
    assert driver._follower.feeds == 0


@pytest.mark.parametrize(
    ("had", "wanted", "sent"), [(True, True, ""), (False, False, ""), (True, False, "l"), (False, True, "h")]
)
def test_the_mouse_is_taken_and_left_while_it_runs(had, wanted, sent, driver):
    driver._mouse = had
    driver.take_mouse(wanted=wanted)
    assert driver._mouse is wanted
    assert "".join(driver.out).count(f"\x1b[?1003{sent}" if sent else "\x1b[?1003") == bool(sent)


# ------------------------------------------------------------------------------------------------------------- answers


def asked(driver: Glass) -> None:
    """As Textual does at the beginning: it asks for the mode."""
    driver.write(QUERY)
    driver.take()


def test_a_terminal_is_asked_twice_whether_it_answers(driver):
    driver.write(QUERY)
    assert "".join(driver.out) == QUERY + ALIVE_QUERY
    assert driver.pacer.unanswered == len(QUERY)


def test_who_is_not_asked_is_not_waited_for(driver):
    assert not driver.paint("abc").endswith(QUERY)


@pytest.mark.parametrize(
    ("answers", "query"),
    [([ANSWER], QUERY), ([ANSWER, ALIVE_ANSWER], QUERY), ([ALIVE_ANSWER], ALIVE_QUERY), ([NO_MODE], QUERY)],
)
def test_each_frame_ends_with_what_the_terminal_answers(answers, query, driver):
    asked(driver)
    came_s, answered = [], driver.pacer.answered
    driver.pacer.answered = lambda now_s: (came_s.append(now_s), answered(now_s))
    driver.answer(*answers)
    assert (driver.pacer.answers, came_s) == (1, [driver.clock.s])
    assert driver.paint("abc").endswith(query)
    driver.answer(ANSWER if query == QUERY else ALIVE_ANSWER)
    assert driver.pacer.answers == 2
    assert driver.pacer.unanswered == 0


@pytest.mark.parametrize(("answer", "brackets"), [(ANSWER, True), (NO_MODE, False), (ALIVE_ANSWER, False)])
def test_frames_stand_in_brackets_where_the_terminal_knows_them(answer, brackets, driver):
    asked(driver)
    driver.answer(answer)
    text = driver.paint("abc")
    assert text.startswith(SYNC_BEGIN) is brackets
    assert (SYNC_END in text) is brackets


def test_what_is_not_answered_lets_frames_wait_until_it_is_overdue(driver, clock):
    asked(driver)
    driver.pacer.sent(1 << 20, clock.s)
    assert driver.paint("abc") == ""
    assert driver.behind
    (timer,) = driver._loop.due
    assert timer.at_s == pytest.approx(100.0 + FIRST_S)
    driver.flush()
    assert len(driver._loop.due) == 1  # one at a time
    clock.s = timer.at_s
    timer.do()
    assert "abc" in driver.take()
    assert not driver.behind
    assert driver._loop.due == []


def test_an_answer_lets_what_waits_go_on(driver, clock):
    asked(driver)
    driver.answer(ANSWER)
    driver.pacer.sent(1 << 20, clock.s)
    assert driver.paint("abc") == ""
    clock.s += 0.1
    driver.answer(ANSWER)
    assert "abc" in driver.take()


def test_a_large_frame_goes_in_pieces_and_on_where_it_ended(driver, monkeypatch):
    monkeypatch.setattr(driver.pacer, "room", lambda *, urgent: 25)
    lines = [letter * WIDTH for letter in "abcde"]
    first = driver.paint(*lines)
    assert "a" * WIDTH in first
    assert "b" * WIDTH not in first
    assert driver.behind
    seen = first + "".join(driver.out)
    for _ in range(HEIGHT):
        seen += driver.take()
    assert [seen.index(line) for line in lines] == sorted(seen.index(line) for line in lines)
    assert shown(driver) == lines
    assert not driver.behind


def test_what_a_key_changed_goes_first(driver, clock, monkeypatch):
    lines = [letter * WIDTH for letter in "abcde"]
    driver.paint(*lines)
    room = []
    monkeypatch.setattr(driver.pacer, "room", lambda *, urgent: room.append(urgent) or 5)
    driver.write("".join(f"\x1b[{row};1H{'x' * WIDTH}" for row in (1, 2, 3)))
    driver.process_message(events.Key("j", "j"))
    driver.write(f"\x1b[4;1H{'y' * WIDTH}")
    driver.flush()
    assert "".join(driver.out).startswith(f"\x1b[4;1H{'y' * WIDTH}")
    assert room == [True]
    clock.s += URGENT_S
    driver.take()
    assert room == [True, False]


@pytest.mark.parametrize(
    ("message", "urgent"),
    [
        (events.Key("j", "j"), True),
        (events.MouseDown(None, 0, 0, 0, 0, 1, False, False, False), True),
        (events.MouseScrollDown(None, 0, 0, 0, 0, 1, False, False, False), True),
        (events.MouseScrollUp(None, 0, 0, 0, 0, 1, False, False, False), True),
        (events.MouseMove(None, 0, 0, 0, 0, 1, False, False, False), False),
        (events.Resize(None, None), False),
    ],
)
def test_what_is_typed_or_clicked_is_urgent_and_passed_on(message, urgent, driver, clock):
    driver.process_message(message)
    assert driver.posted == [message]
    assert (driver._urgent_until_s == clock.s + 1.0) is urgent
    assert driver.pacer._keys_since is urgent


# ------------------------------------------------------------------------------------------------------------- the end


class Reader:
    """The thread that reads."""

    def __init__(self, alive: bool) -> None:
        self.alive = alive

    def is_alive(self) -> bool:
        return self.alive


@pytest.mark.parametrize(
    ("alive", "hung_up", "waits_s"),
    [(True, False, FIRST_S), (False, False, 0.0), (True, True, 0.0)],
)
def test_last_answers_are_waited_for_while_somebody_reads_them(alive, hung_up, waits_s, driver, clock, monkeypatch):
    ended = []
    monkeypatch.setattr(LinuxDriver, "disable_input", lambda self: ended.append(clock.s))
    monkeypatch.setattr(driver._answer_came, "wait", lambda left_s: setattr(clock, "s", clock.s + left_s))
    driver._key_thread, driver._hung_up = Reader(alive), hung_up
    asked(driver)
    driver.disable_input()
    assert ended == [pytest.approx(100.0 + waits_s)]
    assert driver.paint("abc") == ""


def test_an_answer_that_came_is_not_waited_for(driver, clock, monkeypatch):
    ended = []
    monkeypatch.setattr(LinuxDriver, "disable_input", lambda self: ended.append(clock.s))

    def comes(left_s: float) -> None:
        clock.s += 0.1
        driver._note_answers((ANSWER,))

    monkeypatch.setattr(driver._answer_came, "wait", comes)
    driver._key_thread = Reader(True)
    asked(driver)
    driver.disable_input()
    assert ended == [pytest.approx(100.1)]


def test_the_end_is_waited_for_a_second_at_most(driver, clock, monkeypatch):
    ended = []
    monkeypatch.setattr(LinuxDriver, "disable_input", lambda self: ended.append(clock.s))
    monkeypatch.setattr(driver._answer_came, "wait", lambda left_s: setattr(clock, "s", clock.s + left_s / 2))
    driver._key_thread = Reader(True)
    monkeypatch.setattr(type(driver.pacer), "farewell_s", property(lambda _: clock.s + 0.1))
    driver.disable_input()
    assert ended[0] == pytest.approx(100.0 + FAREWELL_S, abs=0.1)


@pytest.mark.parametrize("came_back", [True, False])
def test_suspended_it_gives_the_terminal_back_and_takes_it_when_it_may(came_back, driver, monkeypatch):
    done = []
    monkeypatch.setattr(LinuxDriver, "_sigtstp_application", lambda self: done.append("suspend"))

    def back(self: Glass) -> None:
        done.append("back")
        self._drawing = came_back

    monkeypatch.setattr(LinuxDriver, "_sigcont_application", back)
    driver._sigtstp_application()
    assert done == []  # the signal may come in the midst of a frame
    driver._loop.turn()
    driver._sigcont_application()
    assert done == ["suspend", "back"]
    driver._sigcont_application()
    assert done == ["suspend", "back"] + ["back"] * (not came_back)


def test_stopped_from_outside_it_draws_all_again(driver):
    driver.paint("abc")
    driver.terminal.feed("\x1b[2J")
    driver._sigcont_application()
    driver._loop.turn()
    driver.take()
    assert shown(driver)[0] == "abc"


@pytest.mark.parametrize("begins", [True, False])
def test_when_the_terminal_is_taken_its_changes_of_size_are_followed(begins, driver, monkeypatch):
    handlers = {}
    followed = []
    monkeypatch.setattr(module.signal, "getsignal", lambda _: lambda *given: followed.append(given))
    monkeypatch.setattr(module.signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(LinuxDriver, "start_application_mode", lambda self: self.write(ALT_SCREEN) if begins else None)
    driver._drawing = False
    driver.write("\x1b[1;1Hab")
    driver.start_application_mode()
    assert driver._drawing is begins
    if begins:
        driver.take()
        (follow,) = handlers.values()
        follow(28, None)
        assert followed == [(28, None)]
        driver.terminal.feed("\x1b[2;1Hrubbish")
        assert "rubbish" not in driver.paint("ab")
        assert shown(driver)[:2] == ["ab", ""]


# ------------------------------------------------------------------------------------------------------------- reading


def test_what_is_read_is_keys_but_for_the_answers(driver):
    driver.fileno, end = os.pipe()
    driver.exit_event = SimpleNamespace(is_set=lambda: False)
    os.write(end, b"a" + ANSWER + "é".encode() + b"\x1b[A")
    os.close(end)
    driver.run_input_thread()
    os.close(driver.fileno)
    assert [message.key for message in driver.posted] == ["a", "é", "up"]
    assert driver._hung_up
    driver._loop.turn()
    assert driver.pacer.answers == 1


def test_a_terminal_that_is_gone_hangs_up(driver):
    driver.fileno, end = os.pipe()
    os.close(end)
    driver.exit_event = SimpleNamespace(is_set=lambda: True)
    driver.run_input_thread()
    assert (driver.posted, driver._hung_up) == ([], False)
    driver.exit_event = SimpleNamespace(is_set=lambda: False)
    driver.run_input_thread()
    assert driver._hung_up
    os.close(driver.fileno)


class Unknown(Exception):
    """As curses has one of its own."""


@pytest.mark.parametrize(
    ("flag", "dch", "told"),
    [
        (1, b"\x1b[%p1%dP", (True, True)), (0, b"\x1b[%p1%dP", (False, True)), (-1, None, (False, False)),
        (1, b"\x1b[%p1%dX", (True, False)), (None, None, (False, False)),
    ],
)  # fmt: skip
def test_what_the_terminal_can_is_told_by_its_description(flag, dch, told, monkeypatch):
    def asked(_: str) -> int:
        if flag is None:
            raise Unknown
        return flag

    curses = SimpleNamespace(setupterm=lambda *_: None, tigetflag=asked, tigetstr={"dch": dch}.get)
    monkeypatch.setitem(sys.modules, "curses", curses)
    assert module._told_of_terminal() == told
