"""A thin link: how much is on its way, what is left out, and answers that never become keys."""

from types import SimpleNamespace

import pytest

from silo_tui.terminal.answers import AnswerFilter, knows_mode
from silo_tui.terminal.driver import CellDriver
from silo_tui.terminal.pacing import (
    FIRST_BYTES,
    FIRST_S,
    SMALLEST_WINDOW,
    TIMEOUT_S,
    UNPACED,
    Pacer,
    link_words,
    waited_s,
)
from silo_tui.terminal.thinness import START_S, STEPS, Busyness, Painted, Thinness, head_words

ANSWER = b"\x1b[?2026;2$y"


class Link:
    """A terminal behind a link of so many bytes a second, that answers so long after it has read."""

    def __init__(self, bytes_per_s, delay_s):
        self.pacer = Pacer()
        self.now_s = 100.0
        self.bytes_per_s, self.delay_s = bytes_per_s, delay_s
        self.free_s = 0.0
        self.answers = []

    def send(self, size):
        self.pacer.sent(size, self.now_s)
        self.free_s = max(self.free_s, self.now_s) + size / self.bytes_per_s
        self.answers.append(self.free_s + self.delay_s)

    def wait(self, seconds):
        until_s = self.now_s + seconds
        while self.answers and self.answers[0] <= until_s:
            self.now_s = self.answers.pop(0)
            self.pacer.answered(self.now_s)
        self.now_s = until_s
        self.pacer.check(self.now_s)

    def stream(self, seconds, frame=4_000):
        """Frames as fast as they may be sent, in pieces."""
        begin_s, most = self.now_s, 0
        while self.now_s < begin_s + seconds:
            if (room := self.pacer.room()) > 0:
                self.send(min(room, frame))
            most = max(most, self.pacer.unanswered)
            self.wait(0.01)
        return most


def answering(bytes_per_s=8_000, delay_s=0.1):
    link = Link(bytes_per_s, delay_s)
    for _ in range(2):
        link.send(40)
        link.wait(delay_s + 0.1)
    return link


def test_what_is_unanswered_stays_small_on_a_thin_link():
    link = answering()
    link.stream(10)
    assert link.stream(10) <= 1.2 * SMALLEST_WINDOW


def test_the_window_widens_until_a_fat_long_link_is_full():
    link = answering(bytes_per_s=125_000, delay_s=0.2)
    link.stream(10)
    begin = link.pacer._total
    link.stream(10)
    assert link.pacer._total - begin > 0.8 * 10 * 125_000


def test_throughput_and_way_are_told_as_they_are():
    link = answering(bytes_per_s=8_000, delay_s=0.2)
    link.stream(5)
    assert 6_500 < link.pacer.bytes_per_s < 9_500


@pytest.mark.parametrize(
    ("bytes_per_s", "usual_s", "words"),
    [
        (0.0, 0.0, []), (0.0, 0.0874, ["90 ms"]), (8_000, 0.2137, ["64 kbit/s", "210 ms"]),
        (124_900, 0.0, ["999 kbit/s"]), (125_000, 1.5, ["1.0 Mbit/s", "1500 ms"]),
    ],
)  # fmt: skip
def test_what_is_known_of_the_link_is_told_in_words(bytes_per_s, usual_s, words):
    assert link_words(SimpleNamespace(bytes_per_s=bytes_per_s, usual_s=usual_s)) == words


def test_the_window_doubles_at_most_with_each_answer_and_has_an_end():
    link, found = answering(bytes_per_s=1e7, delay_s=0.2), []
    for _ in range(8):
        link.send(link.pacer.window)
        link.wait(0.5)
        found.append(link.pacer.window)
    assert found == [6_000, 12_000, 24_000, 48_000, 96_000, 192_000, 200_000, 200_000]


def test_the_window_carries_what_may_wait_for_a_quarter_of_a_second_and_the_way():
    link = answering(bytes_per_s=100_000, delay_s=0.1)
    for _ in range(12):
        link.send(20_000)
        link.wait(0.5)
    assert link.pacer.window == pytest.approx(100_000 * (0.1 + 0.25), rel=0.01)


def test_what_a_key_changed_may_go_beyond_the_window():
    link = answering()
    link.send(SMALLEST_WINDOW)
    assert (link.pacer.room(), link.pacer.room(urgent=True)) == (0, SMALLEST_WINDOW)


def test_before_the_first_answer_little_is_sent_and_then_it_is_not_waited_for():
    link = Link(1e9, 1e9)
    link.send(FIRST_BYTES)
    link.wait(FIRST_S - 0.01)
    assert link.pacer.room() == 0
    link.wait(0.01)
    assert link.pacer.room() == UNPACED


