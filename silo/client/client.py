"""The client of one logger, as one class: what is declared by features, and what takes more than a request.

Views, streams, pins and control are leases that it renews; the connection comes back by itself.
"""

import contextlib
import itertools
import os
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, NoReturn, TypeVar

import msgspec

from silo.client.connection import Connection, LoggerEndedError
from silo.client.parameters import ClientParameters
from silo.client.renewals import ControlLease, Renewals
from silo.client.saves import Saves
from silo.conditions.given import TakesConditions
from silo.conditions.requests import ConditionRequests
from silo.control.requests import LONGEST_LEASE_S, ControlRequests, TakeControl
from silo.core.arguments import path, real, shown, switch, text, texts, whole
from silo.core.calls import told_class, told_names
from silo.core.conditions import CLIENTS_KEEP
from silo.core.elements import SavedFile
from silo.core.quantities.writing import html_table
from silo.errors import ArgumentError, ConnectionLostError, ElementError, RefusedError, SiloError
from silo.fleet.exchange import NoAnswerError, client_name
from silo.fleet.resolving import awaited, discover
from silo.history.requests import By, GetHistory, GetSamples, KeepPin, OpenPin, OpenStream
from silo.history.search_arrays import SearchRequests
from silo.live.requests import GetSurvey, OpenView, Survey
from silo.net.access.senders import READ_ONLY, READ_ONLY_WORDS, viewer_words
from silo.net.found import LoggerAddress, logger_of
from silo.net.keys import ClientId, Root
from silo.parameters.requests import ParameterRequests
from silo.recorder.requests import RecorderRequests
from silo.recordings.requests import RecordingRequests
from silo.rpc.declaring import Ask, Do, ReplyT, Request, RobotRequest
from silo.rpc.leases import Closing
from silo.rpc.published import Event
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, checked, meant
from silo.rpc.words import full_name, why_silent
from silo.scripts.requests import ScriptRequests
from silo.state.requests import EventRequests, Hello, HelloReply, StateRequests, TableRequests
from silo.state.table_parts import TableParts
from silo.version import VERSION

if TYPE_CHECKING:
    from pathlib import Path

    from silo.core.arrays.columns import HistoryColumns
    from silo.history.arrays import Pin, SampleArrays, Stream
    from silo.live.topic import Topic
    from silo.live.view import View
    from silo.requests import AnyReply

# members of before, which work for one release: first silo's own, of its terminal and its bridges
_OTHER_NAMES = {
    # members of 0.1
    **dict.fromkeys(
        ("act_for", "hello", "identity", "keep_view", "kept_view", "kept_views", "measure", "survey", "try_now"),
        "it is silo's own",
    ),
    "set_limits": "it is client.limit('x', (red_low, yellow_low, yellow_high, red_high))",
    "remove_limits": "it is client.limit('x', None)",
    "set_trigger": "it is client.trigger('fall', 'x > 1')",
    "remove_trigger": "it is client.trigger('fall', None)",
    "remove_derived": "it is client.derive('x', None)",
}
_Fed = TypeVar("_Fed", "View", "Stream")
LEASE_S = 15.0  # of control that is renewed: seven renewals, or 15 s of a link that is away
LONGEST_S = 1e6  # that anybody waits


