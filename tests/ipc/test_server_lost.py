"""What clients are told of losses: samples, all elements together, as the logger and the saved log count them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.rpc.published import EventKind

pytestmark = pytest.mark.slow


@pytest.mark.usefixtures("runtime")
def test_status_views_and_events_count_the_samples_that_the_elements_lost(
    tmp_path: Path, until: Callable[..., object]
) -> None:
    with silo.Logger("full", max_time=0, memory_limit_mb=6, folder=tmp_path, script=tmp_path / "none.yaml") as log:
        growing = {"buffer": silo.BufferType.GROWING, "size": 1, "action": silo.Action.SAVE_AND_PUBLISH}
        x = log.array("x", 300, np.int64, **growing)
        log.array("y", 3, **growing)
        with log.serve(), Client.connect("full") as client:
            heard = []
            client.on_event(heard.append)
            log.start()
            log.collect()
            view = client.view(["/log/x"])
            until(lambda: (frame := view.frame()) is not None and frame.tick >= 1)  # the publisher follows this run
            for tick in range(6000):
                x[:] = tick
                log.collect()
            lost = sum(element.lost for element in log.snapshot().elements)
            assert client.status().lost == lost > 0
            until(lambda: (frame := view.frame()) is not None and frame.lost_total == lost)

            def told() -> int:
                return sum(int(event.text.split()[0]) for event in heard if event.kind is EventKind.LOST)

            until(lambda: told() == lost)
            assert all(
                "could not be kept: the memory limit was reached (memory_limit_mb): save" in event.text
                for event in heard
                if event.kind is EventKind.LOST
            )
            for _ in range(50):
                log.collect()
            log.stop()
            lost = sum(element.lost for element in log.snapshot().elements)
            until(lambda: told() == lost)  # the last of it, too
