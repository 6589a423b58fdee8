"""What an installed silo has to do: log, serve, save in every format, read it again, show itself. For `.ci/floors.py`.

Runs on the packages of its own environment, without the source tree: python smoke.py FOLDER
"""

import asyncio
import subprocess
import sys
from pathlib import Path

import numpy as np

import silo

TICKS = 200
READ_AGAIN, WRITTEN = ("log.csv", "log.mcap", "bag"), ("log.parquet", "log.mat", "log.npz", "log.h5")


def logged(folder: Path) -> Path:
    """Log and save while a client looks on; return the `.silo`."""
    with silo.Logger("smoke", frequency=500, folder=folder) as log:
        q = log.array("q", 3, group="joints", unit="rad", action="both")
        log.add(lambda: "walk", "mode")
        with log.serve():
            log.start()
            for tick in range(TICKS):
                q[:] = tick
                log.collect()
            with silo.connect("smoke") as client:
                assert client.status().ticks == TICKS
            log.stop()
            saved = log.save(["silo", "csv", "bag"])
    return Path(next(file.path for file in saved if file.path.endswith(".silo")))


def shell(*words: str) -> str:
    """Run a command that was installed."""
    command = [str(Path(sys.executable).parent / words[0]), *words[1:]]
    return subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout


async def terminal(path: Path) -> None:
    """Open a saved log in silo-tui, without a terminal."""
    from silo_tui.app import SiloApp
    from silo_tui.sessions.finder import ClientFinder
    from silo_tui.sessions.recorded import open_file

    app = SiloApp(ClientFinder(""), file=open_file(path))
    async with app.run_test(size=(80, 24)) as pilot:
        await pilot.pause()
    app.release()


def main(folder: Path) -> None:
    """Do all of it; what fails raises."""
    path = logged(folder)
    for name in (*READ_AGAIN, *WRITTEN):
        shell("silo", "convert", str(path), str(folder / name))
    for name in READ_AGAIN:
        values = silo.open_log(folder / name)["joints/q"].values
        assert np.array_equal(values[:, 0], np.arange(TICKS)), name
    log = silo.open_log(path)
    assert len(log.to_pandas()) == len(log.to_polars()) == log.to_xarray().sizes["time"] == TICKS
    log["joints/q"].plot(path=folder / "q.png")
    assert log["joints/q"][:, 0].derivative().values.size
    shell("silo", "config", "cp", "demo.yaml", str(folder))
    shell("silo", "script", "check", str(folder / "demo.yaml"))
    shell("silo-tui", "--help")
    asyncio.run(terminal(path))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    print("well")
