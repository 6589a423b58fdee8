"""Each request is declared once: it has a caller, a server with a method of its name, and a reply that is decoded."""

import ast
import contextlib
import inspect
import math
from pathlib import Path
from typing import get_args

import msgspec
import pytest

import silo
from silo import requests as messages
from silo.client.client import Client
from silo.conditions import requests as conditions
from silo.conditions.requests import ConditionRequests
from silo.conditions.robot import ConditionRobot
from silo.core.arrays.columns import MAX_COLUMNS, MIN_COLUMN_NS
from silo.core.conditions import TriggerOptions
from silo.core.elements import Problem, Sought
from silo.errors import ArgumentError, ElementError, GoesOnError, NoRoomError, SaveError, StateError, UnsavedError
from silo.helper import request_threads
from silo.history import pins, samples, search, server
from silo.live import streams, views
from silo.logger.serving import answers
from silo.net.access import rights
from silo.requests import decode_do
from silo.rpc.declaring import (
    Ask,
    Do,
    Done,
    GoesOn,
    Reply,
    Request,
    RobotRequest,
    leaves,
    method_of,
    reply_type,
    request_of,
)
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, answered, checked
from silo.rpc.serving import Dispatch, Sender, Server, Turn
from silo.rpc.versions import PROTOCOL
from silo.settings.options import MAX_PROBLEMS

REQUESTS = leaves(Request)
ROBOT_CONDITIONS = list(ConditionRobot.handlers.values())


def of(module):
    servers = [one for one in vars(module).values() if isinstance(one, type) and issubclass(one, Server)]
    return [kind for server in servers for kind in server.handlers]


HANDLED, AT_THE_ROBOT = of(request_threads), of(answers)


@pytest.mark.parametrize("kind", REQUESTS)
def test_every_request_is_done_by_one_server_or_handed_on(kind):
    assert HANDLED.count(kind) == 1 or (kind not in HANDLED and issubclass(kind, RobotRequest))


def test_the_robot_process_does_every_request_that_is_handed_on_and_no_other():
    assert sorted(AT_THE_ROBOT, key=method_of) == sorted(leaves(RobotRequest), key=method_of)
    assert set(HANDLED) <= set(REQUESTS)


