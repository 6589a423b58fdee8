"""Episodes: what is marked, what becomes of it in the run, in files and in what is read again."""

import subprocess
import sys

import numpy as np
import pytest

import silo
from silo.core.elements import MARKER, LoggedEvent
from silo.core.episodes.words import MOST_BYTES, begin_marks, end_mark, found_episodes, next_marks, said_by
from silo.errors import ElementError, StateError

HELD = np.zeros(2)


def told(*lines, who="robot"):
    """Marks at the ticks 10, 20, 30 ..."""
    return [LoggedEvent(MARKER, text, tick=10 * place, who=who) for place, text in enumerate(lines, 1)]


def logged(log, ticks):
    for _ in range(ticks):
        log.collect()


@pytest.fixture
def log(new_logger):
    made = new_logger()
    made.add(HELD, "x")
    made.start()
    return made


def saved(log, tmp_path, kind="silo"):
    return silo.open_log(log.save(kind, folder=tmp_path).path)


@pytest.mark.parametrize("kind", ["silo", "bag", "csv"])
def test_every_format_tells_of_episodes(log, tmp_path, kind):
    logged(log, 3)
    with log.episode("pick up", object="cup", speed=0.5, tries=2, wet=True) as episode:
        logged(log, 4)
        episode.success = True
    logged(log, 2)
    read = saved(log, tmp_path, kind)
    (one,) = read.episodes
    assert (one.name, one.first, one.last, one.verdict, one.whole, one.success) == ("pick up", 3, 6, "good", True, True)
    assert one.about == {"object": "cup", "speed": 0.5, "tries": 2, "wet": True}
    assert len(read.clip(one).time_ns) == 4


def test_an_exception_makes_it_no_success_and_stands_in_its_mark(log, tmp_path):
    logged(log, 1)
    with pytest.raises(KeyError), log.episode("pick", success=True) as episode:
        logged(log, 1)
        {}["cup"]
    (one,) = saved(log, tmp_path).episodes
    assert (episode.success, one.success, one.why) == (False, False, "KeyError: 'cup'")


def test_an_episode_without_end_lasts_until_the_newest_tick(log, tmp_path):
    logged(log, 2)
    log.episode("pick").__enter__()
    logged(log, 3)
    (one,) = saved(log, tmp_path).episodes
    assert (one.first, one.last, one.success, one.whole) == (2, 4, None, False)


def test_facts_that_do_not_fit_into_one_mark_take_several(log, tmp_path):
    about = {f"fact_{number}": "é" * 40 for number in range(12)} | {"force": np.float32(0.5), "slip": float("nan")}
    logged(log, 1)
    with log.episode("pick", **about):
        logged(log, 1)
    (one,) = saved(log, tmp_path).episodes
    assert one.about == about | {"force": 0.5, "slip": "nan"}
    assert all(len(text.encode()) <= MOST_BYTES for text in begin_marks("pick", about))


@pytest.mark.parametrize(("name", "about"), [("", {}), ("x" * 61, {}), (7, {}), ("a\nb", {}), ("p", {"a": "x" * 200})])
def test_what_does_not_fit_is_refused_before_anything_is_marked(log, name, about):
    with pytest.raises(ElementError):
        log.episode(name, **about)
    with pytest.raises(ElementError), log.episode("pick") as episode:
        episode.success = "yes"


def test_a_block_is_one_episode_and_needs_a_run(new_logger, caplog):
    log = new_logger()
    block = log.episode("pick")
    with block:
        pass
    assert caplog.messages == ["episode 'pick' stands in no run: call start() first"]
    with pytest.raises(StateError, match="begun already"), block:
        pass
    with silo.NullLogger().episode("pick", object="cup") as episode:
        episode.success = False
    assert len(caplog.messages) == 1


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        (('episode "a" begin', 'episode "a" end good'), [("a", 11, 20, "good", True)]),
        (('episode "a" begin', 'episode "b" begin', 'episode "b" end', 'episode "a" end bad'),
         [("a", 11, 40, "bad", True), ("b", 21, 30, "", True)]),
        (('episode "a" begin', 'episode "a" begin', 'episode "a" end'),
         [("a", 11, 20, "", False), ("a", 21, 30, "", True)]),
        (('episode "a" end good', 'episode "a" redo'), [("a", 0, 10, "redo", False)]),
        (('episode "a" begin', 'episode "a" redo', 'episode "a" end good'), [("a", 11, 30, "redo", True)]),
        (('episode "a" begin', 'episode "a" end bad', 'episode "a" good'), [("a", 11, 20, "good", True)]),
        (('episode "a" good', "episode a begin", "episode 3, seed 0", 'episode "\\x" begin', "push"), []),
        (('episode "a" begin {"x": nonsense', 'episode "a" about {"x":1}'), [("a", 11, 99, "", False)]),
    ],
)  # fmt: skip
def test_marks_tell_of_episodes(lines, found):
    assert [
        (one.name, one.first, one.last, one.verdict, one.whole) for one in found_episodes(told(*lines), 100)
    ] == found


@pytest.mark.parametrize(
    ("lines", "who", "asked", "marks"),
    [
        ((), "robot", ("begin", "pick", {"object": "cup"}), ['episode "pick" begin {"object":"cup"}']),
        (('episode "a" begin',), "robot", ("good",), ['episode "a" good']),
        (('episode "a" begin',), "me@desk silo 1", ("good",), ['episode "a" end good']),
        (('episode "a" begin', 'episode "a" end'), "me@desk silo 1", ("redo",), ['episode "a" redo']),
        (('episode "a" begin', 'episode "b" begin', 'episode "b" end'), "robot", ("end",), ['episode "a" end']),
        (('episode "a" begin', 'episode "b" begin'), "robot", ("bad", "a"), ['episode "a" bad']),
    ],
)
def test_what_a_person_says_is_of_the_newest_that_it_can_be_of(lines, who, asked, marks):
    assert next_marks(told(*lines, who=who), *asked) == marks


@pytest.mark.parametrize("asked", [("good",), ("end",), ("good", "b"), ("fine",)])
def test_nothing_can_be_said_of_an_episode_that_is_not_there(asked):
    there = told('episode "a" begin', 'episode "a" end') if asked != ("good",) else []
    with pytest.raises(ElementError):
        next_marks(there, *asked)


def test_a_name_with_quotes_comes_back():
    name = 'the "cup" \\ ä'
    assert said_by(begin_marks(name, {})[0]).name == said_by(end_mark(name, True)).name == name


PROGRAM = """
import os, signal, sys
import silo

log = silo.Logger("test", folder=sys.argv[1])
x = log.array("x", 2)
log.start()
print(log._present.path, flush=True)
for tick in range(10):
    log.collect()
with log.episode("whole", success=True):
    log.collect()
with log.episode("cut", object="cup"):
    log.collect()
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_episodes_survive_a_kill_in_the_middle_of_one(tmp_path):
    from silo.helper.left_logs import recover

    done = subprocess.run([sys.executable, "-c", PROGRAM, tmp_path], stdout=subprocess.PIPE, text=True, check=False)
    (file,) = recover(done.stdout.strip()).files
    found = [(one.name, one.first, one.last, one.success, one.whole) for one in silo.open_log(file.path).episodes]
    assert found == [("whole", 10, 10, True, True), ("cut", 11, 11, None, False)]
