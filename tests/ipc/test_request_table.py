"""Each request stands in one table: a handler of the helper process, one of the robot process if it is handed on."""

import importlib
import inspect
import pkgutil
from typing import get_args

import pytest

from silo.helper import answers
from silo.ipc import client, messages
from silo.ipc.messages import Ask, Do, Reply, Request, RobotRequest, leaves, reply_type
from silo.logger import answers as robot_answers

REQUESTS = leaves(Request)


@pytest.mark.parametrize("kind", REQUESTS)
def test_the_helper_has_a_handler_for_every_request(kind):
    assert kind in answers.HANDLERS


@pytest.mark.parametrize("kind", leaves(RobotRequest))
def test_the_robot_process_has_a_handler_for_every_request_that_is_handed_on(kind):
    assert kind in robot_answers.HANDLERS


def test_no_handler_is_there_for_anything_else():
    assert set(answers.HANDLERS) == set(REQUESTS)
    assert set(robot_answers.HANDLERS) == set(leaves(RobotRequest))


@pytest.mark.parametrize("kind", REQUESTS)
def test_every_request_has_a_caller_in_the_client(kind):
    names = [f"{client.__name__}.{one.name}" for one in pkgutil.iter_modules(client.__path__)]
    names.append("silo.ipc.fleet_way")  # a client of many
    sources = [inspect.getsource(importlib.import_module(name)) for name in names]
    assert any(f"{kind.__name__}(" in source for source in sources)


@pytest.mark.parametrize("kind", REQUESTS)
def test_every_request_declares_a_reply_that_clients_can_decode(kind):
    assert reply_type(kind) in leaves(Reply)
    assert reply_type(kind) in get_args(messages.AnyReply)


def test_requests_that_read_and_that_change_something_go_to_different_keys():
    assert {kind.key for kind in leaves(Ask)} == {"ask"}
    assert {kind.key for kind in leaves(Do)} == {"do"}
    assert set(REQUESTS) == {*leaves(Ask), *leaves(Do)}
