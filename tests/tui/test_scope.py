"""The scope: a crossing stands still, at the same place of the picture; nothing is set up in the logger for it."""

from dataclasses import replace

import numpy as np
import pytest

from silo_tui.model.plots.scope import (
    SPANS,
    Mode,
    Scope,
    axis_word,
    fitting_span,
    halfway,
    newest_of,
    other_span,
    parse_settings,
    picture_of,
)
from tests.stand_ins.fake_signals import START_NS

TORQUE = "/log/legs/LF/HAA/torque"
MS = 1_000_000


class TestModel:
    def test_a_pulse_of_a_sample_stands_at_the_share_before_the_crossing_whenever_it_comes(self):
        scope = Scope(20.0, span_s=0.2)
        for at_ns in (START_NS, START_NS + 123_456_789, 10**12 + 1):
            time_ns = at_ns + MS * np.arange(-300, 300)
            values = np.where(time_ns == at_ns, 40.0, 0.0)
            store = picture_of({"a": (time_ns, values)}, scope, at_ns, 200)
            high = np.flatnonzero(store.high[0] == 40.0)
            assert high.tolist() == [80]  # 40 % of 200 columns
            assert np.isfinite(store.low[0]).all()

    def test_samples_outside_of_the_picture_are_left_out(self):
        scope = Scope(0.0, span_s=0.1, pre=0.5)
        store = picture_of({"a": (np.array([-60 * MS, 0, 60 * MS]), np.array([7.0, 1.0, 9.0]))}, scope, 0, 100)
        assert np.nanmax(store.high) == 1.0

    @pytest.mark.parametrize("columns", [100, 77, 30])
    def test_the_last_samples_of_the_picture_are_in_it(self, columns):
        time_ns = MS * np.arange(-40, 60)
        store = picture_of({"a": (time_ns, np.arange(100.0))}, Scope(0.0, span_s=0.1, pre=0.4), 0, columns)
        assert np.nanmax(store.high) == 99.0

    def test_the_axis_counts_from_the_crossing(self):
        scope = Scope(0.0, span_s=0.2)
        assert [axis_word(scope, share) for share in (0.0, 0.4, 1.0)] == ["-80 ms", "0", "+120 ms"]

    def test_the_span_fits_the_rate(self):
        assert fitting_span(MS) == 0.2
        at = SPANS.index(0.2)
        assert [other_span(0.2, closer=closer) for closer in (True, False)] == [SPANS[at - 1], SPANS[at + 1]]
        assert other_span(SPANS[0], closer=True) == SPANS[0]
        assert other_span(SPANS[-1], closer=False) == SPANS[-1]

    def test_halfway_has_no_more_digits_than_it_needs(self):
        assert halfway(0.0, 40.123456) == 20.0
        assert halfway(3.0, 3.0) == 3.0

    def test_the_newest_crossing_is_shown_and_those_between_are_counted(self):
        assert newest_of([1, 5, 9], 4) == (9, 1)
        assert newest_of([1], 4) == (None, 0)

    def test_settings_are_read_as_words(self):
        assert Scope(20.0).words == "↑ rising through 20   pre 40%"
        assert Scope(-3.5, -1, pre=0.1).words == "↓ falling through -3.5   pre 10%"

    def test_settings_are_typed_in_words(self):
        assert parse_settings("falling -3.5 pre 10% single", Scope(1.0)) == Scope(-3.5, -1, Mode.SINGLE, 0.1)
        assert parse_settings("rising, auto pre 0", Scope(1.0, -1)) == Scope(1.0, mode=Mode.AUTO, pre=0.0)
        assert parse_settings("pre 100", Scope(1.0)).pre == 1.0
        for wrong in ("fast", "pre 200", "pre -1", "nan", "pre"):
            with pytest.raises(ValueError, match=r"."):
                parse_settings(wrong, Scope(1.0))


