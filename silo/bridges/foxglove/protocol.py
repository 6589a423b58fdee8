"""The Foxglove WebSocket protocol: what server and viewer say to each other. Pure rules, no sockets.

Source: the protocol's specification in github.com/foxglove/ws-protocol (docs/spec.md) for `foxglove.websocket.v1`;
`foxglove.sdk.v1`, which Foxglove and Lichtblick ask for today, has the same messages.
"""

import json
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.typing import Subprotocol

from silo.bridges.messages import LiveTopic
from silo.bridges.services import trigger_response
from silo.core.tuning.parameters import ParameterInfo, ParameterKind, ParameterValue
from silo.history.arrays import SampleArrays

SUBPROTOCOLS = (Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1"))
MESSAGE_DATA, TIME = 1, 2  # from the server, binary
SERVICE_REQUEST, SERVICE_RESPONSE = 2, 3  # from the viewer, to the viewer, binary
CHANNELS_AT_ONCE = 500  # of an advertisement; each has its schema, some 300 bytes
MOST_PARAMETERS = 65_535  # that a viewer may want to hear of
FINAL_BINARY, FINAL_TEXT = 0x82, 0x81  # RFC 6455, 5.2: a frame that is the whole message


class StatusLevel(IntEnum):
    """How bad it is what a viewer is told."""

    INFO, WARNING, ERROR = range(3)


@dataclass(frozen=True)
class Offer:
    """A topic by the number it has with viewers."""

    id: int
    topic: LiveTopic


@dataclass(frozen=True)
class ServiceCall:
    """A viewer calls a service."""

    service: int
    call: int
    encoding: str
    payload: bytes


def server_info(name: str, session: str, *, control: bool) -> str:
    """Return the first message: who we are, and what we can."""
    capabilities = ["time", "parameters", "parametersSubscribe", *(["services"] if control else [])]
    info = {"op": "serverInfo", "name": name, "capabilities": capabilities, "sessionId": session, "metadata": {}}
    return json.dumps({**info, "supportedEncodings": ["cdr"]})


def advertisements(offers: Iterable[Offer]) -> Iterable[str]:
    """Return the messages that offer topics."""
    rest = iter(offers)
    while some := list(islice(rest, CHANNELS_AT_ONCE)):
        yield json.dumps({"op": "advertise", "channels": [_channel(offer) for offer in some]})


def _channel(offer: Offer) -> dict[str, object]:
    type_ = offer.topic.channel.type
    return {
        "id": offer.id, "topic": offer.topic.channel.topic, "encoding": "cdr",
        "schemaName": type_.name, "schema": type_.text, "schemaEncoding": "ros2msg",
    }  # fmt: skip


def unadvertisement(ids: Sequence[int]) -> str:
    """Return the message that takes offers back."""
    return json.dumps({"op": "unadvertise", "channelIds": list(ids)})


def status(level: StatusLevel, message: str) -> str:
    """Return a message that viewers show among their problems."""
    return json.dumps({"op": "status", "level": int(level), "message": message})


def services(names: Sequence[str]) -> str:
    """Return the offer of services of type `std_srvs/srv/Trigger`, numbered from 1."""
    request = {"encoding": "cdr", "schemaName": "std_srvs/srv/Trigger_Request", "schemaEncoding": "ros2msg"}
    response = {**request, "schemaName": "std_srvs/srv/Trigger_Response"}
    answer = "bool success\nstring message\n"
    return json.dumps(
        {
            "op": "advertiseServices",
            "services": [
                {
                    "id": number, "name": name, "type": "std_srvs/srv/Trigger",
                    "request": {**request, "schema": ""}, "response": {**response, "schema": answer},
                    "requestSchema": "", "responseSchema": answer,
                }
                for number, name in enumerate(names, start=1)
            ],
        }
    )  # fmt: skip


def service_call(data: bytes) -> ServiceCall:
    """Return what a viewer calls. Raises ValueError for anything else."""
    if len(data) < 13 or data[0] != SERVICE_REQUEST:
        raise ValueError("only service calls come in binary")
    service, call, length = struct.unpack_from("<III", data, 1)
    if 13 + length > len(data):
        raise ValueError("a service call is cut off")
    return ServiceCall(service, call, data[13 : 13 + length].decode(errors="replace"), data[13 + length :])


def service_response(call: ServiceCall, *, success: bool, message: str) -> bytes:
    """Return the answer to a call, as `std_srvs/srv/Trigger` has it."""
    body = trigger_response(message, success=success)
    return struct.pack("<BIII", SERVICE_RESPONSE, call.service, call.call, 3) + b"cdr" + body


def service_failure(call: ServiceCall, message: str) -> str:
    """Return the answer to a call that there is no service for."""
    return json.dumps({"op": "serviceCallFailure", "serviceId": call.service, "callId": call.call, "message": message})


def parameter_values(parameters: Iterable[ParameterInfo], request: str | None = None) -> str:
    """Return what parameters are now, to whoever asked by a `request` of that name."""
    values = [_parameter(info) for info in parameters]
    return json.dumps({"op": "parameterValues", "parameters": values} | ({} if request is None else {"id": request}))


def _parameter(info: ParameterInfo) -> dict[str, object]:
    found: dict[str, object] = {"name": info.name, "value": info.value}
    if info.kind is ParameterKind.FLOAT:  # for JSON, 40.0 may be 40
        found["type"] = "float64_array" if info.shape else "float64"
    return found


def wanted_parameters(request: Mapping[str, Any]) -> dict[str, ParameterValue]:
    """Return what a viewer sets, by name. Raises ValueError or KeyError for anything else."""
    found: dict[str, ParameterValue] = {}
    for one in request["parameters"]:
        value = one.get("value")
        items = value if isinstance(value, list) else [value]
        if not all(isinstance(item, float | int | bool | str) for item in items):
            raise ValueError(f"parameter '{one['name']}' takes numbers, texts, true or false, or a list of these")
        found[str(one["name"])] = tuple(value) if isinstance(value, list) else value
    return found


def binary_frame(payload: bytes) -> bytes:
    """Return a WebSocket frame of a server, as it stands on the wire."""
    return frame_head(len(payload)) + payload


def text_frame(text: str) -> bytes:
    """Return a WebSocket frame of text."""
    payload = text.encode()
    return bytes([FINAL_TEXT]) + frame_head(len(payload))[1:] + payload


def frame_head(size: int) -> bytes:
    """Return what stands before a server's binary payload of so many bytes (RFC 6455, 5.2)."""
    if size < 126:
        return bytes([FINAL_BINARY, size])
    if size < 65536:
        return struct.pack(">BBH", FINAL_BINARY, 126, size)
    return struct.pack(">BBQ", FINAL_BINARY, 127, size)


def time_frame(time_ns: int) -> bytes:
    """Return the frame that tells the robot's clock."""
    return binary_frame(struct.pack("<BQ", TIME, max(time_ns, 0)))


class Frames:
    """The messages of one topic of a while, ready for the wire but for the subscription's number."""

    def __init__(self, topic: LiveTopic, samples: SampleArrays) -> None:
        self.count = len(samples)
        self._texts = list(topic.texts(samples)) if topic.channel.is_string else []
        self._records = None if topic.channel.is_string else _records(topic, samples)

    def for_subscription(self, number: int) -> bytes:
        """Return all frames, one behind the other."""
        if self._records is None:
            return b"".join(
                binary_frame(struct.pack("<BIQ", MESSAGE_DATA, number, max(time_ns, 0)) + message)
                for time_ns, message in self._texts
            )
        self._records["subscription"] = number
        return self._records.tobytes()


def _records(topic: LiveTopic, samples: SampleArrays) -> "NDArray[np.void]":
    """One structured array is the frames of all samples: nothing is done per message."""
    start = frame_head(13 + topic.channel.size)
    head = [("frame", f"V{len(start)}"), ("opcode", "u1"), ("subscription", "<u4"), ("time", "<u8")]
    records = topic.empty(samples, head)
    topic.fill(records, samples)
    records["frame"] = np.void(start)
    records["opcode"] = MESSAGE_DATA
    records["time"] = np.maximum(samples.time_ns, 0)
    return records
