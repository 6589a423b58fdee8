"""Many histories at once: each has its turn, and the helper process holds one answer at a time."""

import re
import time
from pathlib import Path

import pytest
import zenoh

from silo.core.arrays.columns import MAX_COLUMNS
from silo.fleet.exchange import decode_reply, encoded
from silo.helper.lanes import BEGUN_S
from silo.history.requests import Columns, GetHistory
from silo.net.keys import ANY_ALIVE
from silo.net.session import close, open_client
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow

AT_ONCE = 64
COLUMN_NS = 1_000_000


def private_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return int(re.search(r"Pss_Anon:\s+(\d+)", text)[1]) / 1e3


def test_of_64_large_histories_at_once_all_are_answered_and_memory_stays_bounded(bench, client, until):
    client.start()
    bench.ticks(500)
    pid = client.status().helper_pid
    names = ["/log/x"] * 64
    client.history(names, bench.begin_ns, bench.begin_ns + MAX_COLUMNS * COLUMN_NS, COLUMN_NS)
    before, peak = private_mb(pid), 0.0
    request = GetHistory(
        names=names, start_ns=bench.begin_ns, end_ns=bench.begin_ns + MAX_COLUMNS * COLUMN_NS, column_ns=COLUMN_NS
    )
    sizes, late, first_s = [], False, time.monotonic()
    while len(sizes) < AT_ONCE and not late:  # who takes nothing in for a moment, on a busy computer, is let go
        session = open_client(Path(bench.serving.socket_path))
        try:
            assert list(session.liveliness().get(ANY_ALIVE, timeout=DEADLINE_S))  # before that it knows nobody to ask
            began_s = time.monotonic()
            key = f"silo/*/bot/{GetHistory.key}"
            asked = [
                session.get(key, zenoh.handlers.FifoChannel(1), payload=encoded(request), timeout=DEADLINE_S)
                for _ in range(AT_ONCE - len(sizes))
            ]
            for handler in asked:
                for reply in handler:
                    answer = decode_reply(reply.ok.payload.to_bytes(), "bot")
                    sizes.append(len(answer.low) if isinstance(answer, Columns) else str(answer))
                    peak = max(peak, private_mb(pid))
        finally:
            close(session)
        assert sizes or time.monotonic() - first_s < DEADLINE_S
        # who waited as long as clients wait, but for what an answer takes, was told at once that there is none
        late = time.monotonic() - began_s > GetHistory.timeout_s - BEGUN_S
    assert set(sizes) == {8 * 64 * MAX_COLUMNS}
    print(f"private memory {before:.0f} -> {peak:.0f} MB")
    assert peak < before + 48  # all 64 answers together take 285