async def open_scope(screen, fake):
    """The torque has one sample of 40 at 4, 8, ... s."""
    await screen.enter("/LF/HAA/torque", "m")
    await screen.curves()
    await screen.do("catch", shows="SCOPE normal")
    return screen.app.screen


async def run_to(screen, fake, seconds):
    """The clock goes on, and the screen has a frame of it."""
    fake.now_ns = START_NS + round(seconds * 1e9)
    await screen.until(lambda: screen.session.frame_time_ns == fake.now_ns, "a frame")


@pytest.mark.slow
class TestScreen:
    async def test_a_pulse_of_one_sample_is_caught_by_one_key_on_the_plot_and_those_between_two_looks_counted(
        self, fake, screen, ran_s=21
    ):
        scope = await open_scope(screen, fake)
        await screen.shows("ARMED")
        assert 5 < scope.settings.level < 40  # halfway
        await run_to(screen, fake, 25)
        await screen.shows("CAUGHT")
        assert scope.caught_ns == START_NS + 24 * 10**9
        assert np.nanmax(scope.stack.store.high) == 40.0
        place = int(np.flatnonzero(scope.stack.store.high[0] == 40.0)[0])
        await run_to(screen, fake, 29)
        await screen.until(lambda: scope.caught_ns == START_NS + 28 * 10**9, "the next one")
        assert int(np.flatnonzero(scope.stack.store.high[0] == 40.0)[0]) == place  # it stands still
        await run_to(screen, fake, 41)
        await screen.shows("2 more came between")
        assert scope.caught == 5
        assert not [call for call in fake.calls if "trigger" in call[0]]
        assert not fake.pins

    async def test_single_catches_once_until_space_arms_it_again(self, fake, screen, ran_s=21):
        scope = await open_scope(screen, fake)
        await screen.do("scope_mode", shows="SCOPE single")
        await run_to(screen, fake, 25)
        await screen.shows("CAUGHT")
        await run_to(screen, fake, 29)
        await screen.shows("space arms it again")
        assert scope.caught == 1
        await screen.press("space", shows="ARMED")
        await run_to(screen, fake, 33)
        await screen.until(lambda: scope.caught == 2, "one more")

    async def test_force_shows_what_is_there_without_a_crossing(self, fake, screen, ran_s=21):
        scope = await open_scope(screen, fake)
        await screen.do("scope_force")
        await screen.until(lambda: np.isfinite(scope.stack.store.low).any(), "a picture")
        assert not scope.caught

    async def test_the_level_moves_and_settings_are_typed(self, fake, screen, ran_s=21):
        scope = await open_scope(screen, fake)
        for key, sign in (("level_up", 1), ("level_down", -1), ("level_down", -1)):
            before = scope.settings.level  # a step is a share of the scale, which follows what comes
            await screen.do(key)
            assert sign * (scope.settings.level - before) > 0
        await screen.press("e")
        await screen.until(lambda: screen.app.screen is not scope, "the line")
        line = screen.app.screen.query_one("Input")
        line.value = "falling 3 pre 10 auto"
        await screen.press("enter", shows="↓ falling through 3   pre 10%")
        await screen.press("escape")
        await screen.until(lambda: screen.app.screen is not scope, "the monitor")

    async def test_an_element_that_is_off_makes_it_blind_and_says_why(self, fake, screen, ran_s=21):
        await open_scope(screen, fake)
        find = fake.find

        def off(names, *more, **how):
            found = find(names, *more, **how)
            return {name: replace(one, why="it is off") for name, one in found.items()}

        fake.find = off
        fake.advance(1.0)
        await screen.shows("BLIND")


@pytest.mark.parametrize("typed", ["foo", "rising foo", "pre foo", "20 pre x"])
def test_what_is_no_setting_is_told_with_those_that_are(typed):
    with pytest.raises(
        ValueError, match="is no level such as 20, and none of rising, falling, pre 40, normal, single, auto"
    ):
        parse_settings(typed, Scope(1.0))
