"""Views of the terminal that are kept beside the logger's script."""

from pathlib import Path

from silo.helper import view_folder
from silo.helper.answers.table import Parts, answers_to
from silo.helper.lanes import Lane
from silo.ipc.messages import Done, KeepView, KeptView, KeptViews, ListKeptViews, ReadKeptView


@answers_to(ListKeptViews)
def _list_views(parts: Parts, _: ListKeptViews) -> KeptViews:
    own = Path(parts.mirror.now.robot.script)
    return KeptViews(str(view_folder.folder_of(own)), view_folder.names(own))


@answers_to(ReadKeptView)
def _read_view(parts: Parts, request: ReadKeptView) -> KeptView:
    path, text = view_folder.read(Path(parts.mirror.now.robot.script), request.name)
    return KeptView(str(path), text)


@answers_to(KeepView, lane=Lane.DISK)
def _keep_view(parts: Parts, request: KeepView) -> Done:
    own = Path(parts.mirror.now.robot.script)
    path = view_folder.keep(own, request.name, request.text, overwrite=request.overwrite)
    return Done(f"view kept on the robot: {path}")
