"""Pictures of the main screens; the facts on them are pinned elsewhere, these guard the look."""

import time

import pytest

from silo_tui.app import SiloApp
from tests.waiting import DEADLINE_S

STEADY_LOOKS = 10
pytestmark = pytest.mark.slow


def text_of(app):
    return ["".join(segment.text for segment in line) for line in app.screen._compositor.render_strips()]


async def settle(pilot, ready=lambda app: True):
    """Wait until it is ready and draws the same again and again; the fake's clock stands."""
    deadline = time.monotonic() + DEADLINE_S
    same, before = 0, []
    while same < STEADY_LOOKS:
        assert time.monotonic() < deadline, before
        await pilot.pause()
        now = text_of(pilot.app)
        same = same + 1 if now == before and ready(pilot.app) else 0
        before = now


def table_is_live(app):
    return app.context.has_session and bool(app.context.session.live.readings) and not app.context.session.columns.empty


def readings_are_there(app):
    return app.context.has_session and bool(app.context.session.live.readings)


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (160, 50)], ids="{0[0]}x{0[1]}".format)
def test_the_table(fake, new_finder, snap_compare, size):
    fake.run()

    async def steps(pilot):
        await settle(pilot, table_is_live if size[0] > 80 else readings_are_there)
        await pilot.press("j", "space", "t", "j", "d", "5", "enter")
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=size, run_before=steps)


def test_the_table_without_colours(fake, new_finder, snap_compare, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake.run()

    async def steps(pilot):
        await settle(pilot, readings_are_there)
        await pilot.press("j", "space", "t", "j", "d", "5", "enter")
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_the_monitor(fake, new_finder, snap_compare):
    fake.run(20)

    async def steps(pilot):
        await settle(pilot, readings_are_there)
        await pilot.press("slash", "L", "F", "space", *"torque", "enter", "asterisk", "m")
        await settle(pilot, lambda app: not app.screen.stack.store.empty)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(120, 40), run_before=steps)
