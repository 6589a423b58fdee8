"""The app on a real logger with its helper process: what the stand-in of the other tests can't prove."""

import threading

import numpy as np
import pytest

import silo
from silo_tui.app import SiloApp
from silo_tui.screens.lists.loggers import WAITING
from silo_tui.sessions.finder import ClientFinder

pytestmark = pytest.mark.slow


@pytest.fixture
def logger(tmp_path, monkeypatch):
    runtime = tmp_path / "run"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(runtime))
    log = silo.Logger("arm", frequency=200, max_time=10, folder=tmp_path, script=tmp_path / "arm.yaml")
    q = log.array("q", 3, group="joints", unit="rad", action=silo.Action.SAVE_AND_PUBLISH)
    log.add(np.zeros(1), "quiet", group="joints")
    log.update()
    ended = threading.Event()

    def control():
        tick = 0
        while not ended.wait(0.005):
            q[:] = tick
            tick += 1
            log.collect()

    loop = threading.Thread(target=control)
    with log, log.serve():
        log.start()
        loop.start()
        yield log
        ended.set()
        loop.join()


async def test_a_real_logger_is_found_watched_stopped_edited_and_started(logger, screen_of):
    app = SiloApp(ClientFinder(), rate_hz=10)
    async with screen_of(app, size=(100, 30)) as screen:
        await screen.until(lambda: app.context.has_session and len(app.context.session.table) == 2, "the table")
        await screen.until(lambda: "/log/joints/q" in app.context.session.live.readings, "live values")
        await screen.press("d", "4", "enter", "a", shows="stop, apply, start again")
        await screen.press("D", shows="logging again")
        assert logger.elements[0].options.divider == 4
        assert logger._life.state.value == "running"
        began = logger._present.number
        await screen.press("d", "5", "enter", "a", shows="Apply and go on")
        await screen.press("a", shows="it goes on")
        assert (logger.elements[0].options.divider, logger._present.number, logger.is_running) == (5, began, True)


def test_what_the_start_page_tells_to_write_runs_as_it_is_shown(runtime_folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written: dict = {}
    exec(WAITING.partition("its loop:\n")[2].partition("{saved}")[0], written)
    with written["log"], silo.Client.connect("arm") as client:
        assert client.status().frequency_hz == 500


async def test_an_element_that_could_not_be_read_says_so_in_the_inspector(tmp_path, runtime_folder, screen_of):
    class Robot:
        mode: object = 1

    robot = Robot()
    log = silo.Logger("arm", folder=tmp_path, script=tmp_path / "arm.yaml")
    log.add(robot, attr="mode", action=silo.Action.SAVE_AND_PUBLISH)
    with log, log.serve():
        log.start()
        for value in (1, None, None, 4):
            robot.mode = value
            log.collect()
        async with screen_of(SiloApp(ClientFinder(), rate_hz=10), size=(160, 40)) as screen:
            await screen.shows("/mode")
            await screen.press("i", shows="not read     at 2 ticks")
