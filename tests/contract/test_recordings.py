"""The recordings in a logger's folder, as a client lists, fetches and deletes them: real helper process and fake."""

import pytest

from silo.core.elements import FileType
from silo.errors import ConnectionLostError, ElementError, RefusedError, SaveError
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy
from tests.stand_ins.fake_signals import START_NS


def why(call, *arguments) -> RefusedWhy:
    with pytest.raises(RefusedError) as error:
        call(*arguments)
    return error.value.why


def test_a_log_is_listed_with_its_size_span_and_why_it_was_saved(side, client):
    path = side.log_of("robot", "walk")
    listed = client.recordings()
    (one,) = listed.recordings
    assert listed.folder == str(path.parent)
    assert (one.stem, one.why, one.begun_ns, one.span_s, one.own) == ("walk", "trigger fall", START_NS, 1.0, True)
    (file,) = one.files
    assert (file.name, file.type, file.size_bytes) == ("walk.silo", FileType.SILO, path.stat().st_size)
    assert 0 < listed.free_bytes <= listed.disk_bytes
    assert one.markers == 0


def test_a_recording_is_fetched_bit_by_bit_the_same(side, client, tmp_path):
    path = side.log_of("robot", "walk")
    told = []
    here = client.fetch("walk.silo", tmp_path / "here", lambda done, total: told.append((done, total)))
    assert here.read_bytes() == path.read_bytes()
    assert told[-1] == (path.stat().st_size,) * 2
    with pytest.raises(SaveError, match="exists already"):
        client.fetch("walk.silo", tmp_path / "here")


@pytest.mark.parametrize("name", ["../walk.silo", "/etc/passwd", "none.silo", ".hidden.silo", "robot.yaml"])
def test_only_recordings_of_the_folder_are_fetched_and_deleted(side, client, tmp_path, name):
    path = side.log_of("robot", "walk")
    good = {RefusedWhy.FORBIDDEN, RefusedWhy.NOT_FOUND, RefusedWhy.INVALID}
    assert why(client.fetch, name, tmp_path / "here") in good
    assert why(client.delete_recording, name) in good
    assert path.exists()
    assert not (tmp_path / "here").exists()


def test_a_deleted_recording_is_gone_and_all_are_told(side, client):
    path = side.log_of("robot", "walk")
    assert "walk.silo" in client.delete_recording("walk")
    assert not path.exists()
    assert client.recordings().recordings == []
    assert "walk.silo" in side.heard.event(EventKind.DELETED).text


def test_a_log_of_another_logger_is_listed_and_fetched_but_not_deleted(side, client, tmp_path):
    path = side.log_of("arm", "theirs")
    (one,) = client.recordings().recordings
    assert (one.logger, one.own) == ("arm", False)
    client.fetch("theirs.silo", tmp_path / "here")
    assert why(client.delete_recording, "theirs.silo") is RefusedWhy.FORBIDDEN
    assert path.exists()


def test_without_a_link_nothing_of_it_works_and_it_is_told(side, client, tmp_path):
    side.log_of("robot", "walk")
    side.cut()
    assert side.heard.lost()
    for call in (client.recordings, lambda: client.delete_recording("walk")):
        with pytest.raises(ConnectionLostError):
            call()
    with pytest.raises(ConnectionLostError):
        client.fetch("walk.silo", tmp_path / "here", patience_s=0)


@pytest.mark.slow
def test_what_makes_no_sense_is_told_before_it_is_sent(tmp_path):
    from tests.contract.conftest import RealSide

    side = RealSide(tmp_path)
    try:
        for call in (
            lambda: side.client.recordings(0),
            lambda: side.client.fetch(7),
            lambda: side.client.fetch("a", 7),
        ):
            with pytest.raises(ElementError):
                call()
    finally:
        side.close()
