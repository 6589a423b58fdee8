"""The client's end of a view: frames as arrays, merged to one per call, and the arrays of a history."""

import functools
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
import zenoh

from silo.core.arrays.columns import MAX_COLUMNS, ColumnGrid, HistoryColumns, Marks, grid_of
from silo.core.calls import told_class
from silo.core.structs import alike
from silo.decoding import msgpack_decoder
from silo.history.requests import Columns
from silo.live.requests import OpenView, ViewOpened
from silo.net.keys import ClientId, Root
from silo.net.subscribed import Subscribed
from silo.rpc.foreign import Foreign, understood
from silo.rpc.frames import Frame
from silo.rpc.published import ViewFrame

LARGEST = 2**63 - 1
RING = 64  # 6 s at 10 Hz: who reads less often gets the newest and a gap

_decoder = msgpack_decoder(ViewFrame)


def history_columns(columns: Columns) -> HistoryColumns:
    """The arrays of a reply. Raises ConnectionLostError for those that make no sense."""
    shape = (len(columns.names), columns.count)
    with understood("a history", "the helper process"):
        return HistoryColumns(
            tuple(columns.names),
            columns.first,
            columns.column_ns,
            np.frombuffer(columns.low, "<f8").reshape(shape),
            np.frombuffer(columns.high, "<f8").reshape(shape),
            _marks(columns.marks, shape),
            columns.bases,
            columns.until_ns,
        )


def _marks(data: bytes, shape: tuple[int, int]) -> Marks | None:
    return np.frombuffer(data, np.uint8).reshape(shape) if data else None


@told_class("view", shared=Subscribed)
class View(Subscribed):
    """An open view. `frame()` may be called by any thread and never waits; `close()` ends it."""

    def __init__(
        self, request: OpenView, number: int, renew: Callable[[], None], on_close: Callable[["View"], None]
    ) -> None:
        super().__init__(on_close)
        self.request = request  # its id is that of the present session
        self._place = number
        self._renew = renew
        self._opened: ViewOpened | None = None
        self._number = 0
        self._missed = 0
        self._unread: list[ViewFrame] = []
        self._merged_number = 0
        self._cut = True  # whether the next frame doesn't continue the one that was handed out last
        self.refused = ""  # why the helper process no longer feeds this view; empty if it does
        self._foreign = Foreign("a frame")

    # ---------------------------------------------------------------------------------------------- by the client

    def attach(self, session: zenoh.Session, root: Root, client: ClientId) -> None:
        """Subscribes in a session; the one before is closed already."""
        name = f"{client.id}-{self._place}"
        subscriber = session.declare_subscriber(root.key("view", name), zenoh.handlers.RingChannel(RING))
        with self._changed:
            self.request = msgspec.structs.replace(self.request, view=name, proof=client.proof)
            self._subscriber = subscriber
            self._number = 0
            self._cut = True

    def _forget(self) -> None:
        self._unread = []  # another helper process counts its generations anew

    def accept(self, opened: ViewOpened) -> None:
        """How to read the frames from now on."""
        with self._changed:
            self._opened = opened
            self.refused = ""

    def refuse(self, text: str) -> None:
        """The helper process would not renew the view."""
        with self._changed:
            self.refused = text

    # ------------------------------------------------------------------------------------------------ by the user

    def frame(self) -> Frame | None:
        """All that came since the last call as one frame, None if nothing did.

        Raises ConnectionLostError for frames that can't be understood.
        """
        with self._changed:
            if self._opened is None or self._subscriber is None:
                return None
            with understood("frames", "the helper process"):
                return self._frame(self._opened, self._subscriber)

    def _frame(self, opened: ViewOpened, subscriber: "zenoh.Subscriber[zenoh.Handler[zenoh.Sample]]") -> Frame | None:
        frames = [*self._unread, *self._new_frames(subscriber)]
        fits = functools.partial(_fits, opened=opened, elements=len(self.request.values))
        mine = [frame for frame in frames if frame.generation == opened.generation and fits(frame)]
        # after an edit or a start, frames may come before the answer that explains them
        self._unread = [frame for frame in frames if frame.generation > opened.generation][-RING:]
        if self._unread:
            self._renew()
        return self._merged(mine, opened) if mine else None

    def _new_frames(self, subscriber: "zenoh.Subscriber[zenoh.Handler[zenoh.Sample]]") -> list[ViewFrame]:
        frames: list[ViewFrame] = []
        while (sample := subscriber.try_recv()) is not None:
            decode = functools.partial(_sound, sample.payload.to_bytes())
            frame = self._foreign.read(str(sample.key_expr), decode)
            if frame is None:
                continue
            if self._number and frame.number > self._number + 1:
                self._missed += frame.number - self._number - 1
            self._number = frame.number
            frames.append(frame)
        return frames

    def _merged(self, frames: Sequence[ViewFrame], opened: ViewOpened) -> Frame:
        newest = frames[-1]
        grid = _merged_columns(frames, len(opened.plots))
        since_ns = 0
        for frame in frames:
            if frame.since_ns or self._cut or (self._merged_number and frame.number != self._merged_number + 1):
                # a frame that doesn't say from when on it is whole is so from its first column on
                since_ns = max(since_ns, frame.since_ns or _begin_ns(frame, self.request.column_ns))
            self._cut, self._merged_number = False, frame.number
        return alike(
            Frame,
            newest,
            elements=tuple(self.request.values),
            entries=tuple(opened.entries),
            plots=tuple(opened.plots),
            unpublished=frozenset(opened.unpublished),
            missing=frozenset(opened.missing),
            held=np.frombuffer(newest.held, "<i8"),
            lost=np.frombuffer(newest.lost, "<i8"),
            newest=np.frombuffer(newest.newest, "<f8"),
            column_ns=self.request.column_ns,
            first=grid.first,
            low=grid.low,
            high=grid.high,
            marks=grid.marks if grid.marks.any() else None,
            bases=grid.known_bases,
            since_ns=since_ns,
            missed=self._missed,
        )


