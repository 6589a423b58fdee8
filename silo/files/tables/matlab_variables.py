"""The variables of a `.mat` file, each unpacked by itself, and to no more than it may have.

SciPy unpacks whatever is packed: 300 kB of zeros are 2 GB of them.
"""

import io
import struct
import zlib
from pathlib import Path
from typing import Any

from silo.errors import FileFormatError

MOST_ROOM, MOST_RATIO = 64 << 20, 256  # of one of which nobody knows yet how large it may be
_HEAD, _TAG = 128, 8  # bytes of the file's head, and before each variable
_PACKED = 15  # as MATLAB's types have it


class MatlabVariables:
    """Of a file of version 5, as `savemat` writes it. Raises what SciPy does, FileFormatError for what is too much."""

    def __init__(self, path: Path, matlab: Any) -> None:
        self._path, self._matlab = path, matlab
        self._places: dict[str, tuple[int, int, int]] = {}  # by name: where its tag stands, its type and size
        with path.open("rb") as file:
            self._head = file.read(_HEAD)
            order = ">" if self._head[-2:] == b"MI" else "<"
            places, at = [], _HEAD
            while len(tag := file.read(_TAG)) == _TAG:
                kind, size = struct.unpack(f"{order}II", tag)
                places.append((at, kind, size))
                at += _TAG + size
                file.seek(at)
        names = [name for name, *_ in matlab.whosmat(path, appendmat=False)]
        if len(names) != len(places):
            raise FileFormatError(f"'{path}' has {len(places)} variables, and names of {len(names)}: it is damaged")
        for name, place in zip(names, places, strict=True):
            self._places.setdefault(name, place)

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def read(self, name: str, most: int = 0) -> Any:
        """Return a variable of up to `most` bytes; 0 where that isn't known."""
        at, kind, size = self._places[name]
        with self._path.open("rb") as file:
            file.seek(at)
            data = file.read(_TAG + size)
        most = most or max(MOST_ROOM, MOST_RATIO * size)
        packing = zlib.decompressobj()
        if kind == _PACKED:
            data = packing.decompress(data[_TAG:], most + 1)
        if len(data) > most:
            raise FileFormatError(f"'{self._path}': '{name}' has more than the {most:,} bytes that it may have")
        if kind == _PACKED and not packing.eof:  # its checksum is behind its end
            raise FileFormatError(f"'{self._path}': '{name}' is cut short")
        return self._matlab.loadmat(io.BytesIO(self._head + data), variable_names=[name])[name]