def test_a_terminal_that_answered_once_only_is_not_waited_for():
    link = Link(1e9, 0.01)
    link.send(10)
    link.wait(0.1)
    link.delay_s = 1e9
    link.send(SMALLEST_WINDOW)
    link.wait(TIMEOUT_S - 0.01)
    assert link.pacer.room() == 0
    link.wait(0.01)
    assert link.pacer.room() == UNPACED


def test_a_link_that_stalls_is_not_filled():
    link = answering()
    link.delay_s = 1e9
    begin = link.pacer._total
    link.stream(60)
    assert link.pacer._total - begin < 15 * SMALLEST_WINDOW


def test_after_a_stall_the_late_answers_do_no_harm():
    link = answering()
    link.delay_s = 30.0
    link.stream(20)
    link.delay_s = 0.1
    link.wait(60)
    assert link.stream(10) <= 1.5 * SMALLEST_WINDOW
    assert link.pacer.room() < UNPACED


def silent_after(happens):
    """Whether a terminal that answered isn't waited for after what happens between time-outs.

    `k` is a key while an answer is waited for, `e` one before anything was sent, `-` none, `a` an answer.
    """
    link = answering()
    link.delay_s = 1e9
    for each in happens:
        if each == "e":
            link.pacer.key()
        link.send(10)
        if each == "k":
            link.pacer.key()
        if each == "a":
            link.pacer.answered(link.now_s)
        link.wait(10)
    return link.pacer.room() == UNPACED


@pytest.mark.parametrize(
    ("happens", "silent"),
    [("kk", False), ("kkk", True), ("---", False), ("eee", False), ("kk-k", False), ("kk-kk", False),
     ("-kkk", True), ("kkak", False), ("kkakkk", True)],
)  # fmt: skip
def test_a_terminal_that_types_three_times_but_no_longer_answers_is_not_waited_for(happens, silent):
    assert silent_after(happens) is silent


@pytest.mark.parametrize(("way_s", "waits_s"), [(0.1, [2, 4, 8, 8]), (1.0, [4, 8, 8, 8])])
def test_an_answer_is_waited_for_longer_each_time_until_one_comes(way_s, waits_s):
    link, found = answering(1e9, way_s), []
    for _ in waits_s:
        link.send(10)
        found.append(link.pacer.due_s - link.now_s)
        link.pacer.check(link.pacer.due_s - 0.01)
        assert link.pacer.unanswered == 10
        link.now_s = link.pacer.due_s
        link.pacer.check(link.now_s)
        assert link.pacer.unanswered == 0
    assert found == pytest.approx(waits_s)
    link.pacer.answered(link.now_s)
    link.send(10)
    assert link.pacer.due_s - link.now_s == pytest.approx(waits_s[0])


@pytest.mark.parametrize(("after_s", "unanswered"), [(29.0, 10), (31.0, 0)])
def test_an_answer_that_is_overdue_for_half_a_minute_is_no_longer_expected(after_s, unanswered):
    link = answering(1e9, 0.1)
    link.answers = [1e9]
    link.send(10)
    link.wait(after_s)
    assert link.pacer.unanswered == 0
    link.pacer.sent(10, link.now_s)
    link.pacer.answered(link.now_s + 0.5)  # of the newest, or late of the one before
    assert link.pacer.unanswered == unanswered


def test_a_terminal_lags_by_what_the_newest_or_the_one_waited_for_takes_beyond_the_fastest():
    pacer = Pacer()
    assert pacer.lag_s(100.0) == 0.0
    for begin_s, took_s in ((100.0, 0.2), (101.0, 0.9), (102.0, 0.5)):
        pacer.sent(10, begin_s)
        pacer.answered(begin_s + took_s)
    assert (pacer.fastest_s, pacer.usual_s) == (pytest.approx(0.2), pytest.approx(0.5))
    assert pacer.lag_s(110.0) == pytest.approx(0.3)
    pacer.sent(10, 110.0)
    pacer.sent(10, 110.9)
    assert [pacer.lag_s(now_s) for now_s in (110.1, 111.0)] == pytest.approx([0.3, 0.8])


