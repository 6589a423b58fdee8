"""What is sent to the terminal: only what changed, and the picture is that of a full repaint."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len, set_cell_size

from silo_tui.terminal.cells import LONG_BLANK, TAIL, UNKNOWN, Grid, difference
from silo_tui.terminal.parser import Follower
from silo_tui.terminal.styles import DEFAULT, Styles
from tests.tui.emulator import Emulator

WIDTH, HEIGHT = 70, 7  # room for several erased pieces in a line
NO_BUDGET = 1 << 30

STYLES = [
        "", "1", "2", "4", "7", "1;4", "31", "92", "1;97", "44", "38;5;12", "38;2;1;2;3", "38;2;9;9;9;48;2;5;5;5",
        "48;2;5;5;5", "7;38;2;1;2;3", "3;48;5;7", "4;48;2;5;5;5",
]  # fmt: skip
LETTERS = [*"aB 1.  ⠉⣿│▐…°漢字🙂", "e\u0301", "\u0301"]


def test_normal_intensity_ends_bold_and_dim():
    styles = Styles()
    dim, bold = styles.after(0, "2"), styles.after(0, "1")
    assert dim not in (0, bold)
    assert styles.after(dim, "22") == styles.after(bold, "22") == styles.after(styles.after(bold, "2"), "22") == 0


FRONTS = ["30", "37", "90", "97", "38;5;12", "38;2;1;2;3", "38:5:12"]
BACKS = ["40", "47", "100", "107", "48;5;12", "48;2;1;2;3", "48:5:12"]


@pytest.mark.parametrize(("colors", "ends", "ends_not"), [(FRONTS, "39", "49"), (BACKS, "49", "39")])
def test_a_colour_is_one_until_that_of_the_terminal_takes_its_place(colors, ends, ends_not):
    styles = Styles()
    for color in colors:
        style = styles.after(0, color)
        assert styles.way(0, style) == f"\x1b[{color}m"
        assert styles.after(style, ends) == styles.after(style, "") == styles.after(style, "0") == 0
        assert styles.after(style, ends_not) == style
        assert styles.after(style, colors[0]) == styles.after(0, colors[0])
        assert styles.after(0, f"{color};1") == styles.after(style, "1")
        assert styles.ground(styles.after(style, "1")) == (0 if ends == "39" else style)


@pytest.mark.parametrize(
    ("flag", "shows"), [("1", False), ("3", False), ("4", True), ("4:3", True), ("7", True), ("9", True)]
)
def test_of_a_blank_what_is_under_or_through_it_shows(flag, shows):
    styles = Styles()
    style = styles.after(0, flag)
    assert styles.ground(style) == (style if shows else 0)
    assert styles.is_plain(styles.ground(style)) is not shows
    assert not styles.is_plain(style)


def rendered(segments):
    return "".join(f"\x1b[{style}m{words}\x1b[0m" if style else words for words, style in segments)


def painted(place, segments):
    """As the compositor writes it: cut at the end of the line, where a wide character has no half."""
    row, column = place
    pieces, room = [], WIDTH - column
    for words, style in segments:
        cut = set_cell_size(words, min(room, cell_len(words)))
        pieces.append((cut, style))
        room -= cell_len(cut)
    return f"\x1b[{row + 1};{column + 1}H{rendered(pieces)}"


def segments(draw):
    words = [
        "".join([*draw.choices(LETTERS, k=draw.randrange(20)), " " * draw.choice([0, 0, 15])])
        for _ in range(draw.randint(1, 4))
    ]
    return [(each, draw.choice(STYLES)) for each in words]


def span(draw):
    """As the compositor writes: a piece of a line."""
    return painted((draw.randrange(HEIGHT), draw.randrange(WIDTH)), segments(draw))


def dialog(draw):
    column, style = draw.randrange(WIDTH), draw.choice(STYLES)
    blank = " " * draw.randint(1, WIDTH - column)
    return "".join(painted((row, column), [(blank, style)]) for row in range(draw.randrange(HEIGHT), HEIGHT))


def scroll(draw):
    """All lines again, moved by some."""
    lines, shift = [segments(draw) for _ in range(3)], draw.randrange(3)
    return "".join(
        painted((row, 0), [(" " * WIDTH, "")]) + painted((row, 0), lines[(row + shift) % 3]) for row in range(HEIGHT)
    )


DOTS = "".join(random.Random(2).choices("⠉⣿⠒⡇ ", k=WIDTH + 30))


def plot(draw):
    """A line of dots that goes on: all of it some cells to the left, beside what stands still."""
    at, style = draw.randrange(30), draw.choice(STYLES[:2])
    return painted((draw.randrange(2), 0), [("  10 │", ""), (DOTS[at : at + WIDTH - 10], style), ("│", "31")])


def frames_of(draw):
    """Random frames; drawn by a seed, because drawing each letter by itself takes ten times as long."""
    kinds = draw.choice([[span, span, dialog, scroll, plot], [plot]])
    for _ in range(draw.randrange(7)):
        yield "".join(draw.choice(kinds)(draw) for _ in range(draw.randint(1, 5)))


SEEDS = st.integers(0, 1 << 32).map(random.Random)


class Line:
    """What Textual writes, followed, and sent as differences to an emulated terminal."""

    def __init__(self, *, erases=True, deletes=True):
        self.styles = Styles()
        self.through = []
        self.follower = Follower(WIDTH, HEIGHT, self.styles, self.through.append)
        self.sent = Grid(WIDTH, HEIGHT)
        self.terminal = Emulator(WIDTH, HEIGHT)
        self.able = {"erases": erases, "deletes": deletes}

    def paint(self, frame):
        self.follower.feed(frame)

    def send(self, budget=NO_BUDGET, first=0):
        rows = [*range(first, HEIGHT), *range(first)]
        text, waits = difference(self.sent, self.follower.grid, rows, self.styles, budget, **self.able)
        self.terminal.feed(text)
        return text, waits

    def forget(self):
        self.sent = Grid(WIDTH, HEIGHT, UNKNOWN)


@given(SEEDS, st.booleans(), st.booleans())
@settings(max_examples=100, deadline=None)
def test_the_picture_after_differences_is_that_of_full_repaints(draw, erases, deletes):
    line, repainted = Line(erases=erases, deletes=deletes), Emulator(WIDTH, HEIGHT)
    for frame in frames_of(draw):
        line.paint(frame)
        repainted.feed(frame)
        if draw.random() < 0.5:  # frames merge, and are cut
            line.send(draw.randint(1, 60), draw.randrange(HEIGHT))
    line.send()
    assert line.terminal.seen() == repainted.seen()


@pytest.mark.parametrize("column", [WIDTH - 2, WIDTH - 1, WIDTH, WIDTH + 3])
@pytest.mark.parametrize("words", ["ab", "漢", "a漢", "漢字", "ab漢c", "漢e\u0301"])
@pytest.mark.parametrize("before", ["", "漢" * (WIDTH // 2), "a" + "漢" * (WIDTH // 2)])
def test_a_wide_character_has_no_half_at_the_end_of_a_line(column, words, before):
    grid = Grid(WIDTH, 1)
    grid.put(0, 0, before[: (WIDTH - 1 if before[:1] == "a" else WIDTH) // 2 + (before[:1] == "a")], DEFAULT)
    grid.put(0, column, words, DEFAULT)
    chars = grid.chars[0]
    assert len(chars) == len(grid.styles[0]) == WIDTH
    for place, char in enumerate(chars):
        followed = chars[place + 1] if place + 1 < WIDTH else " "
        assert (cell_len(char) == 2) == (followed == TAIL), (place, char, followed)


@pytest.mark.parametrize(
    ("column", "words", "end"),
    [(2, "ab", "  ab"), (2, "abcd", "  ad"), (4, "ab", "   b"), (9, "a", "   a"), (3, "é", "   é")],
)
def test_what_is_written_beyond_the_end_of_a_line_stays_in_its_last_cell(column, words, end):
    grid = Grid(4, 1)
    grid.put(0, column, words, DEFAULT)
    assert grid.chars[0] == list(end)


def test_a_mark_without_a_width_is_laid_over_the_character_before_it_or_over_none():
    grid = Grid(4, 1)
    grid.put(0, 0, "\u0301", DEFAULT)
    grid.put(0, 0, "e漢", DEFAULT)
    grid.put(0, 1, "\u0301", DEFAULT)
    grid.put(0, 3, "\u0302", DEFAULT)
    assert grid.chars[0] == ["e\u0301", "漢\u0302", TAIL, " "]


@pytest.mark.parametrize(
    ("size", "rows"),
    [((6, 3), ["ab漢  ", "      ", "      "]), ((4, 1), ["ab漢"]), ((3, 1), ["ab "]), ((2, 2), ["ab", "  "])],
)
def test_of_a_screen_of_another_size_what_has_room_stays(size, rows):
    grid = Grid(4, 1)
    grid.put(0, 0, "ab漢", DEFAULT)
    assert ["".join(row) for row in grid.resized(*size).chars] == rows


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_after_the_terminal_s_content_was_lost_it_is_all_sent_again(draw):
    line, repainted = Line(), Emulator(WIDTH, HEIGHT)
    for frame in frames_of(draw):
        line.paint(frame)
        repainted.feed(frame)
        line.send()
    line.terminal.feed("".join(painted((row, 0), [("x漢" * 8, "7;31")]) for row in range(HEIGHT)) + "\x1b[0m")
    line.forget()
    line.send()
    assert line.terminal.seen() == repainted.seen()


def sent(*frames, at=(0, 0), **able):
    """Send pieces of a line, one frame after the other; returns what was sent of the last, and what stands there."""
    line = Line(**able)
    for frame in frames:
        line.paint(painted(at, frame))
        text, _ = line.send()
    assert line.send() == ("", None)
    return text, line.terminal.text.splitlines()[at[0]]


CURVE = "".join(random.Random(1).choices("⠉⣿⠒⡇", k=WIDTH))
ALIKE = [("abc", "1;31"), ("漢字", "4")]
NUMBERS = [[("value ", "2"), (number, "38;2;1;2;3")] for number in ("12.345", "12.346")]
SHORT, LONG, WHOLE = ([(" " * count + "a", "44")] for count in (LONG_BLANK - 1, LONG_BLANK, WIDTH))


@pytest.mark.parametrize(
    ("frames", "able", "words"),
    [
        ([ALIKE, ALIKE], {}, ""),
        (NUMBERS, {}, "\x1b[1;12H\x1b[38;2;1;2;3m6\x1b[m"),  # only its digit
        ([[("ab", "31"), (" ", "32"), ("cd", "31")]], {}, "\x1b[1;1H\x1b[31mab cd\x1b[m"),  # a style is said once
        ([SHORT], {}, f"\x1b[1;1H\x1b[44m{' ' * (LONG_BLANK - 1)}a\x1b[m"),
        ([LONG], {}, "\x1b[1;1H\x1b[44m\x1b[12X\x1b[12Ca\x1b[m"),
        ([WHOLE], {}, f"\x1b[1;1H\x1b[44m\x1b[{WIDTH}X\x1b[m"),
        ([WHOLE], {"erases": False}, f"\x1b[1;1H\x1b[44m{' ' * WIDTH}\x1b[m"),
        ([[(CURVE, "")], [(CURVE[3:] + "⠉⠉⠉", "")]], {"deletes": False}, f"\x1b[1;1H{CURVE[3:]}⠉⠉⠉"),
        ([[("🙂b", "")]], {}, "\x1b[1;1H  \x1b[1G🙂\x1b[3Gb"),  # of doubtful width: the place of the next
    ],
)
def test_what_is_sent_is_what_changed_as_short_as_the_terminal_takes_it(frames, able, words):
    assert sent(*frames, **able)[0] == words


def test_after_blanks_were_erased_what_changed_behind_them_is_at_its_place():
    lines = (each * 20 + "same" * 3 + each * 20 for each in "x ")
    assert sent(*([(line, "44")] for line in lines))[1] == " " * 20 + "same" * 3


@pytest.mark.parametrize(("by", "before"), [(3, "1 │"), (1, "1 │"), (3, ""), (12, "1 │")])
def test_of_a_curve_that_went_on_only_what_is_new_is_sent(by, before):
    room = WIDTH - len(before) - 7
    curve = CURVE + CURVE[::-1]
    text, stands = sent(*([(f"{before}{curve[at : room + at]}│", "")] for at in (0, by)))
    assert text.startswith(f"\x1b[1;{len(before) + 1}H\x1b[{by}P\x1b[{room - by}C{curve[room : room + by]}│")
    assert stands == f"{before}{curve[by : room + by]}│"


@pytest.mark.parametrize(
    ("shown", "wanted"),
    [(CURVE, CURVE[::-1]), *((f"{one}{CURVE[:60]}", f"{other}{CURVE[3:63]}") for one, other in (
        ("漢", "a"), ("a", "漢"), ("漢", "漢"), ("🙂", "🙂"), ("∑", "a"), ("a", "∑"),
    ))],
)  # fmt: skip
def test_a_line_of_which_nothing_is_as_it_was_or_with_a_character_of_another_width_is_not_moved(shown, wanted):
    text, stands = sent([(shown, "")], [(wanted, "")])
    assert "P" not in text
    assert stands.startswith(wanted)


def test_what_doesn_t_fit_waits_and_comes_next():
    line = Line()
    line.paint("".join(painted((row, 0), [("x" * WIDTH, "")]) for row in range(HEIGHT)))
    text, waits = line.send(budget=2 * WIDTH)
    assert text.count("x") == 2 * WIDTH
    assert waits == 2
    line.send(first=2)
    assert line.terminal.text == "\n".join(["x" * WIDTH] * HEIGHT)


@pytest.mark.parametrize("piece", range(1, 12))
def test_a_sequence_that_comes_in_two_writes_is_one(piece):
    line = Line()
    frame = "\x1b[1;1H\x1b[1;31mab\x1b[0m"
    line.paint(frame[:piece])
    line.paint(frame[piece:])
    line.send()
    assert line.terminal.cells[0][0] == ("a", 31, "", frozenset({1}))


@given(st.lists(st.sampled_from(STYLES), min_size=2, max_size=12))
def test_the_way_from_one_style_to_another_leads_there(codes):
    styles, terminal, at = Styles(), Emulator(1, 1), DEFAULT
    for each in codes:
        style = styles.after(DEFAULT, each)
        terminal.feed(styles.way(at, style))
        expected = Emulator(1, 1)
        expected.feed(f"\x1b[{each}m")
        assert terminal.style == expected.style
        at = style


# ------------------------------------------------------------------------------------------- what Textual writes


def followed(words, width=WIDTH, height=HEIGHT):
    through = []
    follower = Follower(width, height, Styles(), lambda one: through.append((one.text, one.forget)))
    follower.feed(words)
    return follower, through


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("\n", (3, 0)), ("\r", (2, 0)), ("\b", (2, 8)), ("\r\b", (2, 0)), ("\t", (2, 16)), ("\r\t\t", (2, 16)),
        ("\x1b[A", (1, 9)), ("\x1b[2B", (4, 9)), ("\x1b[C", (2, 10)), ("\x1b[3D", (2, 6)), ("\x1b[E", (3, 0)),
        ("\x1b[2F", (0, 0)), ("\x1b[5G", (2, 4)), ("\x1b[5`", (2, 4)), ("\x1b[5d", (4, 9)), ("\x1b[H", (0, 0)),
        ("\x1b[4H", (3, 0)), ("\x1b[4;7f", (3, 6)), ("\x1b[;7H", (0, 6)), ("\x1b[0;0H", (0, 0)),
        ("\x1b[99;99H", (HEIGHT - 1, WIDTH - 1)), ("\x1b[9A", (0, 9)), ("\x1b[99D", (2, 0)), ("ab\x1b[D", (2, 10)),
    ],
)  # fmt: skip
def test_the_cursor_is_followed(words, place):
    follower, through = followed(f"\x1b[3;10H{words}")
    assert ((follower.row, follower.column), through) == (place, [])


@pytest.mark.parametrize(
    ("words", "rows"),
    [
        ("\x1b[K", "abcde fg    klmno"), ("\x1b[1K", "abcde    ij klmno"), ("\x1b[2K", "abcde       klmno"),
        ("\x1b[J", "abcde fg         "), ("\x1b[1J", "         ij klmno"), ("\x1b[2J", "                 "),
        ("\x1b[X", "abcde fg ij klmno"), ("\x1b[2X", "abcde fg  j klmno"), ("\x1b[9X", "abcde fg    klmno"),
    ],
)  # fmt: skip
def test_what_is_erased_is_blank(words, rows):
    follower, through = followed(f"abcde\x1b[2Hfghij\x1b[3Hklmno\x1b[2;3H{words}", 5, 3)
    assert (" ".join("".join(row) for row in follower.grid.chars), through) == (rows, [])


@pytest.mark.parametrize(
    ("words", "through"),
    [
        ("\a", [("\a", False)]), ("\x1b[?25l", [("\x1b[?25l", False)]), ("\x1b[>4m", [("\x1b[>4m", False)]),
        ("\x1b]2;title\a", [("\x1b]2;title\a", False)]), ("\x1b]8;;http://x\a", []), ("\x1b=", [("\x1b=", False)]),
        ("\x1bM", [("\x1bM", True)]), ("\x1b[3L", [("\x1b[3L", True)]), ("\x1b[3K", [("\x1b[3K", True)]),
        ("\x1b[3J", [("\x1b[3J", True)]), ("\x1b[2 q", [("\x1b[2 q", False)]), ("\x1b[22;2t", [("\x1b[22;2t", False)]),
        *((one, [(one, False)]) for one in ("\x1b[?1003h", "\x1b]52;c;aGk=\x07", "\x1b]0;silo\x1b\\", "\x1b[>1u")),
        *((one, [(one, True)]) for one in ("\x1b[2L", "\x1b[3;5r", "\x1b[4S", "\x1bD", "\x1bc")),
    ],
)  # fmt: skip
def test_what_concerns_no_cell_is_handed_on_and_what_may_is_told(words, through):
    assert followed(f"a{words}b")[1] == through
    assert followed(f"a{words}b")[0].column == 2


def test_a_sequence_that_comes_in_pieces_is_followed_as_one():
    follower, _ = followed("a\x1b[3")
    follower.feed(";5Hb")
    assert (follower.row, follower.column, follower.grid.chars[2][4]) == (2, 5, "b")


def test_rows_that_were_written_to_last_are_known_and_all_are_after_a_change_of_size():
    follower, _ = followed("\x1b[3Ha\x1b[6;9Hb")
    follower.feed("\x1b[2Hc")
    assert follower.touched == [0, 2, 1, 0, 0, 1, 0]
    follower.resize(WIDTH, HEIGHT)
    assert follower.touched == [0, 2, 1, 0, 0, 1, 0]
    follower.feed("\x1b[7;70H")
    follower.resize(20, 4)
    assert (follower.touched, follower.row, follower.column) == ([3] * 4, 3, 19)
    assert (follower.grid.width, follower.grid.chars[2][0], len(follower.grid.chars)) == (20, "a", 4)


@pytest.mark.parametrize(("words", "known"), [("a", False), ("\x1b[?2026hab", True), ("\x1b[?2026l", False)])
def test_frames_that_are_bracketed_are_noticed(words, known):
    follower, through = followed(words)
    assert (follower.synchronised, through) == (known, [])
