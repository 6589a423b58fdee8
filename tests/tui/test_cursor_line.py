"""The line under the cursor looks different from the others, whatever field is chosen."""

import pytest

from silo_tui.model.fields import Field


@pytest.mark.parametrize("field", list(Field))
async def test_the_highlight_moves_with_the_cursor(fake, opened, field):
    async with opened(fake) as screen:
        table = screen.app.screen.table
        table.field = field
        await screen.press("j", "k", "j", "j")
        await screen.pilot.pause()
        backs = [next(iter(table.render_line(y))).style.bgcolor for y in range(6)]
        assert [back == backs[2] for back in backs] == [y == 2 for y in range(6)]