def test_answers_that_may_come_after_the_end_are_waited_for():
    link = Link(1e9, 1e9)
    assert link.pacer.farewell_s is None
    link.send(10)
    link.send(10)
    assert link.pacer.farewell_s == 100.0 + FIRST_S
    link.wait(FIRST_S)
    assert link.pacer.farewell_s is None  # nobody answers
    link = answering(1e9, 0.2)
    assert link.pacer.farewell_s is None  # all came
    link.delay_s = 1e9
    link.send(10)
    assert link.pacer.farewell_s - link.now_s == pytest.approx(1.4)
    once = Link(1e9, 0.1)
    once.send(10)
    once.wait(0.2)
    once.send(10)
    once.pacer.check(once.now_s + TIMEOUT_S)
    assert not once.pacer.paced
    assert once.pacer.farewell_s - once.now_s == pytest.approx(1.2)  # late ones may come all the same


# ------------------------------------------------------------------------------------------------- what is left out


def judged(thinness, seconds, *, late, begin_s=0.0):
    for tick in range(round(5 * seconds)):
        thinness.note(late=late, now_s=begin_s + tick / 5)
    return begin_s + seconds


def test_trends_go_first_then_digits_then_values_down_to_half_a_hertz():
    assert [step.trend_s for step in STEPS] == sorted(step.trend_s for step in STEPS)
    first_fewer = next(at for at, step in enumerate(STEPS) if step.digits_fewer)
    first_slower = next(at for at, step in enumerate(STEPS) if step.value_share < 1)
    assert 0 < next(at for at, step in enumerate(STEPS) if step.trend_s > 1) < first_fewer < first_slower
    thinness = Thinness()
    judged(thinness, 60, late=True)
    assert thinness.value_hz(5.0) == 0.5


def test_a_link_that_is_good_for_five_seconds_gets_one_step_back_at_a_time():
    thinness = Thinness()
    now_s = judged(thinness, 3, late=True)
    worst = thinness.step
    judged(thinness, 4.8, late=False, begin_s=now_s)
    assert thinness.step == worst
    judged(thinness, 1, late=False, begin_s=now_s + 4.8)
    assert thinness.step == worst - 1


@pytest.mark.parametrize(("late_of_ten", "down"), [(10, 2), (9, 1), (6, 1)])
def test_values_thin_out_two_steps_at_once_only_where_nothing_comes_in_time(late_of_ten, down):
    thinness = Thinness()
    steps = []
    for tick in range(400):
        before = thinness.step
        thinness.note(late=tick % 10 >= 10 - late_of_ten, now_s=tick / 5)
        steps += [thinness.step - before] if thinness.step > before else []
    assert set(steps[:3]) == {down}


def test_one_late_frame_changes_nothing():
    thinness = Thinness()
    for tick in range(100):
        thinness.note(late=tick % 10 == 0, now_s=tick / 5)
    assert thinness.step == 0


def until_stepped(thinness, begin_s, *, late):
    """When a step was taken where all is late, or nothing."""
    step, now_s = thinness.step, begin_s
    while thinness.step == step:
        now_s += 0.2
        thinness.note(late=late, now_s=now_s)
    return now_s


def test_a_step_is_judged_for_a_second():
    thinness, steps = Thinness(), []
    for tick in range(30):
        thinness.note(late=True, now_s=tick / 5)
        steps.append(thinness.step)
    assert steps == [*[0] * 5, *[2] * 5, *[4] * 5, *[6] * 5, *[8] * 10]


def test_a_step_back_that_went_wrong_is_tried_again_after_twice_as_long_until_all_is_shown():
    thinness, now_s, waited = Thinness(), until_stepped(Thinness(), 100.0, late=True), []
    for _ in range(6):
        begin_s = until_stepped(thinness, now_s, late=True)
        now_s = until_stepped(thinness, begin_s, late=False)
        waited.append(now_s - begin_s)
    assert waited == pytest.approx([5, 10, 20, 40, 60, 60], abs=0.5)
    while thinness.step:
        now_s = until_stepped(thinness, now_s, late=False)
    begin_s = until_stepped(thinness, now_s + 10.0, late=True)
    assert until_stepped(thinness, begin_s, late=False) - begin_s == pytest.approx(5, abs=0.5)


RARE = "trends and statistics every 8 s, 2 digits fewer"


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (1, "trends every 2 s"), (2, "trends every 8 s"), (3, "trends every 8 s, 1 digit fewer"),
        (4, "trends every 8 s, 2 digits fewer"), (5, RARE), (6, f"values 2.5 of 5 Hz, {RARE}"),
        (7, f"values 1.2 of 5 Hz, {RARE}"), (8, f"values 0.5 of 5 Hz, {RARE}"),
    ],
)  # fmt: skip
def test_it_says_what_is_left_out_and_which_rate_holds_of_the_wished_one(step, words):
    thinness = Thinness()
    assert thinness.words(5.0) == ""
    thinness.step = step
    assert thinness.words(5.0) == f"thin link, or a slow terminal: {words}; keys go first"


