"""Views, topics, history, saves: what comes out is what was logged."""

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import Edit, ElementOptions, FileType, State
from silo.errors import RefusedError
from silo.live.requests import OpenView, ViewOpened
from silo.rpc.published import EventKind, NotLive
from silo.rpc.refusals import Refused, RefusedWhy

COLUMN_NS = 100_000_000


def options(client: Client, name: str) -> ElementOptions:
    return next(info.options for info in client.table().elements if info.name == name)


# ----------------------------------------------------------------------------------------------------------- views


def frame_at(view, tick: int, until):
    """The first frame that shows this tick."""

    def look():
        frame = view.frame()
        return frame if frame is not None and frame.tick >= tick else None

    return until(look)


def test_view_shows_the_newest_value_of_every_entry(bench, client, until) -> None:
    bench.q[:] = 1.5, np.nan, -0.25
    bench.matrix[:] = [[1, 2], [3, 4]]
    bench.gait[...] = bench.gaits.TROT
    bench.mixed["a"], bench.mixed["n"], bench.word[...] = 2.5, -7, "häé".encode()
    client.start()
    bench.ticks(3)
    with client.view([f"/log/{name}" for name in ("x", "q", "matrix", "gait", "mixed", "word")], rate_hz=30) as view:
        frame = frame_at(view, 3, until)
    assert frame.entries[:4] == ("/log/x", "/log/q_x", "/log/q_y", "/log/q_z")
    np.testing.assert_array_equal(frame.newest[:11], [3, 1.5, np.nan, -0.25, 1, 2, 3, 4, 1, 2.5, -7])
    assert frame.texts == {11: "häé"}
    assert (frame.state, frame.tick, frame.time_ns) == (State.RUNNING, 3, bench.now_ns - bench.tick_ns)


def test_elements_that_are_only_saved_have_values_and_plots_as_all(bench, client, until) -> None:
    client.start()
    bench.kept[...] = 7
    bench.ticks(4)
    with client.view(["/log/kept", "/log/nix", "/log/x"], ["/log/kept"], rate_hz=30) as view:
        frame = frame_at(view, 4, until)
    assert (frame.unpublished, frame.missing, frame.not_live) == (set(), {"/log/nix"}, {1: NotLive.ABSENT})
    assert frame.held.tolist() == [4, 0, 4]
    assert frame.newest.tolist() == [7, 4]
    assert np.nanmax(frame.high) == 7


def test_an_element_that_is_off_is_named_without_value_and_fill_ends_at_the_buffer_size(bench, client, until) -> None:
    short = ElementOptions(action=silo.Action.SAVE_AND_PUBLISH, size=3)
    client.apply([Edit("/log/kept", ElementOptions(enabled=False)), Edit("/log/x", short)], -1)
    client.start()
    bench.ticks(9)
    with client.view(["/log/kept", "/log/x"], rate_hz=30) as view:
        frame = frame_at(view, 9, until)
    assert (frame.unpublished, frame.held.tolist()) == ({"/log/kept"}, [0, 3])
    np.testing.assert_array_equal(frame.newest, [np.nan, 9])


@pytest.mark.parametrize(("kind", "why"), [(silo.BufferType.FIXED, {0: NotLive.FULL}), (silo.BufferType.LOOPING, {})])
def test_a_full_buffer_of_what_is_only_saved_is_not_live_and_says_so(bench, client, until, kind, why) -> None:
    client.apply([Edit("/log/kept", ElementOptions(size=3, buffer=kind))], -1)
    client.start()
    with client.view(["/log/kept", "/log/x"], rate_hz=30) as view:
        bench.ticks(3)
        assert frame_at(view, 3, until).not_live == {}
        bench.ticks(1)
        assert frame_at(view, 4, until).not_live == why


def test_a_buffer_that_is_shorter_than_the_time_between_frames_says_so(bench, client, until) -> None:
    client.apply([Edit("/log/kept", ElementOptions(size=3, buffer=silo.BufferType.LOOPING))], -1)
    client.start()
    with client.view(["/log/kept", "/log/x"], rate_hz=0.5) as view:
        bench.ticks(4)
        assert frame_at(view, 4, until).not_live == {0: NotLive.SHORT}


