"""What a logger does for its predecessors at its first start: it makes room, and says what of theirs is in no file.

It saves nothing: the program waits for its start. Its helper process saves it as soon as clients can come.
"""

import contextlib
import logging

from silo.collecting.left_behind import predecessors, segment_folder, sweep_segments
from silo.collecting.left_journals import find_stale_journals, sweep_journals
from silo.errors import SiloError
from silo.model import LoggerOptions

log = logging.getLogger("silo")


def look_back(options: LoggerOptions, *, served: bool) -> None:
    """Remove what dead processes left that holds no data; without a helper, warn of what predecessors left unsaved."""
    from silo.files.atomic import sweep_parts

    # a start doesn't fail for what others left; where there is no folder to look into, the start itself says so
    with contextlib.suppress(SiloError, OSError):
        sweep_segments(segment_folder(options))
        sweep_parts(options.folder)
        sweep_journals(options.folder)
        for stale in [*predecessors(options), *find_stale_journals(options.folder, options)] if not served else ():
            held = stale.holdings.text if stale.holdings else ""
            log.warning(
                "an earlier run of logger '%s' ended without close(); it left %s, in no file: "
                "`silo recover %s` saves it, and frees its memory",
                options.name,
                held,
                stale.path,
            )