def _sound(data: bytes) -> ViewFrame:
    """Return a frame whose numbers can be reckoned with. Raises what is NOT_UNDERSTOOD."""
    frame: ViewFrame = _decoder.decode(data)
    numbers = (frame.number, frame.time_ns, frame.first, frame.since_ns, frame.tick)
    if not all(-LARGEST <= one <= LARGEST for one in numbers) or not 0 <= frame.count <= MAX_COLUMNS:
        raise ValueError("its numbers are out of range")
    return frame


def _fits(frame: ViewFrame, opened: ViewOpened, elements: int) -> bool:
    """Return whether a frame has as much as its view: one that has not is nobody's who opened it."""
    cells = len(opened.plots) * frame.count
    return (
        len(frame.held) == len(frame.lost) == 8 * elements
        and len(frame.newest) == 8 * len(opened.entries)
        and len(frame.low) == len(frame.high) == 8 * cells
        and len(frame.marks) in (0, cells)
        and all(0 <= at < len(opened.entries) for at in frame.texts)
        and all(0 <= at < elements for at in (*frame.sizes, *frame.failed, *frame.not_live))
    )


def _begin_ns(frame: ViewFrame, column_ns: int) -> int:
    return frame.first * column_ns if frame.count else frame.time_ns


def _merged_columns(frames: Sequence[ViewFrame], plots: int) -> ColumnGrid:
    """Return the columns of several frames on one grid; of more than 4096 the newest."""
    filled = [frame for frame in frames if frame.count]
    if not filled:
        return ColumnGrid(plots, 0, 0)
    end = max(frame.first + frame.count for frame in filled)
    first = max(min(frame.first for frame in filled), end - MAX_COLUMNS)
    grid = ColumnGrid(plots, first, end - first)
    rows = range(plots)
    for frame in filled:
        shape = (plots, frame.count)
        low, high = (np.frombuffer(data, "<f8").reshape(shape) for data in (frame.low, frame.high))
        grid.lay(rows, grid_of(frame.first, low, high, _marks(frame.marks, shape), frame.bases), rows)
    return grid
