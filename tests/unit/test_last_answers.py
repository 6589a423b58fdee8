"""Answers are kept for those who ask again, and never more than there is room for."""

from silo.rpc.last_answers import MOST_BYTES, MOST_CLIENTS, OF_EACH, LastAnswers


def test_the_last_answers_of_each_client_are_kept_and_older_ones_give_way():
    kept = LastAnswers()
    for number in range(OF_EACH + 1):
        kept.keep("anna", str(number), b"%d" % number)
        kept.keep("ben", f"b{number}", b"b")
    assert kept.find("anna", "0") is None
    assert [kept.find("anna", str(number)) for number in range(1, OF_EACH + 1)] == [b"1", b"2", b"3", b"4"]
    assert kept.find("carl", "1") is None
    assert len(kept.by_number) == 2 * OF_EACH
    assert kept.by_number["4"] == b"4"


def test_who_was_answered_longest_ago_gives_way_to_a_new_client():
    kept = LastAnswers()
    for number in range(MOST_CLIENTS):
        kept.keep(f"client {number}", "1", b"")
    kept.keep("client 0", "2", b"")
    kept.keep("another", "1", b"")
    assert kept.find("client 0", "1") == b""
    assert kept.find("client 1", "1") is None
    assert kept.find("another", "1") == b""


def test_long_answers_give_way_before_they_take_much_memory_and_the_newest_is_always_there():
    kept = LastAnswers()
    for number in range(10):
        kept.keep(f"client {number}", "1", bytes(MOST_BYTES // 3))
        assert kept.find(f"client {number}", "1") is not None
        assert sum(map(len, kept.by_number.values())) <= MOST_BYTES
    kept.keep("client 9", "2", bytes(2 * MOST_BYTES))
    assert kept.find("client 9", "2") is not None
