"""Bags that silo wrote, read as a whole."""

from dataclasses import replace

from silo.core.recording import keep_quiet, read_whole
from silo.files.bag_reader import _mapped, _opened
from silo.files.mcap.damage import damage_told


def read_bag(path):
    """As `open_bag`, with all values read; raises FileFormatError for bags of others, too."""
    file, data = _mapped(path)
    with damage_told(file):
        found = _opened(file, data)
        if found is None:
            raise ValueError("this bag was not written by silo, or was cut off before its table")
    keep_quiet(found)
    read_whole(found)
    return replace(found, warnings=tuple(found.warnings))
