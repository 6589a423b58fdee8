"""What somebody meets who opens silo-tui for the first time, and types faster than it was thought."""

from textual import events


def burst(screen, *keys):
    """Keys in one piece, as a slow link or `tmux send-keys` brings them."""
    names = {" ": "space", "/": "slash", ":": "colon", "*": "asterisk"}
    for key in keys:
        char = key if len(key) == 1 else None
        screen.app.post_message(events.Key(names.get(key, key), char))


async def test_a_filter_with_its_enter_in_one_piece_is_taken_whole(fake, opened):
    async with opened(fake) as screen:
        await screen.press("slash")
        burst(screen, *"LF torque unit:Nm", "enter")
        await screen.shows("/LF torque unit:Nm: 3 of 72")


async def test_marking_all_right_behind_a_filter_marks_what_passes_it(fake, opened):
    async with opened(fake) as screen:
        burst(screen, *"/LF torque", "enter", "*")
        await screen.until(lambda: screen.session.rows.marked_count)
        assert screen.session.rows.marked_count == 3


async def test_a_correction_typed_in_one_piece_is_made_where_it_was_typed(fake, opened):
    async with opened(fake) as screen:
        burst(screen, *"/LFx", "backspace", *" torqe", "left", "u", "enter")
        await screen.shows("/LF torque: 3 of 72")
