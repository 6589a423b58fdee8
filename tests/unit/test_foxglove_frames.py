"""What stands before a message to a viewer of Foxglove: the size of its payload in the fewest bytes (RFC 6455, 5.2)."""

import pytest

protocol = pytest.importorskip("silo.bridges.foxglove.protocol", exc_type=ImportError)


@pytest.mark.parametrize(
    ("size", "told"),
    [
        (0, [0]),
        (125, [125]),
        (126, [126, 0, 126]),
        (65_535, [126, 255, 255]),
        (65_536, [127, 0, 0, 0, 0, 0, 1, 0, 0]),
        (2**32, [127, 0, 0, 0, 1, 0, 0, 0, 0]),
    ],
)
def test_a_size_is_told_in_the_fewest_bytes(size, told):
    assert list(protocol.frame_head(size)) == [0x82, *told]
