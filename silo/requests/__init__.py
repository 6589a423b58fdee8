# ruff: noqa: I001 - a line per name
"""What travels between a logger's helper process and its clients: all requests and replies, by the names that they have
on the way. How they are declared: `silo.rpc.declaring`.
"""

import functools
import operator
from typing import TYPE_CHECKING, Any, TypeAlias

from silo.conditions.requests import Alarms as Alarms, Triggers as Triggers, TriggerTried as TriggerTried
from silo.rpc.declaring import (
    Ask as Ask,
    Do as Do,
    Done as Done,
    GoesOn as GoesOn,
    Reply as Reply,
    ReplyT as ReplyT,
    Request as Request,
    RobotRequest as RobotRequest,
    SlowAsk as SlowAsk,
    leaves as leaves,
    reply_type as reply_type,
    spoken as spoken,
)
from silo.rpc.refusals import Refused as Refused, RefusedWhy as RefusedWhy
from silo.state.event_requests import Events as Events, Marked as Marked
from silo.recordings.requests import (
    GetPiece as GetPiece,
    PartOfRecording as PartOfRecording,
    Piece as Piece,
    RecorderInfo as RecorderInfo,
    RecorderStarted as RecorderStarted,
    Recorders as Recorders,
    RecordingFile as RecordingFile,
    RecordingParts as RecordingParts,
    Recordings as Recordings,
    Save as Save,
    SaveStarted as SaveStarted,
    SavedRecording as SavedRecording,
    StartRecorder as StartRecorder,
    StopRecorder as StopRecorder,
)
from silo.state.requests import (
    GetSummary as GetSummary,
    Hello as Hello,
    HelloReply as HelloReply,
    StatusReply as StatusReply,
    SummaryReply as SummaryReply,
    Unsaved as Unsaved,
    unsaved_of as unsaved_of,
)
from silo.scripts.requests import (
    ApplyEdits as ApplyEdits,
    EditsApplied as EditsApplied,
    KeptView as KeptView,
    KeptViews as KeptViews,
    ScriptDiff as ScriptDiff,
    Scripts as Scripts,
    ScriptText as ScriptText,
    TableReply as TableReply,
)
from silo.history.requests import (
    By as By,
    ClosePin as ClosePin,
    CloseStream as CloseStream,
    Columns as Columns,
    GetHistory as GetHistory,
    GetSamples as GetSamples,
    KeepPin as KeepPin,
    OpenPin as OpenPin,
    OpenStream as OpenStream,
    PinOpened as PinOpened,
    SampleRows as SampleRows,
    StreamOpened as StreamOpened,
    by_of as by_of,
)
from silo.history.search_requests import (
    FindMoments as FindMoments,
    FoundIn as FoundIn,
    MeasureSpan as MeasureSpan,
    MomentsFound as MomentsFound,
    SpanFacts as SpanFacts,
    SpanMeasured as SpanMeasured,
)
from silo.live.requests import (
    CloseView as CloseView,
    GetSurvey as GetSurvey,
    OpenView as OpenView,
    Survey as Survey,
    ViewOpened as ViewOpened,
)
from silo.control.requests import (
    GiveControl as GiveControl,
    ReleaseControl as ReleaseControl,
    TakeControl as TakeControl,
)

if TYPE_CHECKING:
    AnyAsk: TypeAlias = Ask[Any]
    AnyDo: TypeAlias = Do[Any]
    AnyReply: TypeAlias = Reply
else:  # the unions of all of them, by whose tags msgspec decodes
    AnyAsk = functools.reduce(operator.or_, leaves(Ask))
    AnyDo = functools.reduce(operator.or_, leaves(Do))
    AnyReply = functools.reduce(operator.or_, leaves(Reply))


def __getattr__(name: str) -> type[Request[Any]]:
    """Return a request that a method declares, by its name on the way: `SetTrigger`."""
    for kind in leaves(Request):
        if kind.__name__ == name:
            found: type[Request[Any]] = kind
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
