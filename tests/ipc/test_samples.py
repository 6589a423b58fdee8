"""Raw samples, streams and pins of a real helper process, against what the loop logged, to the tick."""

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import BufferType, Edit, ElementOptions
from silo.errors import RefusedError
from silo.history import arrays
from silo.history.requests import ClosePin
from silo.rpc.refusals import RefusedWhy
from tests.waiting import wait_until

LOOPING, FIXED = BufferType.LOOPING, BufferType.FIXED


def buffer(client, name, size, kind, action=silo.Action.SAVE):
    client.apply([Edit(name, ElementOptions(size=size, buffer=kind, action=action))], -1)


# ----------------------------------------------------------------------------------------------------------- samples


def test_samples_have_ticks_and_stamps_and_histories_streams_pins_and_views_take_names_as_topics_do(bench, client):
    client.start()
    bench.ticks(40)
    found = client.samples(["/log/x", "/log/slow"])
    assert found["/log/x"].ticks.tolist() == list(range(40))
    assert found["/log/x"].values.tolist() == list(range(1, 41))
    assert found["/log/x"].time_ns.tolist() == [bench.begin_ns + bench.tick_ns * tick for tick in range(40)]
    assert found["/log/slow"].ticks.tolist() == list(range(0, 40, 5))
    assert (found["/log/slow"].divider, found["/log/slow"].values.tolist()) == (5, list(range(1, 41, 5)))
    end_ns = bench.begin_ns + 40 * bench.tick_ns
    assert client.samples(["x", "q_y"])["x"].ticks.tolist() == list(range(40))
    assert client.history(["x"], bench.begin_ns, end_ns, 10**9).low.shape[0] == 1
    with client.pin(["x"], bench.begin_ns, end_ns) as pin:
        assert len(client.samples(["x"], pin=pin)["x"]) == 40
    with client.stream(["x", "q_y"]) as stream:
        bench.ticks(5)
        assert set(wait_until(lambda: stream.read(timeout_s=0.1))) == {"x", "q_y"}
    with client.view(values=["x"], plots=["q_y"]) as view:
        assert wait_until(view.frame).missing == frozenset()
    with pytest.raises(RefusedError, match="no element or entry is called 'nothing'"):
        client.samples(["nothing"])
    with pytest.raises(RefusedError, match="called 'matrx'; did you mean '/log/matrix'"):
        client.samples(["matrx"])


def test_samples_have_the_type_and_shape_of_their_element(bench, client):
    client.start()
    bench.q[:] = 1, 2, 3
    bench.matrix[:] = [[1, 2], [3, 4]]
    bench.gait[...] = 1
    bench.word[...] = b"hans"
    bench.mixed[...] = (0.5, 7)
    bench.ticks(2)
    names = ["/log/q", "/log/matrix", "/log/gait", "/log/word", "/log/mixed", "/log/q_y", "/log/mixed_n"]
    found = {name: samples.values for name, samples in client.samples(names).items()}
    assert found["/log/q"].tolist() == [[1, 2, 3]] * 2
    assert (found["/log/matrix"].dtype, found["/log/matrix"].tolist()) == (np.float32, [[[1, 2], [3, 4]]] * 2)
    assert (found["/log/gait"].dtype, found["/log/gait"].tolist()) == (np.int8, [1, 1])
    assert found["/log/word"].tolist() == [b"hans"] * 2
    assert (found["/log/mixed"].dtype.names, found["/log/mixed"][0].tolist()) == (("_a", "_n"), (0.5, 7))
    assert (found["/log/q_y"].tolist(), found["/log/mixed_n"].dtype) == ([2, 2], np.int32)


def test_samples_in_small_replies_are_those_of_one(bench, client):
    client.start()
    bench.ticks(600)
    names, told = ["/log/x", "/log/q", "/log/slow", "/log/kept"], []
    whole = client.samples(names)
    pieces = client.samples(names, reply_bytes=4096, told=told.append)
    for name in names:
        np.testing.assert_array_equal(pieces[name].ticks, whole[name].ticks)
        np.testing.assert_array_equal(pieces[name].values, whole[name].values)
    assert len(told) > 5
    assert (told == sorted(told), told[-1]) == (True, 1.0)


def test_samples_of_two_runs_are_never_mixed(bench, client, monkeypatch):
    client.start()
    bench.ticks(600)
    replies = []

    def restart(share):
        replies.append(share)
        if len(replies) == 1:
            client.restart("discard")

    with pytest.raises(RefusedError, match="started anew") as error:
        client.samples(["/log/x"], reply_bytes=4096, told=restart)
    assert error.value.why is RefusedWhy.CONFLICT


