"""Triggers, limits and their alarms."""

import time

import msgspec

from silo.helper.answers.table import Parts, answers_to, must_live, relayed, unexpected
from silo.helper.events import plain
from silo.helper.lanes import Lane
from silo.helper.mirror import LoggerSnapshot
from silo.ipc.conditions import worst_first
from silo.ipc.messages import (
    Acknowledge,
    Alarms,
    ArmTrigger,
    Done,
    ForceTrigger,
    GetLimits,
    GetTriggers,
    GoesOn,
    Refused,
    RefusedWhy,
    RemoveLimits,
    RemoveTrigger,
    SetLimits,
    SetTrigger,
    Triggers,
    TriggerTried,
    TryTrigger,
)
from silo.ipc.published import EventKind


@answers_to(GetTriggers)
def _triggers(parts: Parts, _: GetTriggers) -> Triggers:
    found = parts.judge.standing()
    return Triggers(found.run, found.tick, list(found.triggers))


@answers_to(GetLimits)
def _limits(parts: Parts, _: GetLimits) -> Alarms:
    found = parts.judge.standing()
    return Alarms(found.run, found.tick, worst_first(list(found.limits)))


@answers_to(TryTrigger)
def _try_trigger(parts: Parts, request: TryTrigger) -> TriggerTried:
    from silo.helper.trials import try_trigger

    now = parts.mirror.now
    return try_trigger(request.trigger, parts.mirror.open_reader(), now.table.elements, now.robot.extras.derived)


@answers_to(SetTrigger, RemoveTrigger, SetLimits, RemoveLimits)
def _conditions(
    parts: Parts, request: SetTrigger | RemoveTrigger | SetLimits | RemoveLimits
) -> Done | GoesOn | Refused:
    if isinstance(request, SetTrigger) and request.lease_s:
        return _hold_trigger(parts, request)
    if isinstance(request, RemoveTrigger) and parts.judge.let_go(request.name):
        return Done(f"trigger '{plain(request.name)}' is let go of")
    reply = relayed(parts, request)
    if isinstance(reply, Done):
        parts.events.publish(EventKind.CONDITIONS, reply.text, by=request.client)
    return reply if isinstance(reply, Done | GoesOn | Refused) else unexpected(request, reply)


def _hold_trigger(parts: Parts, request: SetTrigger) -> Done | Refused:
    refused = must_live(parts.mirror.now)
    if refused is not None:
        return refused
    is_new = parts.judge.hold(request.trigger, request.lease_s, plain(request.client))
    kept = "held" if is_new else "kept"
    return Done(f"trigger '{request.trigger.name}' is {kept} for {request.lease_s:g} s")


@answers_to(ArmTrigger, lane=Lane.ROBOT)
def _arm(parts: Parts, request: ArmTrigger) -> Done | GoesOn | Refused:
    now = parts.mirror.now
    if parts.judge.leased.owner(request.name):
        parts.judge.arm(request.name, armed=request.armed)
        return Done(f"trigger '{request.name}' is {'armed' if request.armed else 'off'}")
    known = next((one for one in now.robot.extras.triggers if one.name == request.name), None)
    if known is None:
        return _no_trigger(request.name, now)
    if known.armed != request.armed:
        changed = SetTrigger(
            trigger=msgspec.structs.replace(known, armed=request.armed), client=request.client
        )  # it stays so for the next run and in scripts
        reply = relayed(parts, changed)
        if not isinstance(reply, Done):
            return reply if isinstance(reply, GoesOn | Refused) else unexpected(request, reply)
    parts.judge.arm(request.name, armed=request.armed)
    text = f"trigger '{request.name}' is {'armed' if request.armed else 'off'}"
    parts.events.publish(EventKind.CONDITIONS, text, by=request.client)
    return Done(text)


@answers_to(ForceTrigger)
def _force(parts: Parts, request: ForceTrigger) -> Done | Refused:
    now = parts.mirror.now
    if request.name not in parts.judge.names():
        return _no_trigger(request.name, now)
    refused = must_live(now)
    return refused or Done(f"trigger '{request.name}' was fired at tick {parts.judge.force(request.name)}")


@answers_to(Acknowledge)
def _acknowledge(parts: Parts, request: Acknowledge) -> Done:
    who = plain(request.who or request.client)
    count = parts.judge.acknowledge(request.names, who, time.time_ns())
    text = f"{count} alarm{'s' if count != 1 else ''} seen by {who}"
    if count:
        parts.events.publish(EventKind.CONDITIONS, text, by=request.client)
    return Done(text)


def _no_trigger(name: str, now: LoggerSnapshot) -> Refused:
    names = ", ".join(one.name for one in now.robot.extras.triggers)
    there = f"there are {names}" if names else "there is none"
    return Refused(RefusedWhy.NOT_FOUND, f"no trigger is called '{plain(name)}', {there}; nothing was changed")
