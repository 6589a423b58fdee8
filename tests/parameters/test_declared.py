"""Parameters as a program has them: declared, read like an array, set by itself."""

import enum
import threading

import numpy as np
import pytest

import silo
from silo.errors import ElementError


class Gait(enum.Enum):
    STAND = 0
    TROT = 1


def test_a_number_is_read_as_a_value_as_an_array_and_in_expressions(new_logger):
    kp = new_logger().parameter("kp", 40.0, min=0, max=200, unit="Nm/rad", group="legs")
    assert (kp.value, kp[...], float(kp), kp * 2, 1 - kp) == (40.0, 40.0, 40.0, 80.0, -39.0)
    assert np.dot(kp, [1.0, 2.0]).tolist() == [40.0, 80.0]
    assert f"{kp:.1f}" == "40.0"


@pytest.mark.parametrize(
    ("default", "other", "words"),
    [
        (1.5, 2.0, 1), (3, 4, 1), (True, False, 1), (Gait.STAND, Gait.TROT, 1), ("walk", "trot", 8),
        ([1.0, 2.0], [3.0, 4.0], 2), ([True] * 9, [False] * 9, 2),
    ],
)  # fmt: skip
def test_every_kind_of_value_is_set_and_read_back_and_takes_the_words_that_it_needs(new_logger, default, other, words):
    logger = new_logger()
    one = logger.parameter("one", default)
    assert one.info.words == words
    one.value = other
    assert np.array_equal(one.value, other)
    logger.parameters.reset()
    assert np.array_equal(one.value, default)


@pytest.mark.parametrize(
    ("ends", "fits"),
    [({"min": 0, "max": 1234567}, "whole numbers 0 to 1234567"),
     ({"min": 1 - 2**60, "max": 2.0**53}, f"whole numbers {1 - 2**60} to {2**53}"),
     ({"min": 0, "max": 10}, "whole numbers 0 to 10"), ({"min": 0}, "whole numbers from 0"),
     ({"max": 10}, "whole numbers up to 10"), ({}, "a whole number")],
)  # fmt: skip
def test_a_number_that_is_not_whole_is_told_so(new_logger, ends, fits):
    made = new_logger().parameter("n", 2, **ends)
    with pytest.raises(ElementError, match=f"2.5 doesn't fit, it takes {fits};"):
        made.value = 2.5


def test_a_number_that_64_bits_do_not_hold_is_told_so(new_logger):
    logger = new_logger()
    words = r"it takes a whole number of 64 bits with a sign \(-2\^63 to 2\^63 - 1\);"
    with pytest.raises(ElementError, match=words):
        logger.parameter("seed", np.uint64(2**63 + 5))
    made = logger.parameter("n", 2**63 - 1)
    for value in (2**63, -(2**63) - 1):
        with pytest.raises(ElementError, match=words):
            made.value = value
    with pytest.raises(ElementError, match="takes up to 8 bytes of text without line breaks"):
        logger.parameter("word", "abc", string_bytes=8).value = "a\0b"


def test_words_are_choices_too(new_logger):
    mode = new_logger().parameter("mode", "walk", choices=["walk", "trot"])
    mode.value = "trot"
    assert mode.value == "trot"
    with pytest.raises(ElementError, match="'fly' doesn't fit, it takes one of walk, trot"):
        mode.value = "fly"


def test_the_members_of_an_enumeration_are_the_choices_of_a_word(new_logger):
    gait = new_logger().parameter("gait", "STAND", choices=Gait)
    assert gait.info.choices == ("STAND", "TROT")
    gait.value = "TROT"
    assert gait.value is Gait.TROT


@pytest.mark.parametrize("choices", ["walk", ["walk", ""], ["walk", 3], [], ["walk", "trot", "walk"], 7, {"walk"}])
def test_choices_that_are_no_different_words_are_refused(new_logger, choices):
    logger = new_logger()
    with pytest.raises(ElementError, match="choices are an enumeration, or different words"):
        logger.parameter("mode", "walk", choices=choices)
    assert "mode" not in logger.parameters


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1, 201, 0.3, True, "40", None, [40.0], 10**400])
def test_what_does_not_fit_is_refused_in_words_that_name_all_and_nothing_changes(new_logger, value):
    kp = new_logger().parameter("kp", 40.0, min=0, max=200, step=0.5, unit="Nm/rad")
    with pytest.raises(ElementError, match=r"'/log/kp': .* doesn't fit, it takes 0 to 200 in steps of 0.5 Nm/rad"):
        kp.value = value
    assert kp.value == 40.0


def test_a_number_of_more_steps_than_any_float_counts_is_refused(new_logger):
    with pytest.raises(ElementError, match=r"1e\+300 doesn't fit, it takes any number in steps of 1e-09"):
        new_logger().parameter("fine", 0.0, step=1e-9).value = 1e300


@pytest.mark.parametrize(("value", "near"), [(0.3, "0 or 0.5"), (40.9, "40.5 or 41"), (199.9, "199.5 or 200")])
def test_between_two_steps_those_beside_it_are_told(new_logger, value, near):
    kp = new_logger().parameter("kp", 40.0, min=0, max=200, step=0.5, unit="Nm/rad")
    with pytest.raises(ElementError, match=f"in steps of 0.5 Nm/rad, as {near}; nothing was changed"):
        kp.value = value


