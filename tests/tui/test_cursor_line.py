"""The line under the cursor looks different from the others, whatever field is chosen."""

from silo_tui.model.table.fields import Field


async def test_the_highlight_moves_with_the_cursor(fake, opened):
    async with opened(fake) as screen:
        table = screen.app.screen.table
        for at, field in enumerate(Field, 1):
            table.field = field
            await screen.press("j", "k", "j")
            backs = [list(table.render_line(y))[1].style.bgcolor for y in range(8)]  # behind the sign of what waits
            assert [back == backs[at] for back in backs] == [y == at for y in range(8)], field
