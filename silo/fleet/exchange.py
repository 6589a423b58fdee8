"""One request, one reply: encoding, waiting, and turning silence into words. Used by everything that asks a helper."""

import contextlib
import functools
import os
import socket
import sys
import time
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from silo.core.runtime import user_name
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError, VersionError
from silo.net import keys
from silo.net.found import LoggerAddress
from silo.net.sessions import SessionLease, borrowed
from silo.rpc.clocks import UNKNOWN, TheirClock
from silo.rpc.declaring import Do, GoesOn, Reply, ReplyT, Request, reply_type
from silo.rpc.foreign import NOT_UNDERSTOOD
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, checked
from silo.rpc.versions import PROTOCOL, robot_problem
from silo.state.requests import Hello, HelloReply


class _Peer(msgspec.Struct):
    """What a hello of every protocol says, whatever else is in it."""

    type: str
    protocol: int
    version: str
    oldest: int = 1


_peer_decoder = msgpack_decoder(_Peer)


@functools.cache
def _decoder(kind: type[Request[Any]]) -> msgspec.msgpack.Decoder[Reply]:
    """Return what decodes the replies that a request can have, and no others: `silo ls` loads what it asks for."""
    return msgpack_decoder(reply_type(kind) | Refused | GoesOn)


@functools.cache
def _any_decoder() -> msgspec.msgpack.Decoder[Reply]:
    """Return what decodes all replies, for which all requests are loaded."""
    from silo.requests import AnyReply

    return msgpack_decoder(AnyReply)


def encoded(request: Request[Any], until_s: float = 0.0) -> bytes:
    """Return a request as it is sent; `until_s` is when its sender gives up, by the clock of the helper process.

    Raises RequestRefusedError for one that is larger than a helper process reads.
    """
    payload = msgspec.msgpack.encode(msgspec.structs.replace(request, protocol=PROTOCOL, until_s=until_s))
    if len(payload) > request.max_bytes:
        text = (
            f"{type(request).__name__} takes {len(payload)} bytes, a helper process reads at most "
            f"{request.max_bytes}: send less at a time; nothing was sent"
        )
        raise RequestRefusedError(RefusedWhy.INVALID, text)
    return payload


def client_name() -> str:
    """Return who asks, for events: `alice@laptop silo-tui 4711`."""
    path = Path(sys.argv[0] if sys.argv and sys.argv[0] else "python")
    program = path.parent.name if path.name == "__main__.py" else path.name  # as `python -m` runs it
    return f"{user_name(os.getuid())}@{socket.gethostname()} {program} {os.getpid()}"


def key_of(request: Request[Any], root: keys.Root, user: str) -> str:
    """Return the key that a request of a user goes to: that of one logger, never one with a wildcard."""
    return root.do(user) if request.key == Do.key else root.key(request.key)


def root_at(borrowed: SessionLease, found: LoggerAddress, timeout_s: float) -> keys.Root:
    """Return where the keys of a logger begin, by its liveliness token where its socket doesn't tell.

    Raises ConnectionLostError where nobody has such a token, or several have.
    """
    if found.root is not None:
        return found.root
    roots = those_there(borrowed, f"silo/*/{keys.escape(found.name)}/alive", timeout_s)
    if len(roots) == 1:
        return roots[0]
    if roots:
        names = ", ".join(root.address for root in roots)
        raise ConnectionLostError(f"several loggers are called '{found.name}', say which one you mean: {names}")
    raise ConnectionLostError(f"logger '{found.name}' doesn't say who it is: its helper process is ending; try again")


def those_there(mine: SessionLease, alive: str, timeout_s: float) -> list[keys.Root]:
    """Return whose tokens are there, sorted: who is told of now, and whom those see who follow it in the same session.

    Beside a subscription the end of an answer may overtake a part of it: 1, or 5, of 42 tokens came.
    """
    wanted = zenoh.KeyExpr(alive)
    seen = {root for here in list(mine.followed.values()) for root in list(here.values())}
    followed = {root for root in seen if wanted.intersects(zenoh.KeyExpr(root.key("alive")))}
    return sorted(those_told(mine, alive, timeout_s) | followed)


def those_told(mine: SessionLease, alive: str, timeout_s: float) -> set[keys.Root]:
    """Return of whose tokens one question is told."""
    replies = mine.session.liveliness().get(alive, timeout=timeout_s + mine.slack_s)
    roots = (keys.robot_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None)
    return {root for root in roots if root is not None}


def payload_of(reply: zenoh.Reply, key: str) -> bytes | None:
    """Return what a reply says if it is under the very key that was asked: rules keep all but its robot from that."""
    answer = reply.ok
    return answer.payload.to_bytes() if answer is not None and str(answer.key_expr) == key else None


