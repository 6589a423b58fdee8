"""The line under the cursor looks different from the others, whatever field is chosen."""

from silo_tui.model.table.fields import Field


async def test_the_highlight_moves_with_the_cursor(screen):
    table = screen.app.screen.table
    for at, field in enumerate(Field, 1):
        table.field = field
        await screen.press("j", "k", "j")
        backs = [list(table.render_line(y))[1].style.bgcolor for y in range(8)]  # behind the sign of what waits
        assert [back == backs[at] for back in backs] == [y == at for y in range(8)], field


async def test_two_moves_before_a_paint_leave_one_line_under_the_cursor(screen):
    table = screen.app.screen.table
    painted = [table.render_line(y) for y in range(table.size.height)]
    assert len(table._painted) == len(painted)
    for position in (3, 5):
        table.rows.move_to(position)
        table.show_cursor()
    lines = ["".join(segment.text for segment in table.render_line(y)) for y in range(8)]
    assert [y for y, line in enumerate(lines) if line.startswith(" >")] == [5]


async def test_a_move_of_the_cursor_looks_at_two_lines_alone(screen):
    table, looked = screen.app.screen.table, []
    painted = [table.render_line(y) for y in range(table.size.height)]
    assert len(table._painted) == len(painted)
    content = table._content
    table._content = lambda y, *laid: looked.append(y) or content(y, *laid)
    table.rows.move_to(3)
    table.show_cursor()
    assert sorted(looked) == [0, 3]


async def test_the_sign_that_all_rows_have_without_the_robot_is_told_in_words(fake, screen, size=(120, 24)):
    fake.cut()
    await screen.shows("old: no link, the program is dead, or it was switched on later")