# --------------------------------------------------------------------------------------------------------- answers


@pytest.mark.parametrize("cut", range(1, len(ANSWER)))
def test_an_answer_in_two_pieces_is_no_key(cut):
    answers = AnswerFilter()
    first, second = answers.feed(b"j" + ANSWER[:cut]), answers.feed(ANSWER[cut:] + b"k")
    assert (first.typed, second.typed) == (b"j", b"k")
    assert first.answers + second.answers == (ANSWER,)


@pytest.mark.parametrize("cut", range(3, len(ANSWER)))
def test_the_rest_of_an_answer_may_come_late(cut):
    answers = AnswerFilter()
    answers.feed(ANSWER[:cut])
    assert answers.waited() == b""
    assert answers.feed(ANSWER[cut:]).typed == b""


def test_the_escape_key_passes_when_nothing_follows():
    answers = AnswerFilter()
    assert answers.feed(b"\x1b").typed == b""
    assert answers.waited() == b"\x1b"
    assert answers.feed(b"j").typed == b"j"


@pytest.mark.parametrize("key", [b"\x1b[A", b"\x1b[1;2C", b"\x1bOP", b"\x1b[<0;3;4M", b"\x1b[?2048;2$y", "é".encode()])
def test_keys_and_other_reports_pass(key):
    assert AnswerFilter().feed(key + ANSWER + key).typed == key + key


@pytest.mark.parametrize(("answer", "known"), [(ANSWER, True), (b"\x1b[?2026;0$y", False), (b"\x1b[0n", False)])
def test_frames_are_bracketed_only_where_the_terminal_knows_it(answer, known):
    assert knows_mode(answer) is known


def painted(hz, wished_hz=5.0, seconds=10.0, took_s=0.0):
    """What is told of a terminal that takes a share of the paints, asked later by `took_s` each time."""
    found, now_s, shown = Painted(), 100.0, 0.0
    while now_s < 100.0 + seconds:
        now_s += 1 / wished_hz + took_s
        shown += hz * (1 / wished_hz + took_s)
        found.note(wished_hz, painted=shown >= 1, now_s=now_s)
        shown -= shown >= 1
    return found.words


def test_a_rate_below_the_wished_one_is_told():
    assert painted(1.25) == "1.3 of 5 Hz"
    assert painted(0.0) == "0.0 of 5 Hz"
    assert painted(5.0) == ""
    assert painted(4.9) == ""


def test_a_computer_too_busy_for_the_wished_rate_is_told_too():
    assert painted(100.0, took_s=0.3) == "2.0 of 5 Hz"


@pytest.mark.parametrize(
    ("room", "words"),
    [
        (60, "THIN 0.0 of 5 Hz 64 kbit/s 210 ms"),
        (26, "THIN 0.0 of 5 Hz 64 kbit/s"),
        (25, "THIN 0.0 of 5 Hz"),
        (3, "THIN"),
    ],
)
def test_a_narrow_head_leaves_whole_words_out(room, words):
    thin, slow = Thinness(), Painted()
    thin.step = 8
    for tick in range(30):
        slow.note(5.0, painted=False, now_s=tick / 5)
    assert head_words(thin, slow, ["64 kbit/s", "210 ms"], room) == words
    thin.step = 0
    assert head_words(thin, slow, ["64 kbit/s", "210 ms"], 60) == "DRAWN 0.0 of 5 Hz"
    assert head_words(thin, Painted(), ["64 kbit/s"], 60) == ""
    assert head_words(thin, slow, [], 6) == ""  # alone the word says nothing


def test_nothing_is_told_of_a_rate_before_it_was_measured():
    assert painted(1.0, seconds=1.5) == ""
    found = Painted()
    for tick in range(50):
        found.note(5.0, painted=False, now_s=tick / 5)
    assert found.words == "0.0 of 5 Hz"
    for tick in range(50):  # it is told for a moment more, as what comes and goes is no sign of anything
        found.note(5.0, painted=tick % 10 != 0, now_s=10 + tick / 5)
    assert found.words == "4.7 of 5 Hz"
    for tick in range(17):  # but not of one at which nothing is missed
        found.note(5.0, painted=True, now_s=16.8 + tick / 5)
    assert found.words == ""
    for tick in range(50):
        found.note(5.0, painted=tick < 40, now_s=20 + tick / 5)
    assert found.words == "1.9 of 5 Hz"
    found.note(4.0, painted=False, now_s=30.0)
    assert found.words == ""


