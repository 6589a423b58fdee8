"""The line under the cursor looks different from the others, whatever field is chosen."""

import pytest

from silo_tui.model.table.fields import Field


@pytest.mark.parametrize("field", list(Field))
async def test_the_highlight_moves_with_the_cursor(fake, opened, field):
    async with opened(fake) as screen:
        table = screen.app.screen.table
        table.field = field
        await screen.press("j", "k", "j", "j")
        await screen.pilot.pause()
        backs = [list(table.render_line(y))[1].style.bgcolor for y in range(6)]  # behind the sign of what is pending
        assert [back == backs[2] for back in backs] == [y == 2 for y in range(6)]
