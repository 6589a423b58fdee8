"""One language of settings: what can be typed, what it means, and what is said of the rest."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import DEFAULT_OPTIONS, MAX_BUFFER_SIZE, MAX_DIVIDER, Action, BufferType, ElementOptions
from silo.errors import ElementError
from silo.settings.options import OPTIONS, option_problems, raw_problems
from silo.settings.typed import apply_settings, completions, help_rows, read_options, read_settings

options = st.builds(
    ElementOptions,
    st.booleans(),
    st.integers(1, MAX_DIVIDER),
    st.sampled_from(Action),
    st.sampled_from(BufferType),
    st.integers(1, MAX_BUFFER_SIZE),
)


def made(*words: str, now: ElementOptions = DEFAULT_OPTIONS, frequency_hz: float = 400.0) -> ElementOptions:
    return apply_settings(read_settings(words), [("/x", now)], frequency_hz)[0]


def complaint(*words: str, now: ElementOptions = DEFAULT_OPTIONS) -> str:
    with pytest.raises(ElementError) as error:
        made(*words, now=now)
    return str(error.value)


@given(options, options)
def test_options_that_are_written_as_words_read_back(wanted: ElementOptions, now: ElementOptions) -> None:
    values = [(option, getattr(wanted, option.name)) for option in OPTIONS]
    words = [f"{option.keys[0]}={option.word_of(value).word if option.words else value}" for option, value in values]
    assert made(*words, now=now) == wanted


@given(st.text(max_size=12), st.sampled_from([key for option in OPTIONS for key in option.keys]))
def test_whatever_is_typed_is_a_valid_option_or_an_error_in_words(text: str, key: str) -> None:
    try:
        new = made(f"{key}={text}")
    except ElementError as error:
        assert str(error).endswith("; nothing was changed")
    else:
        assert option_problems("/x", new) == []


@given(options)
def test_options_that_are_in_range_have_no_problem_on_the_wire(given_options: ElementOptions) -> None:
    plain = {option.name: getattr(given_options, option.name) for option in OPTIONS}
    raw = {name: int(value) if isinstance(value, Action | BufferType) else value for name, value in plain.items()}
    assert raw_problems("/x", raw) == option_problems("/x", given_options) == []


def test_every_value_of_an_option_with_few_has_words() -> None:
    for option, kind in (("action", Action), ("buffer", BufferType)):
        words = next(each.words for each in OPTIONS if each.name == option)
        assert sorted(word.value for word in words) == sorted(kind)


def test_no_spelling_stands_for_two_values() -> None:
    for option in OPTIONS:
        spellings = [spelling for word in option.words for spelling in word.spellings]
        assert len(spellings) == len(set(spellings))


def test_no_key_stands_for_two_options() -> None:
    keys = [key for option in OPTIONS for key in option.keys]
    assert len(keys) == len(set(keys))


def test_the_options_stand_in_the_order_of_the_type() -> None:
    assert tuple(option.name for option in OPTIONS) == ElementOptions.__struct_fields__


def test_every_example_of_the_help_can_be_typed() -> None:
    for option in OPTIONS:
        for example in option.examples or [word.word for word in option.words]:
            made(f"{option.keys[0]}={example}", now=ElementOptions(divider=8, size=8))
    for example, _ in help_rows():
        made(*example.split(", ")[:1])


def test_what_is_completed_can_be_typed() -> None:
    for start in ("", "b", "buffer=", "action=p", "on="):
        for whole in completions(start):
            assert whole.startswith(start)
            if not whole.endswith("="):
                made(whole)


def test_a_rate_above_the_loggers_is_no_divider() -> None:
    assert complaint("divider=1000Hz") == (
        "element '/x': divider must be a whole number from 1 to 2147483647, got 0.4 (1000Hz: at most 400 Hz); "
        "nothing was changed"
    )


def test_a_size_of_no_time_is_no_size() -> None:
    assert "got 0 (0s)" in complaint("size=0s")


def test_a_field_that_is_given_twice_is_refused() -> None:
    assert complaint("div=5", "divider=6") == "divider is given twice; nothing was changed"


def test_every_element_and_field_that_would_be_out_of_range_is_named() -> None:
    rows = [("/a", ElementOptions(size=5)), ("/b", ElementOptions(size=50))]
    with pytest.raises(ElementError) as error:
        apply_settings(read_settings(["size=-10", "div=0"]), rows, 100.0)
    assert [part.split(" must")[0] for part in str(error.value).split("; ")] == [
        "element '/a': divider",
        "element '/a': size",
        "element '/b': divider",
        "nothing was changed",
    ]


def test_a_message_about_many_elements_stays_short() -> None:
    rows = [(f"/e{place}", ElementOptions()) for place in range(500)]
    with pytest.raises(ElementError, match=r"; and 497 more; nothing was changed$"):
        apply_settings(read_settings(["div=0"]), rows, 100.0)


def test_numbers_of_numpy_are_numbers() -> None:
    import numpy as np

    (new,) = apply_settings(read_options({"divider": np.int64(3)}), [("/x", ElementOptions())], 100.0)
    assert type(new.divider) is int
    assert new.divider == 3
