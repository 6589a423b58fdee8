"""The chunks of a growing ring, as the loop asks for them: one after the other, those left behind let go of."""

from silo.collecting.schema import RingSchema
from silo.collecting.segment import Chunk, Segment


class Chunks:
    """Hands a growing ring its chunks one after the other."""

    def __init__(self, segment: Segment, schema: RingSchema) -> None:
        self._segment, self._schema = segment, schema
        self._chunks: list[Chunk | None] = list(segment.first_chunks(schema.ring))
        self._given = 0  # chunks before this one are full and no more wanted

    def more(self, number: int) -> tuple[memoryview | None, int, int]:
        """Memory, position and end of the ring's chunk `number`; end -1 where it can't grow any more.

        The newest chunk can be asked for again: the tick that got it may have been interrupted.
        """
        if number == len(self._chunks):
            self._chunks.append(self._segment.next_chunk(self._schema.ring))
        for full in range(self._given, number - 1):
            self._chunks[full] = None
        self._given = max(self._given, number - 1)
        chunk = self._chunks[number]
        if chunk is None:
            return None, 0, -1
        return chunk.words, 0, chunk.rows * self._schema.row_words

    def newest(self, row: int) -> tuple[memoryview, int] | None:
        """Where a row of the present chunk or of the one before stands: memory and position."""
        number, slot = divmod(row, self._schema.capacity)
        chunk = self._chunks[number] if number < len(self._chunks) else None
        return None if chunk is None else (chunk.words, slot * self._schema.row_words)