def test_many_are_set_all_or_none(new_logger):
    logger = new_logger()
    kp, kd = logger.parameter("kp", 40.0, max=50), logger.parameter("kd", 1.0)
    with pytest.raises(ElementError):
        logger.parameters.set({"kd": 2.0, "kp": 51.0})
    assert (kp.value, kd.value) == (40.0, 1.0)
    logger.parameters.set({"kd": 2.0, "kp": 50.0})
    assert (kp.value, kd.value) == (50.0, 2.0)


def test_a_check_refuses_in_its_own_words(new_logger):
    def above_kd(value, group):
        if value < group["kd"]:
            raise ValueError(f"kp must be above kd ({group['kd']})")

    logger = new_logger()
    logger.parameter("kp", 40.0, check=above_kd)
    logger.parameter("kd", 1.0)
    with pytest.raises(ElementError, match=r"'/log/kp': kp must be above kd \(1.0\); nothing was changed"):
        logger.parameters.set({"kp": 0.5})
    with pytest.raises(ElementError, match=r"kp must be above kd \(50.0\)"):  # its partner is asked too
        logger.parameters.set({"kd": 50.0})
    logger.parameters.set({"kp": 60.0, "kd": 50.0})


@pytest.mark.parametrize(
    ("check", "wrong"),
    [(lambda kp, most=50: kp <= most, 50.5), (lambda kp, *, most=50: kp <= most, 50.5), (bool, 0.0)],
)
def test_a_check_that_takes_one_value_gets_that_alone(new_logger, check, wrong):
    kp = new_logger().parameter("kp", 40.0, check=check)
    kp.value = 50.0
    with pytest.raises(ElementError, match="its check refuses it"):
        kp.value = wrong
    assert kp.value == 50.0


class Speechless(Exception):
    def __str__(self):
        raise RuntimeError


def ends(error):
    def check(value):
        raise error

    return check


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (lambda v: np.all(np.abs(v) < 10), "its check refuses it"),
        (lambda v: bool(np.all(np.abs(v) < 10)), "its check refuses it"),
        (lambda v: np.abs(v) < 10, r"its check returned array\(\[False, +True\]\); it returns True"),
        (lambda v: 0 if max(v) > 10 else None, "its check returned 0; it returns True, False, or in words why not"),
        (lambda v: "too much" if max(v) > 10 else "", "too much|its check refuses it"),
    ],
)
def test_what_a_check_of_numpy_says_counts_and_what_nobody_understands_is_no_yes(new_logger, check, words):
    gains = new_logger().parameter("gains", [1.0, 2.0], check=check)
    with pytest.raises(ElementError, match=words):
        gains.value = [1000.0, 2.0]
    assert gains.value.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("error", "words"),
    [(SystemExit(3), "its check ends by SystemExit"), (KeyboardInterrupt(), "its check ends by KeyboardInterrupt"),
     (Speechless(), "Speechless"), (ValueError("not now\n"), "not now; nothing")],
)  # fmt: skip
def test_no_check_ends_the_thread_that_hears_clients(new_logger, error, words):
    logger = new_logger()
    logger.parameter("kp", 1.0, check=ends(error))
    told = []

    def hear():
        with pytest.raises(ElementError, match=words) as caught:
            logger.parameters.request({"kp": 2.0}, "alice", "shell", "n", remote=False)
        told.append(caught)

    thread = threading.Thread(target=hear)
    thread.start()
    thread.join()
    assert told


def test_nobody_writes_past_the_checks(new_logger):
    gains = new_logger().parameter("gains", [1.0, 2.0], max=5)
    with pytest.raises(ValueError, match="read-only"):
        gains[...][0] = 9
    with pytest.raises(TypeError, match="checked and recorded"):
        np.add(gains, 1, out=gains)
    gains[1] = 4.0
    assert gains.value.tolist() == [1.0, 4.0]


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ("parameter '/log/kp': min 2 is above max 1", {"min": 2, "max": 1}),
        ("parameter '/log/kp': step must be above 0, got 0", {"step": 0}),
        ("parameter '/log/kp': min must be a finite number, got 'low'", {"min": "low"}),
        ("parameter '/log/kp': 40.0 doesn't fit, it takes up to 30; nothing was changed", {"max": 30}),
        ("parameter 'kp': writable is True, False or 'anywhere', got 'all'", {"writable": "all"}),
    ],
)  # fmt: skip
def test_a_declaration_that_makes_no_sense_adds_nothing(new_logger, words, options):
    logger = new_logger()
    with pytest.raises(ElementError) as caught:
        logger.parameter("kp", 40.0, **options)
    assert str(caught.value) == words
    logger.parameter("kp", 40.0)


def test_bounds_are_the_same_for_all_values(new_logger):
    with pytest.raises(ElementError, match=r"finite number, the same for all its values, got \[5, 5, 5\]"):
        new_logger().parameter("a", [1, 2, 3], min=0, max=[5, 5, 5])


def test_it_is_an_element_with_ten_samples_a_second(new_logger):
    logger = new_logger(frequency=100)
    logger.kp = logger.parameter("kp", 40.0, group="legs")
    logger.update()
    assert logger["legs/kp"].info.options.divider == 10


def test_without_parameters_the_segment_has_no_room_for_changes(new_logger):
    logger = new_logger()
    logger.array("q", 3)
    logger.start()
    assert logger._present.run.segment.schema.parameter_changes == -1


def test_a_null_logger_has_parameters_that_its_program_sets():
    kp = silo.NullLogger().parameter("kp", 40.0, max=50)
    kp.value = 45.0
    assert kp.value == 45.0
