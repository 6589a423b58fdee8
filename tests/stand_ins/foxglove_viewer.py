"""A viewer of the Foxglove protocol for tests: another library's socket, other people's code for the messages."""

import json
import struct
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import connect

SDK, WEBSOCKET = "foxglove.sdk.v1", "foxglove.websocket.v1"


class Viewer:
    """Connected; `channels` by topic."""

    def __init__(self, url: str, subprotocol: str = SDK, origin: str | None = None) -> None:
        # a context manager alone in newer versions
        # `close_timeout`: who doesn't read what came goes without good-byes
        opened = connect(url, subprotocols=[subprotocol], origin=origin, max_size=None, close_timeout=0.2)
        self.socket = opened.__enter__()
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: list[str] = []
        self.told: list[str] = []
        self._types = get_typestore(Stores.EMPTY)
        self._topics: dict[int, str] = {}
        self.info: dict[str, Any] = self.json("serverInfo")

    def json(self, operation: str) -> dict[str, Any]:
        """Wait for a message of this kind; what comes before is taken note of."""
        while True:
            message = self.socket.recv(60)
            if isinstance(message, str):
                found = json.loads(message)
                self._note(found)
                if found["op"] == operation:
                    return dict(found)

    def _note(self, message: dict[str, Any]) -> None:
        if message["op"] == "advertise":
            self.channels.update({channel["topic"]: channel for channel in message["channels"]})
        elif message["op"] == "unadvertise":
            gone = set(message["channelIds"])
            self.channels = {name: channel for name, channel in self.channels.items() if channel["id"] not in gone}
        elif message["op"] == "advertiseServices":
            self.services = [service["name"] for service in message["services"]]
        elif message["op"] == "status":
            self.told.append(message["message"])

    def wait_for(self, *topics: str) -> None:
        """Wait until these are offered."""
        while not set(topics) <= set(self.channels):
            self.json("advertise")

    def wait_for_services(self) -> list[str]:
        """Wait until services are offered; their names."""
        while not self.services:
            self.json("advertiseServices")
        return self.services

    def subscribe(self, **numbered: str) -> None:
        """Subscribe: `_5="/log/x"` is number 5."""
        wanted = {int(number[1:]): topic for number, topic in numbered.items()}
        self._topics.update(wanted)
        pairs = [{"id": number, "channelId": self.channels[topic]["id"]} for number, topic in wanted.items()]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": pairs}))

    def unsubscribe(self, *numbers: int) -> None:
        """End subscriptions."""
        self.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": numbers}))

    def message(self) -> tuple[str, int, Any]:
        """Wait for the next sample: topic, time in ns, and the message as other people's code decodes it."""
        while True:
            data = self.socket.recv(60)
            if isinstance(data, str):
                self._note(json.loads(data))
            elif data[0] == 1:
                number, time_ns = struct.unpack_from("<IQ", data, 1)
                topic = self._topics[number]
                return topic, time_ns, self.decoded(topic, data[13:])

    def decoded(self, topic: str, payload: bytes) -> Any:
        """A message by its schema."""
        channel = self.channels[topic]
        name = channel["schemaName"]
        if name not in self._types.types:
            self._types.register(get_types_from_msg(channel["schema"], name))
        return self._types.deserialize_cdr(payload, name)

    def call(self, service: int, call: int) -> bytes:
        """Call a service without arguments; wait for the answer's payload."""
        self.socket.send(struct.pack("<BIII", 2, service, call, 3) + b"cdr" + b"\x00\x01\x00\x00\x00")
        while True:
            data = self.socket.recv(60)
            if isinstance(data, str):
                self._note(json.loads(data))
                if json.loads(data)["op"] == "serviceCallFailure":
                    return data.encode()
            elif data[0] == 3 and struct.unpack_from("<II", data, 1) == (service, call):
                return data[16:]

    def parameters(self, operation: str, **request: Any) -> dict[str, Any]:
        """Ask something of parameters by a name of ours; wait for their values."""
        self.socket.send(json.dumps({"op": operation, "id": "mine", **request}))
        while (told := self.json("parameterValues")).get("id") != "mine":
            pass
        return {one["name"]: one["value"] for one in told["parameters"]}

    def close(self) -> None:
        """Go."""
        self.socket.close()
