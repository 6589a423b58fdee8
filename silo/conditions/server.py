"""Triggers, limits, their alarms, and derived signals."""

import time
from dataclasses import dataclass
from typing import Any

import msgspec

from silo.conditions import requests
from silo.conditions.judge import Judge
from silo.conditions.requests import Alarms, ConditionRequests, Triggers, TriggerTried
from silo.conditions.standing import worst_first
from silo.core.conditions import SignalLimits, TriggerOptions
from silo.core.quantities.writing import many
from silo.net.access.senders import on_behalf
from silo.rpc.declaring import Request, request_of
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.state.events import EventNotifier, plain
from silo.state.replica import Replica
from silo.state.robot_program import RobotProgram


@dataclass(frozen=True)
class ConditionServer(Server, does=[requests]):
    """Answers how they stand; what changes them is done by the robot program, of leased triggers here."""

    judge: Judge
    replica: Replica
    events: EventNotifier
    robot: RobotProgram

    def triggers(self) -> Triggers:
        found = self.judge.standing()
        return Triggers(found.run, found.tick, list(found.triggers))

    def alarms(self) -> Alarms:
        found = self.judge.standing()
        return Alarms(found.run, found.tick, worst_first(list(found.limits)))

    def try_trigger(self, trigger: TriggerOptions) -> TriggerTried:
        from silo.conditions.segment_judge import try_trigger

        now = self.replica.now
        return try_trigger(trigger, self.replica.open_reader(), now.table.elements, now.robot.conditions.derived)

    def set_trigger(self, turn: Turn, trigger: TriggerOptions, lease_s: float) -> str:
        if not lease_s:
            return self._told(turn, request_of(ConditionRequests._set_trigger, trigger))
        self.robot.must_live()
        is_new = self.judge.hold(trigger, lease_s, turn.by)
        return f"trigger '{trigger.name}' is {'held' if is_new else 'kept'} for {lease_s:g} s"

    def remove_trigger(self, turn: Turn, name: str) -> str:
        if self.judge.let_go(name):
            return f"trigger '{plain(name)}' is let go of"
        return self._told(turn, request_of(ConditionRequests._remove_trigger, name))

    def set_limits(self, turn: Turn, limits: SignalLimits) -> str:
        return self._told(turn, request_of(ConditionRequests._set_limits, limits))

    def remove_limits(self, turn: Turn, name: str) -> str:
        return self._told(turn, request_of(ConditionRequests._remove_limits, name))

    def _told(self, turn: Turn, request: Request[Any]) -> str:
        """Have the robot program do it, and tell all clients."""
        text: str = self.robot.reply(request, turn).text
        self.events.publish(EventKind.CONDITIONS, text, by=turn.by)
        return text

    def arm_trigger(self, turn: Turn, name: str, armed: bool) -> str:
        judge, now = self.judge, self.replica.now
        text = f"trigger '{name}' is {'armed' if armed else 'off'}"
        if judge.leased.owner(name):
            judge.arm(name, armed=armed)
            return text
        known = next((one for one in now.robot.conditions.triggers if one.name == name), None)
        if known is None:
            raise self._no_trigger(name)
        if known.armed != armed:  # it stays so for the next run and in scripts
            changed = msgspec.structs.replace(known, armed=armed)
            self.robot.reply(request_of(ConditionRequests._set_trigger, changed), turn)
        judge.arm(name, armed=armed)
        self.events.publish(EventKind.CONDITIONS, text, by=turn.by)
        return text

    def force_trigger(self, turn: Turn, name: str) -> str:
        if name not in self.judge.names():
            raise self._no_trigger(name)
        self.robot.must_live()
        text = f"trigger '{name}' was fired by hand at tick {self.judge.force(name)}"
        self.events.publish(EventKind.CONDITIONS, text, by=turn.by)
        return text

    def acknowledge(self, turn: Turn, names: list[str], who: str) -> str:
        who = plain(on_behalf(turn.by, who))
        count = self.judge.acknowledge(names, who, time.time_ns())
        if not count:
            return "no alarm waits to be seen"
        text = f"{many(count, 'alarm')} seen by {who}"
        self.events.publish(EventKind.CONDITIONS, text, by=turn.by)
        return text

    def _no_trigger(self, name: str) -> RequestRefusedError:
        names = ", ".join(one.name for one in self.replica.now.robot.conditions.triggers)
        there = f"there are {names}" if names else "there is none"
        text = f"no trigger is called '{plain(name)}', {there}; nothing was changed"
        return RequestRefusedError(RefusedWhy.NOT_FOUND, text)
