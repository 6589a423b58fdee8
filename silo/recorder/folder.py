"""Where clients may record to: folders inside the logger's own, whatever they ask for. Pure rules."""

from pathlib import Path

from silo.rpc.refusals import RefusedWhy, RequestRefusedError

DEFAULT = "recordings"
MOST_LETTERS = 1000


def recording_folder(asked: str, own: Path, *, anywhere: bool) -> Path:
    """Return the folder that is meant by a path relative to the logger's folder, or an absolute one inside it.

    Raises RequestRefusedError for any other. `anywhere`: the robot program asks, which may write where it likes.
    """
    asked = asked or DEFAULT
    if len(asked) > MOST_LETTERS or not asked.isprintable():
        raise RequestRefusedError(
            RefusedWhy.INVALID, f"this is not the path of a folder: {asked[:80]!r}; nothing is recorded"
        )
    path = own / asked
    if anywhere:
        return path
    where = f"recordings go to {own} or folders below it; nothing is recorded"
    if ".." in Path(asked).parts or not path.is_relative_to(own):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: is outside of the logger's folder; {where}")
    found = path.resolve()
    if not found.is_relative_to(own.resolve()):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: leads out of the logger's folder by a link; {where}")
    if found.exists() and not found.is_dir():
        raise RequestRefusedError(RefusedWhy.INVALID, f"{asked}: is a file; name a folder; nothing is recorded")
    return found