def busyness(share, seconds=10.0):
    found = Busyness()
    for tick in range(round(5 * seconds)):
        found.note(share * tick / 5, tick / 5)
    return found


def test_processors_are_busy_where_one_waits_for_them():
    assert not Busyness().is_busy
    assert not busyness(0.01).is_busy
    found = busyness(0.3)
    assert found.is_busy
    for tick in range(15):  # and no more when that is over
        found.note(3.0, 10 + tick / 5)
    assert not found.is_busy


@pytest.mark.parametrize(("waits", "answers", "thin"), [(0.0, 1, True), (0.5, 1, False), (0.0, 0, False)])
def test_late_answers_are_those_of_the_link_unless_processors_are_busy_or_none_came_yet(
    monkeypatch, waits, answers, thin
):
    assert bool(driven(monkeypatch, waits, answers).thinness.step) is thin


@pytest.mark.parametrize(("lasts_s", "thin"), [(START_S, False), (START_S + 2.0, True)])
def test_no_link_is_blamed_while_all_is_drawn_for_the_first_time(monkeypatch, lasts_s, thin):
    driver = driven(monkeypatch, 0.0, 1, lasts_s=lasts_s)
    assert head_words(driver.thinness, Painted(), ["64 kbit/s"], 60).startswith("THIN") is thin
    assert driven(monkeypatch, 0.0, 1, driver, 100.0, 3.0).thinness.step  # it starts once


@pytest.mark.parametrize("waits", [0.0, 0.5])
def test_a_link_that_is_seen_to_carry_much_is_thin_no_more(monkeypatch, waits):
    driver = driven(monkeypatch, 0.0, 1)
    assert driver.thinness.step
    step, driver.pacer.bytes_per_s = driver.thinness.step, 400_000
    assert driven(monkeypatch, waits, 1, driver, 10.0).thinness.step < step
    assert driven(monkeypatch, waits, 1, driver, 20.0, 120.0).thinness.step == 0


@pytest.mark.parametrize(
    ("fastest_s", "ssh", "head"),
    [
        (0.0005, "", "DRAWN 0.0 of 5 Hz"),  # nobody knows why: the terminal may be slow
        (0.0005, "10.0.0.2 50022 10.0.0.1 22", "THIN 0.0 of 5 Hz 717 kbit/s"),
        (0.02, "", "THIN 0.0 of 5 Hz 717 kbit/s"),
    ],
)
def test_a_terminal_on_this_very_computer_has_no_link_that_could_be_thin(monkeypatch, fastest_s, ssh, head):
    for name in ("SSH_CONNECTION", "SSH_TTY", "SSH_CLIENT"):
        monkeypatch.delenv(name, raising=False)
    if ssh:
        monkeypatch.setenv("SSH_CONNECTION", ssh)
    driver = lagging(1)
    driver.pacer.fastest_s, driver.pacer.bytes_per_s, driver.behind = fastest_s, 89_600, True
    driven(monkeypatch, 0.0, 1, driver)
    assert head_words(driver.thinness, driver.painted, ["717 kbit/s"], 60) == head
    if not driver.thinness.step:  # and where processors are what is late, that is said
        driven(monkeypatch, 0.5, 1, driver, 10.0)
        assert driver.busyness.is_busy
        assert head_words(driver.thinness, driver.painted, [], 60) == "DRAWN 0.0 of 5 Hz"


def lagging(answers):
    """The parts of a driver whose terminal lags by a second."""
    return SimpleNamespace(
        pacer=SimpleNamespace(paced=True, answers=answers, lag_s=lambda now_s: 1.0, fastest_s=0.01, bytes_per_s=8_000),
        thinness=Thinness(), busyness=Busyness(), painted=Painted(), behind=False, _painted_s=0.0, _began_s=None,
        _take_answers=lambda: None,
    )  # fmt: skip


def driven(monkeypatch, waits, answers, driver=None, begin_s=0.0, lasts_s=10.0):
    """The parts of a driver whose terminal lags by a second, after 10 s."""
    clock = SimpleNamespace(s=0.0, monotonic=lambda: clock.s)
    driver = driver or lagging(answers)
    monkeypatch.setattr("silo_tui.terminal.driver.time", clock)
    monkeypatch.setattr("silo_tui.terminal.driver.waited_s", lambda: waits * clock.s)
    for tick in range(1, round(5 * lasts_s)):
        clock.s = begin_s + tick / 5
        CellDriver.may_paint(driver, 5.0)
    return driver


def test_the_kernel_counts_how_long_a_thread_waits_for_a_processor():
    assert 0.0 <= waited_s() <= waited_s()