def test_every_request_has_a_caller_in_the_client():
    declared = [vars(method).get("request") for _, method in inspect.getmembers(Client, inspect.isfunction)]
    called = {
        node.func.id
        for path in Path(silo.__file__).parent.rglob("*.py")
        if path.parent.name in ("client", "fleet", "history", "live", "requests")
        or path.name in ("fetching.py", "requests.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert [kind for kind in REQUESTS if kind not in declared and kind.__name__ not in called] == []


@pytest.mark.parametrize("kind", REQUESTS)
def test_every_request_declares_a_reply_that_clients_can_decode(kind):
    assert reply_type(kind) in leaves(Reply)
    assert reply_type(kind) in get_args(messages.AnyReply)


def test_requests_that_read_and_that_change_something_go_to_different_keys():
    assert {kind.key for kind in leaves(Ask)} == {"ask"}
    assert {kind.key for kind in leaves(Do)} == {"do"}
    assert set(REQUESTS) == {*leaves(Ask), *leaves(Do)}


def test_every_request_goes_to_a_key_that_rules_know():
    assert {kind.key for kind in REQUESTS} == {kind.key for kind in rights.ASKED}


def test_no_two_requests_have_one_name():
    assert len({method_of(kind) for kind in REQUESTS}) == len(REQUESTS)
    assert len({kind.__name__ for kind in REQUESTS}) == len(REQUESTS)


# -------------------------------------------------------------------------------------------- a declaration by itself


class Kept(ConditionRequests):
    """A client that keeps what it would send."""

    def __init__(self):
        self.sent = []

    def _call(self, request):
        self.sent.append(request)
        return Done("done")


FALL = TriggerOptions("fall", "q > 1")


def test_a_declared_method_sends_its_arguments_and_returns_the_text_of_done():
    client = Kept()
    assert [client._set_trigger(FALL, lease_s=5.0), client.arm_trigger("fall", armed=False)] == ["done", "done"]
    assert client.sent == [
        messages.SetTrigger(trigger=FALL, lease_s=5.0),
        messages.ArmTrigger(name="fall", armed=False),
    ]
    assert client.sent[0] == request_of(ConditionRequests._set_trigger, FALL, 5.0)


def test_a_declared_method_with_a_body_sends_what_that_returns():
    client = Kept()
    client.acknowledge(("/log/x",), who="anna")
    assert client.sent == [messages.Acknowledge(names=["/log/x"], who="anna")]
    with pytest.raises(ElementError, match="names"):
        client.acknowledge("/log/x")


def test_a_wrong_call_of_a_declared_method_is_told_in_words():
    with pytest.raises(
        ArgumentError, match=r"client\._set_trigger\(\) has no argument 'lease', did you mean 'lease_s'"
    ):
        Kept()._set_trigger(FALL, lease=5.0)


def test_a_declared_method_shows_its_own_signature_and_words():
    assert str(inspect.signature(Client._remove_trigger)) == "(self, name: str) -> str"
    assert inspect.getdoc(Client._remove_trigger).startswith("Forget a trigger")
    assert messages.RemoveTrigger.__doc__.startswith("Forget a trigger")


def test_a_server_that_lacks_a_request_or_has_another_one_fails_where_it_is_written():
    with pytest.raises(TypeError, match=r"Wrong and what .* declare differ: acknowledge, alarms"):

        class Wrong(Server, does=[conditions]):
            pass


def test_a_misspelt_handler_and_one_of_other_arguments_fail_where_they_are_written():
    right = {name: getattr(ConditionRobot, name) for name in ROBOT_CONDITIONS}
    type("Right", (Server,), right, does=[conditions], robot=True)
    with pytest.raises(TypeError, match="differ: set_trigger, set_triger"):
        spelt = {name.replace("set_trigger", "set_triger"): one for name, one in right.items()}
        type("Spelt", (Server,), spelt, does=[conditions], robot=True)
    with pytest.raises(TypeError, match=r"Args\.remove_trigger takes nam, declared are name"):
        type("Args", (Server,), {**right, "remove_trigger": lambda self, nam: ""}, does=[conditions], robot=True)


def test_a_handler_gets_the_fields_and_who_asks_and_its_text_is_what_was_done():
    methods = {name: getattr(ConditionRobot, name) for name in ROBOT_CONDITIONS}
    methods["remove_trigger"] = lambda self, turn, name: f"{turn.by} removes {name}"
    server = type("One", (Server,), methods, does=[conditions], robot=True)
    dispatch = Dispatch([server()], lambda request, turn: Done("handed on"))
    turn = Turn(Sender("a", "anna"))
    assert dispatch.reply(messages.RemoveTrigger(name="fall"), turn) == Done("anna removes fall")
    assert dispatch.reply(messages.GetStatus(), turn) == Done("handed on")


# ------------------------------------------------------------------------------------------------------- refusals


def test_an_error_becomes_an_answer_and_the_same_error_again():
    problem = Problem("/log/x", "divider", "must be 1 or more")
    refused = answered(lambda: fail(RequestRefusedError(RefusedWhy.INVALID, "no", [problem])))
    assert refused == Refused(RefusedWhy.INVALID, "no", [problem])
    with pytest.raises(RequestRefusedError, match="no") as error:
        checked(messages.GetStatus(), refused)
    assert (error.value.why, error.value.problems) == (RefusedWhy.INVALID, [problem])
    goes_on = answered(lambda: fail(GoesOnError("it goes on", 7)))
    assert goes_on == GoesOn(7, "it goes on")
    with pytest.raises(GoesOnError) as later:
        checked(messages.GetStatus(), goes_on)
    assert later.value.job == 7


@pytest.mark.parametrize(
    ("error", "why"),
    [(UnsavedError("x"), RefusedWhy.UNSAVED), (StateError("x"), RefusedWhy.INVALID),
     (SaveError("x"), RefusedWhy.INVALID),
     (ElementError("x"), RefusedWhy.INVALID), (NoRoomError("x", 2, 1), RefusedWhy.FAILED)],
)  # fmt: skip
def test_other_errors_of_silo_are_refusals_in_their_own_words(error, why):
    assert answered(lambda: fail(error)) == Refused(why, "x")


def test_what_breaks_is_refused_and_logged(caplog):
    assert answered(lambda: fail(KeyError("x"))) == Refused(RefusedWhy.FAILED, "KeyError: 'x'")
    assert "a request failed" in caplog.text


FAR = 2**62
MANY = [f"/log/x{number}" for number in range(views.MAX_VALUES + 1)]
CHECKS = {
    messages.OpenStream: streams._problem, messages.OpenView: views._problem, messages.OpenPin: pins._check,
    messages.GetSamples: samples.check_samples, messages.GetHistory: server.check_history,
    messages.FindMoments: search.check_moments, messages.MeasureSpan: search.check_span,
}  # fmt: skip
ASKED = {
    messages.OpenStream: {"stream": "a-1", "names": ["/log/x"]},
    messages.OpenView: {"view": "a-1", "values": ["/log/x"]},
    messages.OpenPin: {"pin": "a-1", "names": ["/log/x"], "start_ns": 0, "end_ns": 9},
    messages.GetSamples: {"names": ["/log/x"]},
    messages.GetHistory: {"names": ["/log/x"], "start_ns": 0, "end_ns": 10**9, "column_ns": 10**7},
    messages.FindMoments: {"names": ["/log/x"], "what": Sought.CROSSING},
    messages.MeasureSpan: {"names": ["/log/x"], "a_ns": 9, "b_ns": 0},
}
IDS = ["a-1", "0f-99"], ["", "a", "../x", "a-1/b", "a-*", "a-1 "]


def names_to(most):
    return [MANY[:1], MANY[:most]], [[], MANY[: most + 1]]


@pytest.mark.parametrize(
    ("kind", "field", "fitting", "others"),
    [
        (messages.OpenStream, "stream", *IDS), (messages.OpenStream, "names", *names_to(streams.MAX_NAMES)),
        (messages.OpenStream, "period_s", [streams.MIN_PERIOD_S, streams.MAX_PERIOD_S],
         [streams.MIN_PERIOD_S * 0.99, streams.MAX_PERIOD_S * 1.01, math.nan, math.inf, -1.0]),
        (messages.OpenView, "view", *IDS), (messages.OpenView, "values", [[], MANY[:-1]], [MANY, ["/log/x", "/log/x"]]),
        (messages.OpenView, "plots", [[], MANY[: views.MAX_PLOTS]], [MANY[: views.MAX_PLOTS + 1]]),
        (messages.OpenView, "rate_hz", [views.MIN_RATE_HZ, 1e6], [0.0, 0.09, 1e7, math.nan, math.inf, -1.0]),
        (messages.OpenView, "column_ns", [MIN_COLUMN_NS, FAR - 1], [MIN_COLUMN_NS - 1, FAR, 0, -1]),
        (messages.OpenPin, "pin", *IDS), (messages.OpenPin, "names", *names_to(pins.MAX_NAMES)),
        (messages.OpenPin, "start_ns", [1 - FAR, 9], [-FAR, 10]), (messages.OpenPin, "end_ns", [0, FAR - 1], [-1, FAR]),
        (messages.GetSamples, "names", *names_to(samples.MAX_NAMES)),
        (messages.GetSamples, "reply_bytes", [samples.MIN_BYTES, samples.MAX_BYTES],
         [samples.MIN_BYTES - 1, samples.MAX_BYTES + 1, 0, -1]),
        (messages.GetSamples, "start", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.GetSamples, "end", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.GetSamples, "resume", [[]], [[(0, 1)]]),  # without a run
        (messages.GetHistory, "names", *names_to(server.MAX_NAMES)),
        (messages.GetHistory, "column_ns", [MIN_COLUMN_NS * 1000, FAR - 1], [MIN_COLUMN_NS - 1, FAR, 0, -1]),
        (messages.GetHistory, "start_ns", [10**9 - MAX_COLUMNS * 10**7, 10**9 - 1],
         [10**9 - MAX_COLUMNS * 10**7 - 1, 10**9, -FAR]),
        (messages.GetHistory, "end_ns", [1, MAX_COLUMNS * 10**7], [0, -1, MAX_COLUMNS * 10**7 + 1, FAR]),
        (messages.FindMoments, "names", *names_to(search.MAX_NAMES)),
        (messages.FindMoments, "most", [1, search.MAX_MOMENTS], [0, -1, search.MAX_MOMENTS + 1]),
        (messages.FindMoments, "start_ns", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.FindMoments, "end_ns", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.FindMoments, "around_ns", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.FindMoments, "bounds", [[], [(None, 1.0)]], [[(None, 1.0)] * 2]),
        (messages.FindMoments, "pins", [[], MANY[: search.MAX_PINS]], [MANY[: search.MAX_PINS + 1]]),
        (messages.FindMoments, "level", [0.0, -1e300, math.inf], [math.nan]),
        (messages.FindMoments, "direction", [-1, 0, 1], [-2, 2]),
        (messages.MeasureSpan, "names", *names_to(search.MAX_NAMES)),
        (messages.MeasureSpan, "a_ns", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.MeasureSpan, "b_ns", [-FAR, FAR], [-FAR - 1, FAR + 1]),
        (messages.MeasureSpan, "pins", [[], MANY[: search.MAX_PINS]], [MANY[: search.MAX_PINS + 1]]),
    ],
    ids=lambda given: given.__name__ if isinstance(given, type) else given if isinstance(given, str) else "",
)  # fmt: skip
def test_what_is_asked_fits_up_to_its_bounds_and_is_refused_beyond(kind, field, fitting, others):
    def problem(value):
        try:
            return CHECKS[kind](kind(**{**ASKED[kind], field: value}))
        except RequestRefusedError as error:
            assert error.why is RefusedWhy.INVALID
            return str(error)

    assert [problem(value) or "" for value in fitting] == [""] * len(fitting)
    assert all(map(problem, others))


@pytest.mark.parametrize("row", [(0, 0), (5, FAR), (-1, 1), (2, 1), (0, FAR + 1)])
def test_who_goes_on_with_samples_does_so_with_rows_that_can_be(row):
    asked = messages.GetSamples(**ASKED[messages.GetSamples], run="1f", resume=[(3, 4), row])
    fits = 0 <= row[0] <= row[1] <= FAR
    with contextlib.nullcontext() if fits else pytest.raises(RequestRefusedError, match="none of our replies"):
        samples.check_samples(asked)


FITTING = {"name": "/log/x", "options": {"divider": 2}}


@pytest.mark.parametrize(
    ("edits", "told"),
    [
        ([FITTING, {"name": "/log/y", "options": {"divider": 0}}],
         [("/log/y", "divider", "from 1 to 2147483647, got 0")]),
        ([{"name": "/log/y", "options": {"divider": "2", "enabled": 3}}],
         [("/log/y", "enabled", "on or off, got 3"), ("/log/y", "divider", "from 1 to 2147483647, got '2'")]),
        ([{"name": "/log/y", "options": 5}, FITTING, 7], [("/log/y", "", "got `int`"), ("?", "", "got `int`")]),
        ([{"name": "/log/y"}], [("/log/y", "", "missing required field `options`")]),
        ([7] * (MAX_PROBLEMS + 1), [("?", "", "got `int`")] * MAX_PROBLEMS),
    ],
    ids=lambda given: str(given)[:30],
)  # fmt: skip
def test_of_edits_that_can_not_be_read_each_is_told_with_its_element_and_field(edits, told):
    edited = {"type": "ApplyEdits", "protocol": PROTOCOL, "revision": -1, "edits": edits}
    with pytest.raises(RequestRefusedError) as refused:
        decode_do(msgspec.msgpack.encode(edited))
    found = refused.value.problems
    assert [(one.name, one.field) for one in found] == [place[:2] for place in told]
    assert all(words in one.reason for one, (_, _, words) in zip(found, told, strict=True))


def fail(error):
    raise error
