"""What a memory limit or a full folder cost, as users count: in samples.

Rings count rows, with a sample of each of their elements.
"""

from collections import Counter

from silo.collecting.rows import RowSource


def lost_samples(source: RowSource) -> int:
    """Return how many samples could not be kept since start, all elements together."""
    rows = {ring.ring: lost for ring in source.schema.rings if (lost := source.ring_lost(ring.ring))}
    if not rows:
        return 0
    elements = Counter(element.ring for element in source.schema.elements if element.ring in rows)
    return sum(count * rows[ring] for ring, count in elements.items())
