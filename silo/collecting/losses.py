"""What a memory limit cost, as users count: in samples. Rings count rows, with a sample of each of their elements."""

from collections import Counter

from silo.collecting.segment_reader import SegmentReader


def lost_samples(reader: SegmentReader) -> int:
    """Return how many samples could not be kept since start, all elements together."""
    if not reader.lost:
        return 0
    elements = Counter(element.ring for element in reader.schema.elements)
    return sum(count * reader.ring_lost(ring) for ring, count in elements.items())
