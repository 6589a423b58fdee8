"""A program, or its helper process, that is killed around a cut: what was collected is in files, each tick once."""

import os
import signal
import subprocess
import sys

import pytest

import silo
from silo.cli.main import run
from tests.waiting import wait_until

PROGRAM = """
import os, signal, sys, silo
from silo.logger.current_run import CurrentRun
from silo.logger.logger import Logger
from silo.logger.run_data import RunData
from silo.loop.run import Run

point, served, folder = sys.argv[1], sys.argv[2] == "served", sys.argv[3]
log = silo.Logger("killed", folder=folder, script=folder + "/none.yaml")
n = log.array("n", (), "int64")
x = log.array("x")
if served:
    serving = log.serve()
log.start()
ticks = 0

def turn(times):
    global ticks
    for _ in range(times):
        n[...] = ticks
        log.collect()
        ticks += 1

def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)

def after(owner, name):
    real = getattr(owner, name)
    def patched(*args, **kwargs):
        real(*args, **kwargs)
        die()
    setattr(owner, name, patched)

turn(5)
if point == "saved":
    RunData.save_cut_off = lambda self: None
    log.save()
log.set("x", divider=2, cut=True)
turn(7)
if point == "prepared":
    after(CurrentRun, "prepare")
elif point == "ended":
    after(Run, "end_by_cut")
elif point == "not handed over":
    Logger._hand_over = die
elif point == "handed over":
    after(Logger, "_hand_over")
elif point == "not saved":
    RunData.save_cut_off = lambda self: None
if point == "helper":
    os.kill(serving.helper_pid, signal.SIGKILL)
log.set("x", divider=3, cut=True)
turn(9)
if point == "helper":
    log.save()
    log.close()
    sys.exit()
die()
"""
TICKS = {"prepared": 12, "ended": 12, "not handed over": 12, "handed over": 12}


@pytest.mark.parametrize("served", ["alone", "served"])
@pytest.mark.parametrize(
    "point", ["prepared", "ended", "not handed over", "handed over", "not saved", "saved", "saving"]
)
def test_every_tick_before_a_kill_around_a_cut_is_recovered_once(runtime_folder, tmp_path, point, served):
    told = subprocess.run([sys.executable, "-c", PROGRAM, point, served, str(tmp_path)], check=False)
    assert told.returncode == -signal.SIGKILL
    ticks = TICKS.get(point, 21)

    def found():
        run(["recover"])
        there = list(tmp_path.glob("*.silo"))
        return there and len(rows(tmp_path)) >= ticks

    wait_until(found)  # the helper process may be saving
    assert rows(tmp_path) == list(range(ticks))


def test_a_helper_process_that_is_killed_loses_nothing_of_a_cut(runtime_folder, tmp_path):
    program = [sys.executable, "-c", PROGRAM, "helper", "served", str(tmp_path)]
    assert subprocess.run(program, check=False).returncode == 0
    assert rows(tmp_path) == list(range(21))


def rows(folder: os.PathLike[str]) -> list[int]:
    values: list[int] = silo.open_log(folder)["n"].values.tolist()
    return values
