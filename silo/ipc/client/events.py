"""The event log, and marks in it."""

from silo.arguments import line, whole
from silo.calls import told_class
from silo.ipc.client.calling import Calls
from silo.ipc.messages import AddMark, GetEvents
from silo.model import LoggedEvent


@told_class("client")
class EventCalls(Calls):
    """The event log."""

    def events(self, since: int = 0, limit: int = 1000) -> list[LoggedEvent]:
        """Return what happened after line `since` of the event log: the newest `limit` lines of it, oldest first.

        Args:
            since: the number of a line; `number` of the last line returned is the next one.
            limit: how many lines at most.

        Returns:
            Events with their ticks, time stamps in ns, and who did it.

        Raises:
            RefusedError: the limit is out of range.
            ConnectionLostError: the helper process doesn't answer.
        """
        return self._call(GetEvents(since=since, limit=limit, client=self._name)).events

    def mark(self, text: str, tick: int | None = None, *, at_ns: int | None = None) -> LoggedEvent:
        """Mark a tick of the present run, by default the newest, with some words.

        Args:
            text: the words.
            tick: which tick since start; the newest if it isn't given.
            at_ns: a time stamp in ns instead; the newest tick up to it is marked.

        Returns:
            The line of the event log.

        Raises:
            ElementError: the words or a number make no sense.
            RefusedError: there is no such tick any more; nothing was marked.
            ConnectionLostError: the helper process doesn't answer.
        """
        request = AddMark(
            text=line("text", text, 'client.mark("slipped")'),
            tick=-1 if tick is None else whole("tick", tick, 0, 2**62),
            at_ns=0 if at_ns is None else whole("at_ns", at_ns, 1, 2**63 - 1),
            client=self._name,
        )
        return self._call(request).event
