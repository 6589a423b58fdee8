"""The event log, and marks in it."""

from silo.core.arguments import line, whole
from silo.core.calls import told_class
from silo.core.elements import LoggedEvent
from silo.rpc.declaring import Caller, Reply, ask, change


class Events(Reply, frozen=True):
    """Lines of the event log, oldest first. `missed` counts those asked for that are older and not among them."""

    events: list[LoggedEvent]
    missed: int = 0


class Marked(Reply, frozen=True):
    """The mark as it stands in the event log."""

    event: LoggedEvent


@told_class("client")
class EventRequests(Caller):
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
        return self._get_events(since, limit).events

    @ask()
    def _get_events(self, since: int = 0, limit: int = 1000) -> Events:
        """What happened after line `since` of the event log? The newest `limit` of it."""

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
        return self._add_mark(
            line("text", text, 'client.mark("slipped")'),
            -1 if tick is None else whole("tick", tick, 0, 2**62),
            0 if at_ns is None else whole("at_ns", at_ns, 1, 2**63 - 1),
        ).event

    @change(control=False, timeout_s=2.0)
    def _add_mark(self, text: str, tick: int = -1, at_ns: int = 0) -> Marked:
        """Mark a tick of the present run with some words; -1 is the newest.

        With a time stamp `at_ns`, the newest tick up to it.
        """