def test_spike_of_one_sample_shows_in_its_column(bench, client, until) -> None:
    client.start()
    with client.view(plots=["/log/q_y"], rate_hz=30, column_ns=COLUMN_NS) as view:
        bench.ticks(25)
        bench.q[1] = 99
        bench.ticks(1)
        bench.q[1] = 0
        bench.ticks(24)
        low, high = {}, {}

        def look() -> bool:
            frame = view.frame()
            for column in range(frame.low.shape[1] if frame else 0):
                number = frame.first + column
                low[number] = np.fmin(low.get(number, np.nan), frame.low[0, column])
                high[number] = np.fmax(high.get(number, np.nan), frame.high[0, column])
            return frame is not None and frame.tick == 50

        until(look)
    begin = bench.begin_ns // COLUMN_NS
    assert [high[begin + column] for column in range(5)] == [0, 0, 99, 0, 0]
    assert [low[begin + column] for column in range(5)] == [0] * 5


def test_view_goes_on_after_a_restart_and_an_edit(bench, client, until) -> None:
    client.start()
    bench.ticks(2)
    with client.view(["/log/x"], rate_hz=30) as view:
        frame_at(view, 2, until)
        client.stop()
        client.apply([Edit("/log/x", ElementOptions(divider=2, action=silo.Action.PUBLISH))], -1)
        client.start("discard")
        bench.ticks(5)
        assert until(lambda: (frame := view.frame()) and frame.tick == 5 and frame).newest.tolist() == [7]


def test_columns_before_the_layout_is_known_are_kept(bench, client, until) -> None:
    client.start()
    with client.view(plots=["/log/x"], rate_hz=30, column_ns=COLUMN_NS) as view:
        until(view.frame)
        client.restart("discard")
        bench.ticks(10)
        frame = frame_at(view, 10, until)
    assert (frame.low[0].min(), frame.high[0].max()) == (1, 10)


def test_view_ends_when_its_client_closes(bench, client, until) -> None:
    other = Client.connect("bot")
    views = [other.view(["/log/x"]) for _ in range(16)]
    with pytest.raises(RefusedError, match="16 views open"):
        other.view(["/log/x"])
    views[0].close()
    until(lambda: _opens(other))
    other.close()


def _opens(client: Client) -> bool:
    try:
        client.view(["/log/x"]).close()
    except RefusedError:
        return False
    return True


def test_views_of_clients_that_are_gone_make_room_for_others(bench, until) -> None:
    for _ in range(5):
        with Client.connect("bot") as one:
            for _ in range(15):
                until(lambda one=one: _opened(one))  # 75 in all, 64 at most at a time
    with Client.connect("bot") as last:
        until(lambda: _opened(last))


def _opened(client: Client) -> bool:
    try:
        client.view(["/log/x"])
    except RefusedError:
        return False
    return True


def test_status_is_answered_in_time_while_many_views_are_open_of_which_one_wants_an_absurd_rate(
    bench, client, until
) -> None:
    client.start()
    bench.ticks(10)
    names = [info.name for info in bench.logger.elements]
    views = [client.view(names, ["/log/x"], rate_hz=rate_hz) for rate_hz in [30] * 15 + [1e6]]
    for _ in range(20):
        bench.ticks(10)
        client.status()  # is lost if it isn't answered in time
    for view in views:
        assert until(view.frame).missed == 0


def test_view_that_is_not_renewed_ends_with_its_lease(bench, client, until) -> None:
    # straight to the helper: nobody renews these, and no token tells that their client is gone
    for number in range(16):
        client._connection.exchange(OpenView(view=f"stranger-{number}", values=["/log/x"]), 2.0)
    one_more = OpenView(view="stranger-16", values=["/log/x"])
    assert isinstance(client._connection.exchange(one_more, 2.0), Refused)
    until(lambda: isinstance(client._connection.exchange(one_more, 2.0), ViewOpened))


# ---------------------------------------------------------------------------------------------------------- topics


def samples(topic, count: int, until):
    """Batches with at least so many samples, as two arrays."""
    batches = []

    def look() -> bool:
        batches.extend(topic.read())
        return sum(len(batch.time_ns) for batch in batches) >= count

    until(look)
    return np.concatenate([batch.time_ns for batch in batches]), np.concatenate([batch.values for batch in batches])


def warmed(bench, client, element: str, until):
    """A topic that flows, all that was logged so far read."""
    topic = client.topic(element)

    def flows() -> bool:
        bench.ticks(1)
        return bool(topic.read())

    def is_read() -> bool:
        return any(batch.time_ns[-1] == newest_ns for batch in topic.read())

    until(flows)
    while bench.logger.ticks % 5 != 1:  # the last tick is one of every element
        bench.ticks(1)
    bench.ticks(5)
    newest_ns = bench.now_ns - bench.tick_ns
    until(is_read)
    return topic


