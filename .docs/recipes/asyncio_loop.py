"""A control loop in asyncio, and a task beside it that reads the topic that the loop publishes.

`collect()` belongs to one thread: all tasks of an event loop share one, so any task may call it. `serve()` starts a
process and may take a second; here it is called before the loop runs.

    python .docs/recipes/asyncio_loop.py FOLDER
"""

import asyncio
import sys

import numpy as np
from numpy.typing import NDArray

import silo

RATE_HZ = 200.0
TICKS = 400


async def control(log: silo.Logger, speed: NDArray[np.float64]) -> None:
    """Collect at a steady rate: deadlines are absolute, so that it doesn't drift."""
    loop = asyncio.get_running_loop()
    log.start()
    begin = loop.time()
    for tick in range(TICKS):
        speed[...] = tick / TICKS
        log.collect()
        await asyncio.sleep(begin + (tick + 1) / RATE_HZ - loop.time())
    log.stop()


async def listen(client: silo.Client, seen: list[float]) -> None:
    """Take every sample that is published, without holding up the loop."""
    with client.topic("speed") as topic:
        async for batch in topic:
            seen += batch.values.tolist()


async def run(log: silo.Logger, client: silo.Client, speed: NDArray[np.float64]) -> int:
    """Run both tasks; return how many samples came over the topic."""
    seen: list[float] = []
    listener = asyncio.create_task(listen(client, seen))
    await control(log, speed)
    listener.cancel()
    return len(seen)


def main(folder: str) -> None:
    """Log, listen, save."""
    with silo.Logger("walker", frequency=RATE_HZ, folder=folder) as log:
        speed = log.array("speed", unit="m/s", action="both")
        log.update()
        with log.serve(), silo.connect("walker") as client:
            heard = asyncio.run(run(log, client, speed))
        saved = log.save()
    samples = len(silo.open_log(saved[0].path)["speed"])
    print(f"{samples} samples logged, {'some' if heard else 'none'} heard meanwhile")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
