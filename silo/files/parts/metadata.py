"""What a part of an endless recording says of itself at its beginning, so that it is read whole, open or cut short.

A part is an MCAP file whose chunks each hold rows of one ring; a message's sequence number is its row's, so that it is
known of every sample at which tick it was taken, and of every missing one that it is missing.
"""

from collections.abc import Mapping

import msgspec

from silo.files.bags.metadata import RecordingFacts, unpack_facts
from silo.files.formats import OPEN_PART_ENDING

PART_ATTACHMENT = "silo/part.json.zst"
PART_ENDING = OPEN_PART_ENDING
LOST_METADATA = "silo/lost"
TOTALS_METADATA = "silo/totals"
PART_VERSION = 1
SEQUENCES = 2**32  # a message counts in 32 bits
EVENTS_RING = -1  # stands for the event log, whose lines are its rows: they have a channel and no ring


class RingFacts(msgspec.Struct, frozen=True):
    """The channels that a ring's rows fill; `begin` is the row with which the part goes on from the one before it.

    Of `EVENTS_RING` rows are numbers of events, of which a part has only those of its run: they rise with gaps.
    """

    ring: int
    divider: int
    begin: int
    channels: list[int]


class PartFacts(msgspec.Struct, frozen=True):
    """`recording` has counts and time stamps of none: they follow from the messages. `run` is the logger's run.

    `since` is the tick from which on that is recorded, of which there may be parts before this one; -1 in older parts.
    """

    version: int
    recorder: str
    run: str
    rings: list[RingFacts]
    recording: RecordingFacts
    since: int = -1

    @property
    def value_rings(self) -> list[RingFacts]:
        """The rings whose rows are samples."""
        return [ring for ring in self.rings if ring.ring != EVENTS_RING]

    def ring_of(self, channel: int, channels: int) -> RingFacts | None:
        """The ring whose rows a chunk with messages of so many channels, this one first, holds; None if not of all."""
        ring = next((ring for ring in self.rings if channel in ring.channels), None)
        return ring if ring is not None and len(ring.channels) == channels else None

    def samples(self, counts: Mapping[int, int]) -> int:
        """How many of these messages, by channel, are samples."""
        return sum(counts.get(channel, 0) for ring in self.value_rings for channel in ring.channels)


def unpack_part(data: bytes) -> PartFacts:
    """Raises ZstdError, MsgspecError or ValueError for damaged bytes."""
    facts = unpack_facts(PartFacts, data)
    if facts.version != PART_VERSION:
        raise ValueError(f"part version {facts.version} is newer than this silo reads ({PART_VERSION})")
    return facts


def row_of(sequence: int, begin: int) -> int:
    """The row that a sequence number means, of a part that begins with row `begin`."""
    return begin + (sequence - begin) % SEQUENCES