# ----------------------------------------------------------------------------------------------------------- streams


def taken(stream, name, count):
    """The samples of the next batches, until there are so many."""
    ticks, values = [], []
    while len(ticks) < count:
        batch = stream.read(30)
        assert batch is not None, f"{len(ticks)} of {count} came"
        if name in batch:
            ticks += batch[name].ticks.tolist()
            values += batch[name].values.tolist()
    return ticks, values


def test_a_stream_has_every_sample_of_what_is_only_saved_or_published(bench, client):
    client.start()
    bench.ticks(5)
    with client.stream(["/log/kept", "/log/x", "/log/q_y"]) as stream:
        bench.ticks(50)
        assert taken(stream, "/log/x", 50) == (list(range(5, 55)), list(range(6, 56)))
        assert (stream.missed, stream.missing) == (0, {})


def test_a_stream_that_is_opened_before_the_start_has_the_first_sample(bench, client):
    with client.stream(["/log/kept"]) as stream:
        client.start()
        bench.ticks(20)
        assert taken(stream, "/log/kept", 20)[0] == list(range(20))


def test_a_stream_goes_on_with_the_first_sample_after_a_restart_and_an_edit(bench, client):
    client.start()
    with client.stream(["/log/kept", "/log/x"]) as stream:
        bench.ticks(10)
        taken(stream, "/log/x", 10)
        client.stop()
        client.apply([Edit("/log/x", ElementOptions(divider=2))], -1)
        client.start("discard")
        bench.ticks(20)
        assert taken(stream, "/log/x", 10)[0] == list(range(0, 20, 2))


def test_a_slow_reader_of_a_stream_gets_a_counted_gap(bench, client, monkeypatch):
    buffer(client, "/log/kept", 10, LOOPING)
    client.start()
    with client.stream(["/log/kept"], period_s=0.01) as stream:
        bench.ticks(5)
        seen = len(taken(stream, "/log/kept", 5)[0])
        # a reader that rests: all but two frames are dropped
        monkeypatch.setattr(arrays, "MAX_BACKLOG_BYTES", 1000)
        frames = 0
        while frames < 6:
            bench.ticks(5)
            before = len(client.samples(["/log/kept"], 0, 2**62, "row")["/log/kept"])
            frames += before > 0
            stream._changed.acquire()
            stream._changed.wait(1)
            stream._changed.release()
        ticks = []
        while not ticks or ticks[-1] != 34:
            ticks += taken(stream, "/log/kept", 1)[0]
    assert seen + len(ticks) + stream.missed == 35


def test_two_clients_have_streams_of_their_own(bench, client):
    client.start()
    with Client.connect("bot") as other, client.stream(["/log/x"]) as one, other.stream(["/log/x", "/log/q"]) as two:
        bench.ticks(20)
        assert taken(one, "/log/x", 20)[0] == taken(two, "/log/x", 20)[0]
        one.close()
        bench.ticks(20)
        assert taken(two, "/log/q", 20)[0] == list(range(20, 40))


# -------------------------------------------------------------------------------------------------------------- pins


def test_a_pin_survives_a_new_start(bench, client):
    client.start()
    bench.ticks(20)
    with client.pin(["/log/x"], 0, bench.now_ns) as pin:
        client.restart("discard")
        bench.ticks(5)
        assert client.samples(["/log/x"], pin=pin)["/log/x"].values.tolist() == list(range(1, 21))


def test_what_a_pin_does_not_hold_is_not_read_from_the_buffers(bench, client):
    with client.pin(["/log/x"], 0, 2**61) as pin:  # nothing was logged yet
        client.start()
        bench.ticks(20)
        span = bench.begin_ns, bench.now_ns, bench.tick_ns
        assert np.isfinite(client.history(["/log/x"], *span).low).any()
        assert not np.isfinite(client.history(["/log/x"], *span, pin=pin).low).any()
        assert not len(client.samples(["/log/x"], pin=pin)["/log/x"])


def test_a_pin_that_its_helper_process_does_not_know_is_not_asked_for_again_and_again(bench, client):
    client.start()
    bench.ticks(20)
    pin = client.pin(["/log/x"], 0, bench.now_ns)
    # its lease ends without this client, as one does behind a link that was cut for long
    client._call(ClosePin(pin=pin.id, proof=pin.request.proof))
    client._leases.renew_soon(pin)
    wait_until(lambda: "no more" in pin.refused)
    wait_until(lambda: pin not in client._leases._due_s)
    pin.close()
