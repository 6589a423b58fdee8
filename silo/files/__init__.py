"""Recordings to files and back: `.silo`, CSV, bags, Parquet, MATLAB, NumPy, HDF5.

Nothing here knows a logger, a process or a screen.

`formats` lists what there is and may be imported by anybody; it loads no format and no NumPy.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from silo.files.saving import LogOfRun, PartlySavedError, write, write_run

__all__ = ["LogOfRun", "PartlySavedError", "write", "write_run"]


def __getattr__(name: str) -> object:
    """Import what saves when it is asked for: the list of formats alone must not load NumPy."""
    if name not in __all__:
        raise AttributeError(f"module 'silo.files' has no attribute '{name}'")
    from silo.files import saving

    return getattr(saving, name)
