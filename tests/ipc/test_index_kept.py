"""The index of runs, kept by the helper process as files come."""

import sqlite3

from silo.run_index.index import NAME, RunIndex
from tests.waiting import wait_until


def listed(folder):
    with sqlite3.connect(f"file:{folder / NAME}?mode=ro", uri=True) as database:
        return sorted(path for (path,) in database.execute("SELECT path FROM run"))


def test_an_index_that_is_there_gets_what_is_saved_and_captured(bench, client, tmp_path):
    RunIndex(tmp_path).close()  # of a folder above
    bench.logger.trigger("high", "x > 50", pre="50ms", post="30ms")
    bench.start(100)
    wait_until(lambda: client.status().ticks == 100)  # the helper process has learned of the start
    client.save(["silo", "csv"])
    found = wait_until(lambda: len(there := listed(tmp_path)) == 2 and there)
    assert all(path.startswith("logs/bot_") and path.endswith(".silo") for path in found)


def test_without_an_index_none_is_made(bench, client, tmp_path):
    bench.start(10)
    wait_until(lambda: client.status().ticks == 10)
    client.save(["silo"])
    bench.logger.close()
    assert not list(tmp_path.rglob(NAME))


def test_what_is_saved_at_the_end_is_in_it(bench, tmp_path):
    RunIndex(tmp_path).close()
    bench.start(10)
    bench.logger.save("silo")
    bench.logger.close()
    wait_until(lambda: len(listed(tmp_path)) == 1)
