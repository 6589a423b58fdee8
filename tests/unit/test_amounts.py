"""Times as they are told, and amounts as they are written: one grammar for every door."""

import pytest

from silo.core.quantities.reading import read_keep, read_seconds, read_split
from silo.core.quantities.writing import duration, ordinal, share_words, there_are, whole_duration
from silo.errors import ElementError
from silo.journal.holdings import Holdings
from silo.judging.checks import seconds
from silo.settings.typed import read_settings


@pytest.fixture(autouse=True)
def _nothing_was_told(monkeypatch):
    monkeypatch.setattr("silo.core.quantities.reading._told", set())


@pytest.mark.parametrize(
    ("some", "words"),
    [
        (20_000, "all the time"), (20_001, "all the time"), (19_999, "for 99.9 %"), (2_400, "for 12 %"),
        (2, "for 0.01 %"), (1, "for less than 0.01 %"), (0, "for less than 0.01 %"),
    ],
)  # fmt: skip
def test_a_share_is_told_in_words(some, words):
    assert share_words(some, 20_000) == words


DOORS = {
    "size": lambda text: read_settings([f"size={text}"])["size"].amount,
    "split": lambda text: read_split(text)[1],
    "for": lambda text: read_seconds("--for", text),
    "pre": lambda text: seconds("pre", text, 1e6),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10s", 10),
        ("10 sec", 10),
        ("1500ms", 1.5),
        ("10min", 600),
        ("2h", 7200),
        ("1d", 86400),
        ("1.5e1s", 15),
        ("2H", 7200),
    ],
)
def test_a_time_is_the_same_behind_every_door(door, text, expected):
    assert DOORS[door](text) == pytest.approx(expected)


@pytest.mark.parametrize("door", ["for", "pre"])
def test_a_bare_m_is_refused_with_both_meanings_where_it_was_never_taken(door):
    with pytest.raises(ElementError, match=r"a bare m is minutes to some, a million to others: 10 minutes are '10min'"):
        DOORS[door]("10m")


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda: read_settings(["size=10m"])["size"] == 10_000_000, "write 10M, or 10min"),
        (lambda: read_split("10m") == (10_000_000, 0.0), "write 10MB, or 10min"),
        (lambda: read_keep("10m") == 10_000_000, "write 10MB, or 10min"),
    ],
)
def test_a_bare_m_is_told_once_with_both_meanings_where_it_was_taken(read, words, caplog):
    assert read()
    assert read()
    (record,) = caplog.records
    assert words in record.getMessage()
    assert "the next release will refuse it" in record.getMessage()


def test_a_large_m_is_a_million_and_nothing_is_told(caplog):
    assert read_settings(["size=10M"])["size"] == 10_000_000
    assert read_split("10M") == (10_000_000, 0.0)
    assert not caplog.records


@pytest.mark.parametrize(
    ("value", "words"), [(0, "there are none"), (1, "there is 1 element"), (12345, "there are 12 345 elements")]
)
def test_how_many_there_are_is_told_as_one_would(value, words):
    assert there_are(value, "element") == words


def test_ordinals_end_as_they_are_said():
    numbers = (1, 2, 3, 4, 11, 12, 13, 21, 102, 111, 400)
    assert [ordinal(each) for each in numbers] == [
        "1st",
        "2nd",
        "3rd",
        "4th",
        "11th",
        "12th",
        "13th",
        "21st",
        "102nd",
        "111th",
        "400th",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1MB", (10**6, 0.0)), ("1000TB", (10**15, 0.0)), ("1s", (0, 1.0)), ("31d", (0, 31 * 86400.0)), ("", (0, 0.0))],
)
def test_the_least_and_the_most_of_a_part_are_taken(text, expected):
    assert read_split(text) == expected


@pytest.mark.parametrize("text", ["0.99MB", "1001TB", "999ms", "31.01d"])
def test_what_is_beyond_them_is_refused(text):
    with pytest.raises(ElementError, match="a size from 1MB or a time from 1s to 31d"):
        read_split(text)


@pytest.mark.parametrize("text", ["10x", "10parsec", "s", "", "1e", "--3", "10 m m", "٣s"])
def test_other_words_are_refused_by_all(text):
    for door in DOORS.values():
        with pytest.raises((ElementError, AttributeError)):
            door(text or "x")


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.0, "0 s"), (0.19, "0.19 s"), (119.0, "119 s"), (1063.0, "17.7 min"), (12_600.0, "3.5 h"), (1e6, "11.6 days")],
)
def test_a_time_is_told_in_its_natural_unit(seconds, told):
    assert duration(seconds) == told


def test_the_span_of_a_long_recording_is_told_in_minutes():
    assert "over 17.7 min, of" in Holdings(5, 1, 5, 1063.0).text


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.9, "0 s"), (14.7, "14 s"), (119.9, "119 s"), (120.0, "2 min"), (7199.0, "119 min"), (7200.0, "2 h")],
)
def test_a_time_that_goes_on_is_told_in_whole_units(seconds, told):
    assert whole_duration(seconds) == told


@pytest.mark.parametrize("text", ["0", " 0 ", "0.0", "0s", "0ms"])
def test_no_time_needs_no_unit(text):
    assert seconds("pre", text, 10.0) == 0
    with pytest.raises(ElementError, match="must be a time"):
        seconds("pre", "1", 10.0)
