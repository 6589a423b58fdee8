"""Runs as they begin, end and are let go of: the main thread tells all who follow them here, in one order.

A run is held before anybody reads it, its marks are taken before it is over for others, and it is judged before it is
told to have begun. Who reads the present run by itself looks for another one by `silo.state.run_follower`.
"""

import contextlib
import logging
import os
from collections.abc import Iterator, Sequence

from silo.conditions.judge import Judge
from silo.core.elements import State
from silo.errors import SegmentError
from silo.helper.marks import MarkReader
from silo.helper.robot_link import RobotLink
from silo.link.channel import LetGo
from silo.live.publisher import Publisher
from silo.recorder.server import EndlessRecordings
from silo.state.events import EventNotifier
from silo.state.handover import RunOffer, taken_runs
from silo.state.held_runs import HeldRuns, tell_cut, tell_left
from silo.state.replica import LoggerSnapshot, Replica

log = logging.getLogger("silo.helper")


def taken_over(robot: RobotLink, replica: Replica, held: HeldRuns) -> Iterator[RunOffer]:
    """Take over the runs that the robot process handed over, each by itself: it is the present one until the next."""
    for offer, descriptor in taken_runs(robot.runs):
        try:
            replica.take_run(offer, descriptor)
        except SegmentError:
            os.close(descriptor)
            log.exception("a run can't be taken over")
        held.take()
        yield offer


class Runs:
    """Who follows runs, and what each is told. For the main thread alone."""

    def __init__(
        self,
        robot: RobotLink,
        replica: Replica,
        held: HeldRuns,
        events: EventNotifier,
        marks: MarkReader,
        judge: Judge,
        recording: EndlessRecordings,
        publisher: Publisher,
        early: Sequence[RunOffer],
    ) -> None:
        """`early` were taken over before anybody was there to follow them."""
        self.replica, self.recording = replica, recording
        # the run whose files somebody deleted
        self.deleted = early[-1].run if early and not early[-1].named else ""
        self._robot, self._held, self._events = robot, held, events
        self._marks, self._judge = marks, judge
        held.add(recording.needs)
        held.add(judge.needs)
        held.add(publisher.needs)

    def take(self) -> bool:
        """Take over all runs that were handed over; False if there was none."""
        taken = False
        for offer in taken_over(self._robot, self.replica, self._held):
            taken = True
            self._held.tell_starts(self._events)
            self._marks.take_run()
            self._judge.take(self.replica.run)
            self.recording.follow_present()
            self.deleted = "" if offer.named else offer.run
        return taken

    def take_state(self, now: LoggerSnapshot) -> None:
        """Take in that the robot process told another state of its run, or of one that could not be handed over."""
        self._held.take()
        if now.robot.state is State.STOPPED:
            self._marks.take()  # nothing of a run is told after its end
        self.recording.follow_present()

    def tell_cut(self) -> None:
        """Tell that the present run goes on another one, if it does."""
        with contextlib.suppress(SegmentError):
            reader = self.replica.open_reader()
            if reader is not None:
                with contextlib.closing(reader):
                    tell_cut(reader, self._events)

    def look(self, *, at_end: bool = False) -> None:
        """Let go of runs that nobody needs any more, and take in those that came by no message."""
        for run in self._held.find():
            self._take_left(run)
        self._held.tell_starts(self._events, at_end=at_end)
        self.recording.follow_present()  # what could not be handed over as it came
        self._held.release()

    def let_go(self, message: LetGo) -> None:
        """Free the memory of runs: the robot process needs it for the next one."""
        self._held.let_go(held_alone=message.held_alone)
        if not message.held_alone:
            self._marks.take()
            self.replica.let_go()
            self._marks.take_run()

    def begin(self) -> None:
        """Take in what went on while there was no helper process: runs that are over, and the present one.

        Runs that are over may have come by the link, too: their program went on while this process started.
        """
        self._held.find()
        for run in self._held.ids():
            self._take_left(run)

    def _take_left(self, run: str) -> None:
        """Have a run read that began, and ended but for the present one, while there was no helper process."""
        left = run != self.replica.run
        with contextlib.suppress(SegmentError):
            reader = self._held.open(run)
            if reader is None:
                return
            with contextlib.closing(reader):
                self._judge.take(run, left=left)  # first: what was told to have begun is judged by a successor, too
                tell_left(reader, self._events)
                if left:
                    self._marks.take_left(reader)
        if left:
            self.recording.follow_present()
