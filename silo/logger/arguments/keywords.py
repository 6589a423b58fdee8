"""The types of what programs write in calls of a logger, so that type checkers and editors tell of a mistake first.

Words are those of `silo.settings.options`; a test holds both to each other. At run time more is taken: any case,
NumPy's numbers, `"*2"`.
"""

import enum
from collections.abc import Mapping, Sequence
from typing import Literal, SupportsIndex, TypeAlias, TypedDict, Union

import numpy as np

from silo.core.elements import Action, BufferType, Storage, Threads

ActionWord: TypeAlias = Literal["save", "publish", "both", "save_and_publish"]
BufferWord: TypeAlias = Literal["looping", "fixed", "growing"]
SwitchWord: TypeAlias = Literal["on", "off"]
StorageWord: TypeAlias = Literal["memory", "disk", "file"]
ThreadsWord: TypeAlias = Literal["single", "serialized"]
GroupRoleWord: TypeAlias = Literal["viewer", "operator"]
ControlWord: TypeAlias = Literal["any", "one"]

Number: TypeAlias = SupportsIndex | str  # a whole number, also NumPy's, or words such as "50Hz", "10s", "10k"
Switch: TypeAlias = Union[bool, "np.bool_", SwitchWord]
AnyAction: TypeAlias = Action | ActionWord
AnyBuffer: TypeAlias = BufferType | BufferWord
AnyStorage: TypeAlias = Storage | StorageWord
AnyThreads: TypeAlias = Threads | ThreadsWord
Labels: TypeAlias = type[enum.Enum] | Mapping[int, str]


class ElementKeywords(TypedDict, total=False):
    """The keywords of `log.add`, as `log.array` takes them."""

    attr: str | None
    group: str
    unit: str
    divider: Number
    action: AnyAction
    buffer: AnyBuffer
    size: Number | None
    enabled: Switch
    kind: str
    labels: Labels | None
    description: str
    string_bytes: SupportsIndex | None
    limits: Sequence[float | None] | None


class OptionKeywords(TypedDict, total=False):
    """The keywords of `log.set`: each option of an element, by any of its names."""

    enabled: Switch
    on: Switch
    log: Switch
    logging: Switch
    divider: Number
    div: Number
    action: AnyAction
    act: AnyAction
    buffer: AnyBuffer
    buf: AnyBuffer
    size: Number