def test_topic_carries_every_sample_with_its_time_and_as_it_was_logged(bench, client, until) -> None:
    values = {"q": [1, 2, 3], "matrix": [[1, 2], [3, 4]], "gait": 1, "word": b"walk", "mixed": (2.5, -7)}
    for name, value in values.items():
        getattr(bench, name)[...] = value
    client.start()
    topics = {name: warmed(bench, client, f"/log/{name}", until) for name in ("x", "slow", *values)}
    kept = client.topic("/log/kept")  # it isn't published
    for topic in topics.values():
        topic.read()
    first, begin_ns = int(bench.x), bench.now_ns
    bench.ticks(200)
    found = {name: samples(topic, 40 if name == "slow" else 200, until) for name, topic in topics.items()}
    time_ns, numbers = found.pop("x")
    np.testing.assert_array_equal(numbers[-200:], first + 1 + np.arange(200.0))
    np.testing.assert_array_equal(time_ns[-200:], begin_ns + bench.tick_ns * np.arange(200))
    assert set(np.diff(found.pop("slow")[0][-40:])) == {5 * bench.tick_ns}
    for name, (_, logged) in found.items():
        element = getattr(bench, name)
        assert (logged.dtype.itemsize, logged.shape[1:]) == (element.dtype.itemsize, element.shape)
        assert logged[-1].tolist() == element.tolist()
        assert name == "mixed" or logged.dtype == element.dtype
    assert ({topic.missed for topic in topics.values()}, kept.read()) == ({0}, [])


def test_topic_begins_again_with_the_first_sample_after_a_restart(bench, client, until) -> None:
    client.start()
    with warmed(bench, client, "/log/x", until) as topic:
        client.restart("discard")
        bench.ticks(20)
        batches = until(topic.read)
    assert batches[0].first == 0


# --------------------------------------------------------------------------------------------------------- history


def test_history_has_minimum_and_maximum_of_every_column(bench, client) -> None:
    bench.kept[...] = 5
    client.start()
    bench.ticks(40)
    found = client.history(["/log/x", "/log/slow"], bench.begin_ns, bench.begin_ns + 4 * COLUMN_NS, COLUMN_NS)
    assert found.first * COLUMN_NS == bench.begin_ns
    np.testing.assert_array_equal(found.low, [[1, 11, 21, 31], [1, 11, 21, 31]])
    np.testing.assert_array_equal(found.high, [[10, 20, 30, 40], [6, 16, 26, 36]])
    beyond = client.history(["/log/x"], bench.begin_ns - COLUMN_NS, bench.begin_ns + 5 * COLUMN_NS, COLUMN_NS)
    np.testing.assert_array_equal(beyond.low, [[np.nan, 1, 11, 21, 31, np.nan]])
    client.stop()
    after = client.history(["/log/kept"], bench.begin_ns, bench.begin_ns + COLUMN_NS, COLUMN_NS)  # it is only saved
    np.testing.assert_array_equal(after.high, [[5]])
    with pytest.raises(RefusedError, match="'/log/nix'") as refused:
        client.history(["/log/nix"], 0, 10, 1_000_000)
    assert refused.value.why is RefusedWhy.NOT_FOUND


# ----------------------------------------------------------------------------------------------------------- saves


def test_saving_goes_on_while_running_and_is_told(bench, client, heard) -> None:
    client.start()
    bench.ticks(30)
    job = client.save([FileType.SILO, FileType.CSV], "mine")
    bench.ticks(30)
    files = client.wait_saved(job, 30)
    assert [file.path.rsplit("/", 1)[1] for file in files] == ["mine.silo", "mine.csv"]
    assert heard.wait(EventKind.SAVED).files == files
    assert client.status().ticks == 60
    client.wait_saved(client.save(), 30)
    assert client.status().saved
    bench.ticks(1)
    assert not client.status().saved


def test_restart_right_after_the_request_takes_nothing_from_a_save(bench, client) -> None:
    client.start()
    bench.ticks(100)
    job = client.save()
    client.restart("discard")
    (file,) = client.wait_saved(job, 30)
    np.testing.assert_array_equal(silo.open_log(file.path)["/log/x"].values, 1 + np.arange(100.0))


def test_names_that_lead_elsewhere_are_refused(bench, client) -> None:
    client.start()
    bench.ticks(1)
    for name in ("../x", ".x", "a/b", "\n", "x" * 300):
        with pytest.raises(RefusedError) as refused:
            client.save([FileType.SILO], name)
        assert refused.value.why is RefusedWhy.INVALID


def test_robot_program_saves_through_its_helper(bench, client, heard) -> None:
    client.start()
    bench.ticks(5)
    (file,) = bench.logger.save("silo")
    assert heard.wait(EventKind.SAVED).files == [file]
    assert client.status().saved