@told_names("a client", _OTHER_NAMES)
@told_class("client", make="Client", shared=TakesConditions, returns=str)
class Client(  # `trigger` and `limit` stand in silo/conditions/given.py, `find` in silo/history/search_arrays.py
    StateRequests, TableRequests, EventRequests, ScriptRequests, ControlRequests, ConditionRequests, SearchRequests,
    RecordingRequests, RecorderRequests, ParameterRequests, TakesConditions[str], Closing,
):  # fmt: skip
    """A connection to one logger. A context manager."""

    _held: ControlLease | None = None
    _kept = CLIENTS_KEEP

    def __init__(self, found: LoggerAddress, timeout_s: float = Ask.timeout_s, *, read_only: bool = False) -> None:
        """Connect to a logger that was found; `connect` looks for it.

        Args:
            found: which logger.
            timeout_s: how long to wait for an answer, at least.
            read_only: send nothing that changes something.

        Raises:
            ConnectionLostError: nobody answers.
            ElementError: that is no logger that was found.
        """
        if not isinstance(found, LoggerAddress):
            raise ElementError(f"a client is made by silo.connect('robot'), got {shown(found)}")
        self._timeout_s = timeout_s
        self.read_only = read_only
        self._name = client_name()
        self._surveyed = ClientId.drawn()  # what its statistics are called after, whatever becomes of the link
        self._drawn, self._numbers = os.urandom(6).hex(), itertools.count(1)  # of changes
        self._saves = Saves()
        self._parts = TableParts() if found.config else None
        self._connection = Connection(found, timeout_s, self._name, read_only=read_only)
        self._leases = Renewals(self._connection, lambda: self._name)
        self.on_event(self._saves.note)
        self.on_link(self._saves.note_link)
        self._connection.watch(self._leases.renew)

    @classmethod
    def connect(
        cls,
        logger: "str | LoggerAddress" = "",
        timeout_s: float = Ask.timeout_s,
        config: str = "",
        *,
        read_only: bool = False,
    ) -> "Client":
        """Connect to a logger.

        Args:
            logger: what `discover` found, an address (`robot3/anymal`; a bare name, where only one has it, `name.pid`
                of several on this computer, `host~id/name` of several hosts of one name), or empty for the only one.
            timeout_s: how long to wait for an answer, or for a helper process that is being replaced, at least.
            config: a remote or a Zenoh configuration, to look there alone; `local` for this computer alone.
            read_only: send nothing that changes something, whatever the role; calls that would raise RefusedError.

        Returns:
            A client; close it, or use it as a context manager.

        Raises:
            ConnectionLostError: there is none, or several could be meant; the message says what to do.
        """
        switch("read_only", read_only)
        timeout_s = real("timeout_s", timeout_s, 0, LONGEST_S, "s", include_low=False)
        if isinstance(logger, LoggerAddress):
            return cls(logger, timeout_s, read_only=read_only)
        text("logger", logger, 'Client.connect("robot")')
        text("config", config, 'Client.connect("robot", config="client.json5")')
        with ExitStack() as holding:
            until_s = time.monotonic() + timeout_s
            while True:
                found = awaited(logger, lambda: discover(timeout_s, config, holding), timeout_s)
                try:
                    return cls(found, timeout_s, read_only=read_only)
                except LoggerEndedError as ended:  # who is there in its place is meant
                    with contextlib.suppress(ConnectionLostError):
                        there = discover(timeout_s, config, holding).named(logger_of(logger))
                        if there and time.monotonic() < until_s:
                            continue
                    raise ended from None

    @property
    def parameters(self) -> ClientParameters:
        """The parameters of the logger, by name: `client.parameters["kp"] = 50.0` waits until that holds."""
        return ClientParameters(self)

    def _act_for(self, caller: str) -> None:
        """Say of changes for whom they are made, in words that events have: as a bridge does."""
        self._name = f"{client_name()} for {caller}"

    def __getitem__(self, name: object) -> NoReturn:
        # what iterating comes to as well
        raise ArgumentError(
            "a client is a connection, not values: client.topic('x') reads them live, "
            "client.samples(['x'], ...) what the buffers hold; client.table().elements are the elements"
        )

    def __repr__(self) -> str:
        found = self.found
        where = f" on {found.host}" if found.config else ""
        return f"<Client of {found.label}{where}: {self._state_word}>"

    def _repr_html_(self) -> str:
        found = self.found
        where = found.host if found.config else "this one"
        rows = [("logger", found.label), ("user", found.user), ("host", where), ("state", self._state_word)]
        return html_table(f"Client of {found.label}", ("", ""), rows)

    @property
    def _state_word(self) -> str:
        return "closed" if self._connection.closed else "connected" if self.connected else "not connected"

    @property
    def found(self) -> LoggerAddress:
        """Which logger this is; changes when the robot program was started anew."""
        return self._connection.found

    @property
    def _identity(self) -> str:
        """By which the logger tells this user from other operators: its name over a network; empty without a link."""
        return self._connection.identity

    @property
    def connected(self) -> bool:
        """Whether the helper process answers."""
        return self._connection.connected

    def on_event(self, callback: Callable[[Event], None]) -> None:
        """Call back for every event, in a thread of its own; for what comes without a link, when it is back.

        Of that for the newest 256; `events()` has all.

        Args:
            callback: must not wait long.
        """
        self._connection.event_callbacks.append(callback)

    def on_link(self, callback: Callable[[bool], None]) -> None:
        """Call back when the connection is lost or there again.

        Args:
            callback: gets False when the helper process is gone, True when one is there again.
        """
        self._connection.link_callbacks.append(callback)

    def _try_now(self) -> None:
        """Look for the helper process at once, where the link is lost.

        It is looked for by itself five times a second. This returns before it is found: `connected` and `on_link` tell.
        """
        self._connection.try_now()

    def close(self) -> None:
        """End views and connection, and release control; closing twice is fine."""
        if self._held is not None and self.connected:
            with contextlib.suppress(SiloError):  # else its lease ends it
                self.release_control()
        self._connection.close()
        self._saves.wake()

    # --------------------------------------------------------------------------------------------------------- asking

    def _call(self, request: Request[ReplyT]) -> ReplyT:
        changes = request.key == Do.key
        if changes and self.read_only:
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, READ_ONLY_WORDS)
        numbered = {"number": f"{self._drawn}-{next(self._numbers)}"} if changes else {}
        request = msgspec.structs.replace(request, client=self._name, **numbered)
        asked = self._asked
        try:
            reply = self._connection.exchange(request, max(request.timeout_s, self._timeout_s))
        except NoAnswerError:
            if not changes:
                raise
            reply = self._after_silence(request, asked)
        except (OverflowError, UnicodeEncodeError) as error:
            raise ElementError(f"{type(request).__name__} can't be sent: {error}; nothing was asked") from None
        return checked(request, reply)

    @property
    def _asked(self) -> tuple[Root, int]:
        """The logger, and the process id of its helper, that is asked now."""
        return self._connection.root, self._connection.helper_pid

    def _after_silence(self, request: Request[ReplyT], asked: tuple[Root, int]) -> "AnyReply":
        """Return the answer to a change that got none: asked for again where it isn't done twice, or why it isn't done.

        The end of an answer may overtake it, and a helper process may end before it answers. Raises ConnectionLostError
        where nobody knows whether it was done.
        """
        timeout_s = max(request.timeout_s, self._timeout_s)
        until_s = time.monotonic() + timeout_s
        while self._connection.is_back(until_s):
            try:
                # first what reads, which waits for the link: else a cut would look like rules that swallow changes
                told = self._call(self._question)
                why = self._why_no_changes(told)
            except ConnectionLostError:
                continue
            if why:
                return self._told_why(request, why)
            root, pid = self._asked
            # what the robot program did it tells each helper process, which knows by itself what else was done
            if not told.numbered or root != asked[0] or (pid != asked[1] and not isinstance(request, RobotRequest)):
                break
            with contextlib.suppress(NoAnswerError):
                again = msgspec.structs.replace(request, asked_pid=asked[1])
                return self._connection.exchange(again, timeout_s)
        who = self._connection.label_of(self._connection.found)
        text = f"{who} gave no answer to {type(request).__name__}; look whether it was done before trying again"
        raise ConnectionLostError(text) from None

    def _told_why(self, request: Request[ReplyT], why: str) -> "AnyReply":
        """Ask under the key for those whom rules keep from `do`: the robot says why, and tells who sits before it."""
        with contextlib.suppress(NoAnswerError):  # a robot, or rules, of before
            return self._connection.exchange(request, self._timeout_s, refused=True)
        return Refused(RefusedWhy.FORBIDDEN, why)

    @property
    def _question(self) -> Hello:
        return Hello(version=VERSION, client=self._name)

    def _hello(self) -> HelloReply:
        """Return who is there, whether this user may change anything, and why not."""
        reply = self._call(self._question)
        why_not = self._why_no_changes(reply)
        return reply if not why_not else msgspec.structs.replace(reply, may_edit=False, why_not=why_not)

    def _why_no_changes(self, told: HelloReply) -> str:
        """Return why this user's changes get no answer from a logger that has just `told` who it is; empty: they do."""
        if self.read_only:
            return READ_ONLY
        while True:
            asked = told
            try:
                reply = self._connection.exchange(self._question, self._timeout_s, as_change=True)
            except NoAnswerError:  # access control swallows what isn't allowed: no answer on this key is the answer
                told = self._call(self._question)
                if told.status.helper_pid == asked.status.helper_pid:  # else it had ended, and the next one is asked
                    return told.why_not or viewer_words(self._connection.user, self._connection.root.address)
            else:
                return reply.text if isinstance(reply, Refused) else ""

    # -------------------------------------------------------------------------------------------------------- control

    def take_control(
        self,
        *,
        force: bool = False,
        lease_s: float | None = None,
        on_lost: Callable[[str], None] | None = None,
    ) -> str:
        """Take control: from now on no other user changes anything, until it is released, given away or taken.

        It is kept while this client lives and its link does, and ends 15 s after; with a `lease_s` of your own it goes
        on without this client.

        Args:
            force: take it from whoever has it; everybody is told.
            lease_s: how long it lasts without being renewed, 1 s to a day; None: renewed by this client.
            on_lost: called with the reason when somebody else has it by now; in a thread of the connection.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: somebody else has it, since when, and the way out; or this user may not change anything.
        """
        switch("force", force)
        if lease_s is not None:
            lease_s = real("lease_s", lease_s, 1.0, LONGEST_LEASE_S, "s")
        words = self._call(TakeControl(lease_s=lease_s or LEASE_S, force=force)).text
        if lease_s is None:
            self._let_go()
            self._held = ControlLease(TakeControl(lease_s=LEASE_S, renew=True), on_lost)
            self._leases.add(self._held)
        return words

    def release_control(self) -> str:
        """Give control up.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: somebody else has it.
        """
        self._let_go()
        return self._release_control()

    def give_control(self, to: str) -> str:
        """Give control to another operator who is connected.

        Args:
            to: the user's name, as `status().clients` has it.

        Returns:
            What was done, in words.

        Raises:
            RefusedError: nobody of that name is connected, or somebody else has control.
        """
        text("to", to, 'client.give_control("anna")')
        words = self._give_control(to)
        self._let_go()
        return words

    def _let_go(self) -> None:
        """Renew it no more."""
        if self._held is not None:
            self._leases.drop(self._held)
        self._held = None

    # ---------------------------------------------------------------------------------------------------------- files

    def wait_saved(
        self, job: int, timeout_s: float = 600.0, progress: Callable[[float], None] | None = None
    ) -> list[SavedFile]:
        """Wait for the end of a save.

        Args:
            job: the number that `save` returned.
            timeout_s: how long to wait, s.
            progress: called with the fraction done, 0 to 1.

        Returns:
            The files: path, size in bytes.

        Raises:
            SaveError: it failed, with the reason, or takes too long.
            ConnectionLostError: the connection is lost.
        """
        whole("job (the number that save() returned)", job, 0, 2**63 - 1)
        wait_s = real("timeout_s", timeout_s, 0, LONGEST_S, "s")
        return self._saves.wait(job, wait_s, progress, lambda: self._connection.connected)

    def fetch(
        self,
        name: str,
        folder: "str | os.PathLike[str]" = ".",
        progress: Callable[[int, int], None] | None = None,
        *,
        replace: bool = False,
        patience_s: float = 30.0,
    ) -> "Path":
        """Copy a recording of the logger's folder (a file, or a bag folder) into a folder of this machine.

        In pieces, each with a checksum. When the link is cut it goes on as soon as the link is back within
        `patience_s`; what came until then is kept as `<name>.part`, and the same call later goes on behind it.

        Args:
            name: of the file or bag folder with its ending, as `recordings` has it.
            folder: where to; made where it isn't there.
            progress: called with the bytes that are here and the bytes of all of it, also while the link is cut; what
                it raises ends the call.
            replace: take the place of a file of this name that is there already.
            patience_s: how long to wait for a link that is cut, s.

        Returns:
            The path of the copy.

        Raises:
            SaveError: it is there already (without `replace`) or being fetched by another program, the disk is full, or
                the system refuses.
            ConnectionLostError: the link is cut for longer than `patience_s`, or what comes makes no sense.
            RefusedError: there is no such recording, or it was written anew meanwhile.
            ElementError: an argument makes no sense; nothing was asked.
        """
        from silo.recordings.fetching import Fetch

        wait_s = real("patience_s", patience_s, 0, LONGEST_S, "s")
        ask = Fetch(self._parts_of, self._piece_of, lambda: self._connection.connected, wait_s)
        return ask.run(
            text("name", name, "client.fetch('robot_..._00007.silo')"), path("folder", folder), progress, replace
        )

    # ----------------------------------------------------------------------------------------- what comes from now on

    def view(
        self,
        values: Sequence[str] = (),
        plots: Sequence[str] = (),
        rate_hz: float = 5.0,
        column_ns: int = 100_000_000,
    ) -> "View":
        """Open a view: newest values and fill of elements, minimum and maximum per column of entries.

        It goes on across reconnections until it is closed.

        Args:
            values: the elements.
            plots: the entries.
            rate_hz: frames per second.
            column_ns: width of a column.

        Returns:
            The view; its `frame()` gives what came since the last call.

        Raises:
            RefusedError: a name or number is out of range.
            ConnectionLostError: nobody answers.
        """
        from silo.live.view import View

        request = OpenView(
            view="",
            values=texts("values", values, "['/log/joints/q']"),
            plots=texts("plots", plots, "['/log/joints/q_0']"),
            rate_hz=rate_hz,
            column_ns=column_ns,
        )
        return self._opened(View, request)

    def _opened(self, kind: Callable[..., _Fed], request: OpenView | OpenStream) -> _Fed:
        """Open a view or a stream, and keep it up; it is closed where that fails."""
        leases = self._leases
        one: _Fed = kind(request, next(leases.numbers), lambda: leases.renew_soon(one), leases.forget)
        self._connection.attach(one)
        try:
            one.accept(self._call(one.request))
        except (RefusedError, ConnectionLostError):
            one.close()
            raise
        leases.add(one)
        return one

    def topic(self, element: str) -> "Topic":
        """Subscribe to every sample of a published element: `for batch in client.topic("joints/q"): ...`.

        Args:
            element: its name; also without the prefix, or its end behind a `/`.

        Returns:
            The subscription; close it, or use it as a context manager.

        Raises:
            ElementError: there is no such element.
        """
        return self._topic(element, self._connection.forget)

    def _topic(self, element: str, on_close: Callable[["Topic"], None]) -> "Topic":
        from silo.live.topic import Topic

        text("element", element, "client.topic('/log/joints/q')")
        name = full_name(element, self.status(), self.table())
        topic = Topic(name, on_close, lambda: why_silent(name, self.found.label, self.status(), self.table()))
        self._connection.attach(topic)
        return topic

    def stream(self, names: Sequence[str], period_s: float = 0.05) -> "Stream":
        """Subscribe to every sample of elements or entries from now on, whatever their action; iterate over it.

        It goes on across reconnections and new starts until it is closed. Numbered: what this reader is too slow for is
        counted, and never holds up the helper process.

        Args:
            names: elements or entries, at least one, as `topic` takes them.
            period_s: time between two deliveries, s.

        Returns:
            The stream, of batches with `SampleArrays` by name; close it, or use it as a context manager.

        Raises:
            RefusedError: a name is unknown, a number out of range, or too many streams are open.
            ConnectionLostError: nobody answers.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.history.arrays import Stream

        wished = texts("names", names, "['/log/joints/q']")
        return self._opened(Stream, OpenStream(stream="", names=wished, period_s=period_s))

    # --------------------------------------------------------------------------------------------------- what is held

    def history(
        self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int, pin: "Pin | None" = None
    ) -> "HistoryColumns":
        """Return past samples as minimum and maximum per column, straight from the buffers or of a pin.

        Args:
            names: 1 to 64 entries, as `topic` takes them.
            start_ns: the first time stamp.
            end_ns: the time stamp after the last.
            column_ns: width of a column; there may be at most 4096.
            pin: what to read instead of the buffers.

        Returns:
            Columns of all names, of which column k covers the time stamps from `k * column_ns` to before the next.

        Raises:
            RefusedError: a name is unknown, a number out of range, or the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.live.view import history_columns

        request = GetHistory(
            names=texts("names", names, "['/log/joints/q_0']"),
            start_ns=start_ns,
            end_ns=end_ns,
            column_ns=column_ns,
            pin=pin.id if pin is not None else "",
        )
        return history_columns(self._call(request))

    def samples(
        self,
        names: Sequence[str],
        start: int = -(2**62),
        end: int = 2**62,
        by: By | str = By.TIME,
        pin: "Pin | None" = None,
        reply_bytes: int = 2**20,
        told: Callable[[float], None] | None = None,
    ) -> "dict[str, SampleArrays]":
        """Return all samples that the buffers (or a pin) hold of elements or entries, with `start <= ... < end`.

        What comes while it is read is left out.

        Args:
            names: elements or entries, 1 to 10 000, as `topic` takes them; the result has them so, too.
            start: the first, see `by`.
            end: the one after the last, see `by`.
            by: `"time"`: the ends are time stamps in ns; `"tick"`: ticks since start; `"row"`: numbers of samples since
                start.
            pin: what to read instead of the buffers.
            reply_bytes: size of the pieces in which they are asked for, 4096 to 4 MiB.
            told: called with the share that has come, 0 to 1.

        Returns:
            By name: `ticks` and `time_ns` of shape `(n,)`, `values` of shape `(n, *shape of the element)`, oldest
            first; of a name without samples `why` there are none: it is off, overwritten up to some tick, ...

        Raises:
            RefusedError: the logger was started anew meanwhile, a name or `by` is unknown, a number out of range, or
                the pin is no more.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.history.arrays import Gathering

        request = GetSamples(
            names=texts("names", names, "['/log/joints/q']"),
            start=start,
            end=end,
            by=meant(By, "by", by, "nothing was asked"),
            reply_bytes=reply_bytes,
            pin=pin.id if pin is not None else "",
        )
        gathering = Gathering(request.names)
        while True:
            reply = self._call(request)
            gathering.take(reply)
            if told is not None:
                told(gathering.share)
            if all(row >= stop for row, stop in reply.resume):
                return gathering.samples()
            request = GetSamples(
                names=request.names, by=request.by, reply_bytes=reply_bytes, pin=request.pin, run=reply.run,
                resume=reply.resume,
            )  # fmt: skip

    def _survey(
        self,
        quantities: Sequence[str],
        names: Sequence[str] = (),
        *,
        reset: bool = False,
        derived: bool = False,
        some: Sequence[str] = (),
        some_quantities: Sequence[str] = (),
    ) -> Survey:
        """Return quantities (of `silo.live.quantities.QUANTITIES`) of elements or entries; without names of all.

        Statistics are over all samples since this client asked first (`reset`: anew), and end when it hasn't asked for
        a minute. `derived`: without names, derived signals follow. `some` are those of which `some_quantities` are
        wanted, too, of the same samples. `values` are the bytes of float64 of shape `(quantities, names)`, NaN where
        one isn't known.
        """
        request = GetSurvey(
            quantities=texts("quantities", quantities, "['mean', 'std']"),
            names=texts("names", names, "['/log/joints/q']"),
            reset=reset,
            derived=derived,
            some=texts("some", some, "['/log/joints/q']"),
            some_quantities=texts("some_quantities", some_quantities, "['mean', 'std']"),
            id=self._surveyed.id,
            proof=self._surveyed.proof,
        )
        return self._call(request)

    def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> "Pin":
        """Have the helper process keep a copy of what the buffers hold, whatever they overwrite.

        `samples` and `history` read it until it is closed. Where not all fits the newest part is kept: 64 MiB for all
        clients together.

        Args:
            names: elements or entries, 1 to 10 000.
            start_ns: the first time stamp.
            end_ns: the last time stamp.

        Returns:
            The pin; its `opened` says what is held: time stamps in ns, `size_bytes`, and of names without rows why.

        Raises:
            RefusedError: nothing of it fits, a name is unknown, a number out of range, or too many pins are open.
            ElementError: the names are no list of texts; nothing was asked.
        """
        from silo.history.arrays import Pin

        own = self._connection.mine  # of this session, which it outlives: its number is drawn
        request = OpenPin(
            pin=f"{own.id}-{int.from_bytes(os.urandom(3), 'big')}",
            proof=own.proof,
            names=texts("names", names, "['/log/joints/q']"),
            start_ns=start_ns,
            end_ns=end_ns,
        )
        opened = self._call(request)
        pin = Pin(request.names, opened, KeepPin(pin=opened.pin, proof=own.proof), self._leases.forget)
        self._leases.add(pin)
        return pin
