# ruff: noqa: I001 - a line per name
"""What travels between a logger's helper process and its clients.

All are msgspec structs in msgpack. Requests that only read go to the key `ask`, those that change something to `do`:
two keys, so that roles can be given by access control. Every request gets exactly one reply.

A request says here all that there is to know of it: its fields, its key, its reply, how long its client waits. What is
done is one handler in `silo.helper.answers` (and, if the robot process does it, one in `silo.logger.answers`); who asks
calls a method of `silo.ipc.client.Client`. A module per topic; all their names are imported from here.
"""

import functools
import operator
from typing import TYPE_CHECKING, Any, TypeAlias

from silo.ipc.messages.base import (
    Ask as Ask,
    Do as Do,
    Done as Done,
    GoesOn as GoesOn,
    Refused as Refused,
    RefusedWhy as RefusedWhy,
    Reply as Reply,
    ReplyT as ReplyT,
    Request as Request,
    RobotRequest as RobotRequest,
    SlowAsk as SlowAsk,
    leaves as leaves,
    spoken as spoken,
    reply_type as reply_type,
)
from silo.ipc.messages.state import (
    GetStatus as GetStatus,
    GetSummary as GetSummary,
    Hello as Hello,
    HelloReply as HelloReply,
    Restart as Restart,
    Start as Start,
    StatusReply as StatusReply,
    Stop as Stop,
    SummaryReply as SummaryReply,
    Unsaved as Unsaved,
    unsaved_of as unsaved_of,
)
from silo.ipc.messages.elements import (
    ApplyEdits as ApplyEdits,
    EditsApplied as EditsApplied,
    GetTable as GetTable,
    TableReply as TableReply,
)
from silo.ipc.messages.scripts import (
    DiffScript as DiffScript,
    ListScripts as ListScripts,
    LoadScript as LoadScript,
    ReadScript as ReadScript,
    SaveScript as SaveScript,
    ScriptDiff as ScriptDiff,
    ScriptText as ScriptText,
    Scripts as Scripts,
)
from silo.ipc.messages.layouts import (
    KeepView as KeepView,
    KeptView as KeptView,
    KeptViews as KeptViews,
    ListKeptViews as ListKeptViews,
    ReadKeptView as ReadKeptView,
)
from silo.ipc.messages.events import (
    AddMark as AddMark,
    Events as Events,
    GetEvents as GetEvents,
    Marked as Marked,
)
from silo.ipc.messages.samples import (
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
from silo.ipc.messages.moments import (
    FindMoments as FindMoments,
    FoundIn as FoundIn,
    MeasureSpan as MeasureSpan,
    MomentsFound as MomentsFound,
    SpanFacts as SpanFacts,
    SpanMeasured as SpanMeasured,
)
from silo.ipc.messages.views import (
    CloseView as CloseView,
    GetSurvey as GetSurvey,
    OpenView as OpenView,
    Survey as Survey,
    ViewOpened as ViewOpened,
)
from silo.ipc.messages.files import (
    DeleteRecording as DeleteRecording,
    GetParts as GetParts,
    GetPiece as GetPiece,
    ListRecordings as ListRecordings,
    PartOfRecording as PartOfRecording,
    Piece as Piece,
    RecordingFile as RecordingFile,
    RecordingParts as RecordingParts,
    Recordings as Recordings,
    Save as Save,
    SaveStarted as SaveStarted,
    SavedRecording as SavedRecording,
)
from silo.ipc.messages.recorders import (
    ListRecorders as ListRecorders,
    RecorderInfo as RecorderInfo,
    RecorderStarted as RecorderStarted,
    Recorders as Recorders,
    StartRecorder as StartRecorder,
    StopRecorder as StopRecorder,
)
from silo.ipc.messages.conditions import (
    Acknowledge as Acknowledge,
    Alarms as Alarms,
    ArmTrigger as ArmTrigger,
    ForceTrigger as ForceTrigger,
    GetLimits as GetLimits,
    GetTriggers as GetTriggers,
    RemoveLimits as RemoveLimits,
    RemoveTrigger as RemoveTrigger,
    SetLimits as SetLimits,
    SetTrigger as SetTrigger,
    TriggerTried as TriggerTried,
    Triggers as Triggers,
    TryTrigger as TryTrigger,
)
from silo.ipc.messages.control import (
    GiveControl as GiveControl,
    ReleaseControl as ReleaseControl,
    TakeControl as TakeControl,
)
from silo.ipc.messages.derived import (
    RemoveDerived as RemoveDerived,
    SetDerived as SetDerived,
)

if TYPE_CHECKING:
    AnyAsk: TypeAlias = Ask[Any]
    AnyDo: TypeAlias = Do[Any]
    AnyReply: TypeAlias = Reply
else:  # the unions of all of them, by whose tags msgspec decodes
    AnyAsk = functools.reduce(operator.or_, leaves(Ask))
    AnyDo = functools.reduce(operator.or_, leaves(Do))
    AnyReply = functools.reduce(operator.or_, leaves(Reply))
