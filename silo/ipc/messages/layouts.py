"""Views of the terminal that are kept on the robot, beside the logger's script: texts that the robot only keeps."""

from typing import ClassVar

from silo.ipc.messages.base import Do, Done, Reply, SlowAsk


class KeptViews(Reply, frozen=True):
    """The names of the views in `folder`."""

    folder: str
    names: list[str]


class KeptView(Reply, frozen=True):
    """A view's text, YAML; `path` as it stands on the robot."""

    path: str
    text: str


class ListKeptViews(SlowAsk[KeptViews], frozen=True):
    """Which views are kept beside the logger's script?"""


class ReadKeptView(SlowAsk[KeptView], frozen=True):
    """What stands in a view?"""

    name: str


class KeepView(Do[Done], frozen=True):
    """Keep a view under a plain name; refused if there is one and it may not be written over."""

    timeout_s: ClassVar[float] = 15.0
    needs_control: ClassVar[bool] = False

    name: str
    text: str
    overwrite: bool = False
