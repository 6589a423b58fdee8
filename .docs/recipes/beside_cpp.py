"""A C++ (or Rust, or C) controller whose state silo logs: it writes to shared memory, a Python process beside reads it.

The controller knows nothing of silo and waits for nobody. This process maps its memory, takes each state that is whole
(a sequence counter, odd while a state is written), and logs it under the controller's own time stamp. States that it
came too late for are counted. Needs `g++`; in Rust the same is a `#[repr(C)]` struct in a `memmap2::MmapMut`.

    python .docs/recipes/beside_cpp.py FOLDER
"""

import mmap
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import silo

# struct State of beside_cpp.cpp; align=True pads as the C compiler does
STATE = np.dtype(
    [("sequence", "u8"), ("time_ns", "i8"), ("q", "f8", 12), ("torque", "f8", 12), ("mode", "u1")], align=True
)
TICKS = 500


def take(shared: np.ndarray, state: np.ndarray) -> bool:
    """Copy the newest state if it is whole and not the one that we have; False tells to look again later.

    A controller that died while it wrote leaves an odd counter: then nothing comes any more, and nobody waits for it.
    """
    before = int(shared["sequence"][0])
    if before % 2 or before == int(state["sequence"][0]):
        return False
    copied = shared.copy()
    if before != int(shared["sequence"][0]):
        return False
    state[:] = copied
    return True


def main(folder: str) -> None:
    """Compile and start the controller, log its states until it ends."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as place:
        program, memory = Path(place) / "controller", Path(place) / "state"
        source = Path(__file__).with_suffix(".cpp")
        subprocess.run(["g++", "-std=c++17", "-O2", "-pthread", "-o", program, source], check=True)
        memory.write_bytes(bytes(STATE.itemsize))  # zeros: no state yet
        with memory.open("r+b") as file:
            shared = np.frombuffer(mmap.mmap(file.fileno(), STATE.itemsize), STATE)
        state = np.zeros(1, STATE)
        missed = 0
        clock = state["time_ns"]  # a view: the newest time stamp
        with silo.Logger("beside", frequency=1000, folder=folder, clock=lambda: int(clock[0])) as log:
            log.add(state["q"][0], "q", group="joints", unit="rad")
            log.add(state["torque"][0], "torque", group="joints", unit="Nm")
            log.add(state["mode"], "mode", labels={0: "IDLE", 1: "STAND", 2: "WALK"})
            log.start()
            with subprocess.Popen([program, memory, str(TICKS)]) as controller:
                while controller.poll() is None:
                    last = int(state["sequence"][0])
                    if take(shared, state):
                        missed += (int(state["sequence"][0]) - last) // 2 - 1
                        log.collect()
                    else:
                        time.sleep(0.0002)
            log.stop()
            saved = log.save("silo")
    run = silo.open_log(saved[0].path)
    whole = bool(np.all(run["joints/q"].values == -run["joints/torque"].values))
    print(
        f"states are {'whole' if whole else 'torn'}: {len(run['joints/q'])} logged, {missed} came too late to be seen"
    )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