def introduce(mine: SessionLease, root: keys.Root, hello: Hello, timeout_s: float, *, may_change: bool) -> None:
    """Say who is there under this user's own keys, to which rules admit nobody else: what is asked says no name that
    holds. Whom rules keep from changing anything is known by name alone. Raises ConnectionLostError.
    """
    mine_alone = [root.do(mine.user)] if may_change else []
    if mine.config:
        mine_alone.append(root.key("refused", keys.user_part(mine.user)))
    payload, within_s = encoded(hello), timeout_s + mine.slack_s
    try:
        said = [mine.session.get(key, payload=payload, timeout=within_s, attachment=mine.proof) for key in mine_alone]
    except zenoh.ZError as error:
        raise ConnectionLostError(f"lost the connection to {root.address}: {error}") from error
    for replies in said:
        for _ in replies:  # to its end, whatever the answer: then it is known who is there
            pass


# Zenoh's end of an answer may overtake the answer, or come while a router still learns who is there (zenoh issues 1734,
# 2767): what only reads is asked again.
AGAIN_S = (0.02, 0.05, 0.1, 0.2)


class NoAnswerError(ConnectionLostError):
    """Nobody answers under that key: the helper process has ended, or rules keep the request from it."""


def exchange(
    mine: SessionLease,
    root: keys.Root,
    request: Request[Any],
    timeout_s: float,
    who: str,
    *,
    as_change: bool = False,
    refused: bool = False,
    clock: TheirClock = UNKNOWN,
) -> Reply:
    """Send a request and wait for its reply, longer over a slow link.

    `as_change` sends one that reads as one that changes something; `refused` sends a change to where is told why it
    isn't done. What is begun later than it is waited for, by the `clock` of who is asked, is not done. Raises
    ConnectionLostError, and of refusals only that of a request that is too large.
    """
    timeout_s += mine.slack_s
    payload = encoded(request, clock.after(timeout_s))
    changes = as_change or request.key == Do.key
    key = root.do(mine.user) if changes else key_of(request, root, mine.user)
    key = root.key("refused", keys.user_part(mine.user)) if refused else key
    replies: list[zenoh.Reply] = []
    for pause_s in (0.0, *(AGAIN_S if not changes else ())):
        if replies:
            break
        time.sleep(pause_s)
        try:
            replies = list(
                mine.session.get(key, payload=payload, timeout=timeout_s, attachment=mine.proof if changes else None)
            )
        except zenoh.ZError as error:
            raise ConnectionLostError(f"lost the connection to {who}: {error}") from error
    for reply in replies:
        if (found := payload_of(reply, key)) is not None:
            return decode_reply(found, who, type(request))
    if replies:
        thin = "the link is too thin for the answer, or " if mine.slack_s else ""
        raise ConnectionLostError(
            f"{who} did not answer within {round(timeout_s, 1):g} s: {thin}its helper process is frozen or "
            "overloaded; try again"
        )
    right = "change anything" if changes else "ask"
    raise NoAnswerError(
        f"{who} gave no answer: its helper process has ended, or its access rules don't let this user {right}"
    )


def decode_reply(payload: bytes, who: str, kind: type[Request[Any]] | None = None) -> Reply:
    """Decode a reply, the quicker where it is known of which `kind` of request.

    Raises VersionError for a hello of a helper process that can't be asked, ConnectionLostError for what can't be
    understood.
    """
    try:
        reply = _decoded(payload, kind)
    except NOT_UNDERSTOOD as error:
        _check_peer(payload, who)
        raise ConnectionLostError(
            f"{who} answers in words that this version of silo doesn't know ({error}): "
            "install the same version of silo on both sides"
        ) from error
    if isinstance(reply, HelloReply) and (problem := robot_problem(who, reply.protocol, reply.oldest, reply.version)):
        raise VersionError(problem)
    return reply


def _decoded(payload: bytes, kind: type[Request[Any]] | None) -> Reply:
    if kind is not None:
        with contextlib.suppress(*NOT_UNDERSTOOD):
            return _decoder(kind).decode(payload)
    return _any_decoder().decode(payload)  # of another request, then: that is told by whoever asked


def _check_peer(payload: bytes, who: str) -> None:
    """Raise VersionError if this is the hello of a helper process of another protocol."""
    try:
        peer = _peer_decoder.decode(payload)
    except NOT_UNDERSTOOD:
        return  # not even that can be read
    problem = robot_problem(who, peer.protocol, peer.oldest, peer.version)
    if peer.type == HelloReply.__name__ and problem:
        raise VersionError(problem)


def ask_once(found: LoggerAddress, request: Request[ReplyT], timeout_s: float) -> ReplyT:
    """Open a session, ask, close it. Raises ConnectionLostError, or RequestRefusedError."""
    with borrowed(found.socket, found.config) as mine:
        reply = exchange(mine, root_at(mine, found, timeout_s), request, timeout_s, f"logger '{found.name}'")
    return checked(request, reply)
