"""A program that is killed right after a change of its parameters: the record has it whole, and `silo recover` too."""

import subprocess
import sys

import silo
from silo.cli.main import run

PROGRAM = """
import os, signal, silo
log = silo.Logger("killed", folder={folder!r}, script={folder!r} + "/none.yaml")
kp, kd = log.parameter("kp", 40.0), log.parameter("kd", 1.0)
log.start()
log.collect()
log.parameters.request({{"kp": 50.0, "kd": 2.0}}, "alice", "network", "a", remote=False)
log.collect()
log.parameters.request({{"kp": 60.0, "kd": 3.0}}, "alice", "network", "b", remote=False)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_had_landed_is_recovered_with_its_tick_and_what_waited_is_not(runtime_folder, tmp_path):
    program = PROGRAM.format(folder=str(tmp_path))
    subprocess.run([sys.executable, "-c", program], check=False, stderr=subprocess.DEVNULL)
    assert run(["recover"]) == 0
    (file,) = tmp_path.glob("*.silo")
    log = silo.open_log(file)
    (change,) = log.parameters.changes
    assert (change.tick, change.who, change.change.where) == (2, "alice", "network")
    assert change.change.values == (("/log/kp", 40.0, 50.0), ("/log/kd", 1.0, 2.0))
