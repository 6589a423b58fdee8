"""The ROS 2 bridge: names and bytes as rmw_zenoh's own sources have them, and messages as other people decode them."""

import functools
import importlib.util
import json
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zenoh
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

import silo
from silo.bridges.feed import LoggerFollower
from silo.bridges.services import Audit, services, setting
from silo.client.client import Client
from silo.core.elements import Edit, ElementOptions, State
from silo.core.tuning.parameters import ParameterInfo, ParameterKind
from silo.history.arrays import SampleArrays
from tests.ipc.conftest import Bench
from tests.stand_ins.ticking import turning
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.skipif(importlib.util.find_spec("xxhash") is None, reason="needs silo-logger[ros2]")
if importlib.util.find_spec("xxhash"):
    from silo.bridges.ros2 import graph, parameters
    from silo.bridges.ros2.graph import Graph, joined
    from silo.bridges.ros2.names import Attachment, Distribution, EntityKind, Node, gid_of, ros_name
    from silo.bridges.ros2.pairing import Pairing
    from silo.bridges.ros2.standard import Outlet, outlets_of

JAZZY = get_typestore(Stores.ROS2_JAZZY)
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
WITH_HASHES = {
    "jazzy": Stores.ROS2_JAZZY, "kilted": Stores.ROS2_KILTED, "lyrical": Stores.LATEST, "rolling": Stores.LATEST,
}  # fmt: skip


class TestNames:
    """Pinned to the examples of docs/design.md of ros2/rmw_zenoh; Humble's branch has the same, without hashes."""

    NODE = "8b20917502ee955ac4476e0266340d5c"

    def test_a_node_has_the_token_that_its_design_shows(self):
        node = Node(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")
        assert node.token == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"

    @pytest.mark.parametrize("distribution", ["jazzy", "kilted", "lyrical", "rolling"])
    def test_a_publisher_has_the_key_and_token_that_its_design_shows(self, distribution):
        node, shown = Node(2, self.NODE, "talker"), Distribution(distribution).hash_of(STRING_HASH)
        assert node.entity_token(10, EntityKind.PUBLISHER, "/chatter", "std_msgs/msg/String", shown) == (
            f"@ros2_lv/2/{self.NODE}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{STRING_HASH}/::,10:,:,:,,"
        )
        assert Node(0, self.NODE, "talker").key("/robot1/chatter", "std_msgs/msg/String", shown) == (
            f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
        )

    def test_humble_has_a_word_in_place_of_the_hash(self):
        node, shown = Node(2, self.NODE, "talker"), Distribution.HUMBLE.hash_of(STRING_HASH)
        assert node.key("/chatter", "std_msgs/msg/String", shown) == (
            "2/chatter/std_msgs::msg::dds_::String_/TypeHashNotSupported"
        )
        assert node.entity_token(10, EntityKind.SERVICE, "/a/b", "example_interfaces/srv/AddTwoInts", shown) == (
            f"@ros2_lv/2/{self.NODE}/0/10/SS/%/%/talker/%a%b/example_interfaces::srv::dds_::AddTwoInts_/"
            "TypeHashNotSupported/::,10:,:,:,,"
        )

    def test_an_attachment_is_number_time_and_id_in_that_order(self):
        attachment = Attachment(1, 1_700_000_000_000_000_000, bytes(range(16)))
        assert attachment.encoded().hex() == (
            "0100000000000000" "00002a36fe9c9717" "10" "000102030405060708090a0b0c0d0e0f"
        )  # fmt: skip
        assert Attachment.decoded(attachment.encoded()) == attachment

    @pytest.mark.parametrize("data", [b"", bytes(17), bytes(33), bytes(40)])
    def test_an_attachment_of_somebody_else_is_refused_in_words(self, data):
        with pytest.raises(ValueError, match="attachment"):
            Attachment.decoded(data)

    def test_an_id_is_the_hash_with_its_low_half_first(self):
        # XXH3_128bits of nothing, as xxHash's own documents print it, the high half first
        assert gid_of("")[::-1].hex() == "99aa06d3014798d86001c324468d497f"

    @pytest.mark.parametrize(
        ("text", "name"), [("anymal", "anymal"), ("a-b..c", "a_b_c"), ("7up", "silo_7up"), ("--", "silo")]
    )
    def test_names_become_those_that_ros_takes(self, text, name):
        assert ros_name(text) == name


def outlets(bench: Bench) -> "dict[str, Outlet]":
    return {outlet.topic: outlet for outlet in outlets_of(bench.logger.elements, "bot")[0]}


class TestMessages:
    def test_every_element_has_a_message_that_ros_has(self, bench):
        assert {topic: outlet.type.name for topic, outlet in outlets(bench).items()} == {
            "/bot/log/x": "std_msgs/msg/Float64", "/bot/log/slow": "std_msgs/msg/Float64",
            "/bot/log/kept": "std_msgs/msg/Float64", "/bot/log/q": "geometry_msgs/msg/Vector3Stamped",
            "/bot/log/matrix": "std_msgs/msg/Float32MultiArray", "/bot/log/gait": "std_msgs/msg/Int8",
            "/bot/log/word": "std_msgs/msg/String", "/bot/log/mixed/a": "std_msgs/msg/Float64",
            "/bot/log/mixed/n": "std_msgs/msg/Int32",
        }  # fmt: skip

    @pytest.mark.parametrize("distribution", WITH_HASHES)
    def test_its_hash_is_that_of_the_distribution(self, tmp_path, distribution):
        known = get_typestore(WITH_HASHES[distribution])
        log = silo.Logger("all", frequency=100, folder=tmp_path)
        for number, dtype in enumerate(["b1", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "c16", "S8"]):
            log.add(np.zeros((), dtype), f"scalar{number}")
            log.add(np.zeros(5, dtype), f"five{number}")
        for kind, length in (("quaternion", 4), ("vector", 3)):
            log.add(np.zeros(length), kind, kind=kind)
        for name in ("q", "qd"):
            log.add(np.zeros(7), f"legs/{name}")
        log.update()
        found, left_out = outlets_of(log.elements, "all")
        log.close()
        assert not left_out
        types = {outlet.type.name: outlet.type for outlet in found}
        assert {"std_msgs/msg/Bool", "std_msgs/msg/UInt8MultiArray", "sensor_msgs/msg/JointState"} < set(types)
        hashes = {name: Distribution(distribution).hash_of(one.type_hash) for name, one in types.items()}
        assert hashes == {name: known.hash_rihs01(name) for name in types}

    def test_positions_and_efforts_of_a_group_are_joint_states_of_the_ticks_that_both_have(self, tmp_path):
        log = silo.Logger("all", frequency=100, folder=tmp_path)
        for name, divider, width in (("q", 1, 3), ("tau", 1, 3), ("dq", 2, 3), ("velocity", 1, 4)):
            log.add(np.zeros(width), f"legs/{name}", divider=divider)
        log.add(np.zeros(3), "arm/q")
        log.update()
        found = [one for one in outlets_of(log.elements, "all")[0] if one.topic.endswith("joint_states")]
        log.close()
        assert [(one.topic, one.elements) for one in found] == [
            ("/all/log/legs/joint_states", ("/log/legs/q", "/log/legs/tau"))
        ]
        values = np.arange(9.0).reshape(3, 3)
        positions = SampleArrays(np.array([4, 5, 6]), np.array([40, 50, 60]) * 10**9, values)
        efforts = SampleArrays(np.array([5, 6, 7]), np.array([50, 60, 70]) * 10**9, values)
        pairing = Pairing(found[0].elements)
        times, messages = found[0].encode(pairing.take(dict(zip(found[0].elements, (positions, efforts), strict=True))))
        assert times.tolist() == [50 * 10**9, 60 * 10**9]
        message = JAZZY.deserialize_cdr(messages[0], "sensor_msgs/msg/JointState")
        assert (message.header.stamp.sec, message.name) == (50, ["joint0", "joint1", "joint2"])
        assert [one.tolist() for one in (message.position, message.velocity, message.effort)] == [
            [3, 4, 5], [], [0, 1, 2]
        ]  # fmt: skip


class Echo:
    """What comes to the subscriber of a topic, found by the token that its publisher declared, as rmw_zenoh does."""

    def __init__(self, session: zenoh.Session, topic: str) -> None:
        self.token = wait_until(lambda: next((one for one in tokens(session) if topic.replace("/", "%") in one), ""))
        self.topic = topic
        domain, *_, type_name, type_hash, _ = self.token.split("/")[1:]
        self._type = type_name.replace("::dds_::", "::").replace("::", "/").removesuffix("_")
        self._samples = zenoh.handlers.FifoChannel(100_000)
        self._subscriber = session.declare_subscriber(f"{domain}{topic}/{type_name}/{type_hash}", self._samples)

    def next(self) -> "tuple[Attachment, object]":
        """Wait for a message."""
        sample = wait_until(self._subscriber.try_recv)
        return Attachment.decoded(sample.attachment.to_bytes()), JAZZY.deserialize_cdr(
            sample.payload.to_bytes(), self._type
        )

    def close(self) -> None:
        self._subscriber.undeclare()


def tokens(session: zenoh.Session) -> list[str]:
    """All liveliness tokens of domain 7."""
    return [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/7/**") if reply.ok is not None]


class Joined:
    """A bridge to the bench's logger in this process."""

    def __init__(self, router: str, distribution: "Distribution", *, control: bool = False) -> None:
        self.said: list[str] = []
        self._joined = joined(router)
        session = self._joined.__enter__()
        node = Node(7, str(session.zid()), "bot")
        self.graph = Graph(
            session,
            node,
            distribution,
            lambda listener: LoggerFollower(lambda: Client.connect("bot"), listener),
            self.said.append,
            setting(lambda: Client.connect("bot")) if control else None,
        )
        self._serving = self.graph.serving(services(lambda: Client.connect("bot"), "bot") if control else {})
        self._serving.__enter__()

    def reads(self, *names: str) -> None:
        """Wait until the samples of exactly these elements come."""
        wait_until(lambda: self.graph._feed._streamed == set(names))

    def close(self) -> None:
        self._serving.__exit__(None, None, None)
        self._joined.__exit__(None, None, None)


@pytest.fixture
def router(runtime_folder: Path) -> Iterator[str]:
    """A Zenoh router as rmw_zenohd is one, on a socket of its own."""
    endpoint = f"unixsock-stream/{runtime_folder}/router"
    config = zenoh.Config()
    for key, value in {
        "mode": "router", "listen/endpoints": [endpoint], "scouting/multicast/enabled": False,
        "scouting/delay": 0,
    }.items():  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config):
        yield endpoint


@pytest.fixture
def other(router: str) -> Iterator[zenoh.Session]:
    """Another node's session."""
    with joined(router) as session:
        yield session


@pytest.fixture
def join(bench: Bench, router: str) -> Iterator[Callable[..., Joined]]:
    """Joins the bench's logger to the graph."""
    made: list[Joined] = []

    def start(distribution: str = "jazzy", **arguments: bool) -> Joined:
        made.append(Joined(router, Distribution(distribution), **arguments))
        return made[-1]

    yield start
    for one in made:
        one.close()


class TestGraph:
    def test_each_sample_arrives_once_with_its_number_time_and_publisher(self, bench, client, join, other):
        bridge = join()
        echo = Echo(other, "/bot/log/x")
        bridge.reads("/log/x")
        client.start()
        bench.ticks(300)
        got = [echo.next() for _ in range(300)]
        assert [attachment.sequence for attachment, _ in got] == list(range(1, 301))
        assert [attachment.time_ns for attachment, _ in got] == [
            bench.begin_ns + tick * bench.tick_ns for tick in range(300)
        ]
        assert {attachment.gid for attachment, _ in got} == {gid_of(echo.token)}
        assert [message.data for _, message in got] == list(range(1, 301))

    def test_every_type_arrives(self, bench, client, join, other):
        bridge = join()
        names = ("q", "matrix", "gait", "word", "mixed/a", "mixed/n")
        echoes = {name: Echo(other, f"/bot/log/{name}") for name in names}
        bridge.reads(*(f"/log/{name}" for name in ("q", "matrix", "gait", "word", "mixed")))
        bench.q[:], bench.matrix[:], bench.gait[...], bench.mixed[...] = (1, 2, 3), [[1, 2], [3, 4]], 1, (0.5, 7)
        bench.word[...] = "größe".encode()
        client.start()
        bench.ticks(1)
        got = {name: echo.next()[1] for name, echo in echoes.items()}
        stamp, vector = got["q"].header.stamp, got["q"].vector
        assert (stamp.sec * 10**9 + stamp.nanosec, vector.x, vector.y, vector.z) == (bench.begin_ns, 1, 2, 3)
        assert [got[name].data for name in ("gait", "word", "mixed/a", "mixed/n")] == [1, "größe", 0.5, 7]
        assert got["matrix"].data.tolist() == [1, 2, 3, 4]
        assert [(one.label, one.size, one.stride) for one in got["matrix"].layout.dim] == [
            ("rows", 2, 4), ("cols", 2, 2)
        ]  # fmt: skip

    def test_a_derived_signal_is_a_topic(self, bench, client, join, other):
        bridge = join()
        client.derive("twice", "2 * x")
        echo = Echo(other, "/bot/log/twice")
        bridge.reads("/log/twice")
        client.start()
        bench.ticks(3)
        assert [echo.next()[1].data for _ in range(3)] == [2, 4, 6]

    def test_what_nobody_subscribes_to_is_not_read_and_without_control_there_is_no_service(self, join, other):
        bridge = join()
        echo = Echo(other, "/bot/log/x")
        bridge.reads("/log/x")
        assert not any("/SS/" in token for token in tokens(other))
        echo.close()
        bridge.reads()

    def test_what_is_switched_off_leaves_the_graph(self, client, join, other):
        join("humble")
        Echo(other, "/bot/log/q")
        client.apply([Edit("/log/q", ElementOptions(enabled=False))], -1)
        wait_until(lambda: not any("%bot%log%q" in token for token in tokens(other)))
        assert all(token.split("/")[-2] == "TypeHashNotSupported" for token in tokens(other) if "/MP/" in token)

    def test_a_topic_of_other_elements_than_before_is_made_of_those(self, join, tmp_path):
        graph = join().graph
        wait_until(lambda: graph._topics)  # it has begun
        log = silo.Logger("all", frequency=100, folder=tmp_path)
        for name in ("q", "velocity", "tau"):
            log.add(np.zeros(3), f"legs/{name}")
        log.update()
        whole = log.elements
        log.close()
        for some in (whole, [whole[0], whole[2]]):
            graph._renew("bot", some)
            (states,) = [one.outlet for one in graph._topics.values() if one.outlet.topic.endswith("joint_states")]
            assert states.elements == tuple(one.name for one in some)


def call(session: zenoh.Session, name: str) -> tuple[bool, str]:
    """Call a service of type Trigger, as rmw_zenoh's clients do."""
    key = (
        f"7{name}/std_srvs::srv::dds_::Trigger_/RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
    )
    asked = Attachment(3, time.time_ns(), bytes(range(16)))
    (reply,) = session.get(key, payload=b"\0\1\0\0\0", attachment=asked.encoded(), timeout=DEADLINE_S)
    answer = Attachment.decoded(reply.ok.attachment.to_bytes())
    assert (answer.sequence, answer.gid) == (asked.sequence, asked.gid)
    data = reply.ok.payload.to_bytes()
    (length,) = struct.unpack_from("<I", data, 8)
    return bool(data[4]), data[12 : 12 + length - 1].decode()


class TestServices:
    def test_with_control_it_is_started_stopped_and_saved_and_what_is_refused_is_said(self, bench, join, other):
        join(control=True)
        wait_until(lambda: sum("/SS/%/%/bot/%bot%" in token for token in tokens(other)) == 3)
        assert call(other, "/bot/start")[0]
        assert bench.logger._life.state is State.RUNNING
        bench.ticks(5)
        done, said = call(other, "/bot/stop")
        assert (done, "stopped" in said, bench.logger._life.state) == (True, True, State.STOPPED)
        done, said = call(other, "/bot/save")
        assert (done, said.startswith("saved ")) == (True, True)
        bench.logger.close()
        done, said = call(other, "/bot/start")
        assert (done, "no logger" in said) == (False, True)


PARAMETERS = {
    "ListParameters": ([("prefixes", "string[]"), ("depth", "uint64")], [("result", "ListParametersResult")]),
    "GetParameters": ([("names", "string[]")], [("values", "ParameterValue[]")]),
    "GetParameterTypes": ([("names", "string[]")], [("types", "uint8[]")]),
    "DescribeParameters": ([("names", "string[]")], [("descriptors", "ParameterDescriptor[]")]),
    "SetParameters": ([("parameters", "Parameter[]")], [("results", "SetParametersResult[]")]),
    "SetParametersAtomically": ([("parameters", "Parameter[]")], [("result", "SetParametersResult")]),
}


def field(kind: str) -> tuple:
    """A field as rosbags has it in its stores."""
    one, many = kind.removesuffix("[]"), kind.endswith("[]")
    base = (Nodetype.BASE, (one, 0)) if one.islower() or one[-1].isdigit() else (Nodetype.NAME, one)
    base = (Nodetype.NAME, f"rcl_interfaces/msg/{one}") if one[0].isupper() else base
    return (Nodetype.SEQUENCE, (base, 0)) if many else base


@functools.cache
def ros(store: Stores):
    """The messages of a distribution with the services of parameters, for which rosbags has none."""
    known = get_typestore(store)
    info = known.fielddefs["service_msgs/msg/ServiceEventInfo"][1]
    octets = (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16))  # what `char` is in ROS 2
    known.fielddefs["service_msgs/msg/ServiceEventInfo"] = (
        (),
        [(name, octets if name == "client_gid" else kind) for name, kind in info],
    )
    for short, (request, response) in PARAMETERS.items():
        name = f"rcl_interfaces/srv/{short}"
        parts = [(Nodetype.NAME, f"{name}_{part}") for part in ("Request", "Response", "Event")]
        for part, fields in zip(parts, (request, response), strict=False):
            known.register({part[1]: ([], [(word, field(kind)) for word, kind in fields])})
        event = [("request", (Nodetype.SEQUENCE, (parts[0], 1))), ("response", (Nodetype.SEQUENCE, (parts[1], 1)))]
        known.fielddefs[parts[2][1]] = ((), [("info", (Nodetype.NAME, "service_msgs/msg/ServiceEventInfo")), *event])
        words = ("request_message", "response_message", "event_message")
        known.fielddefs[name] = ((), list(zip(words, parts, strict=True)))
    return known


class TestParameters:
    @pytest.fixture
    def asked(self, bench, join, other):
        """What calls the services of a node with parameters, whose loop turns, as another node does it."""
        logger = bench.logger
        logger.parameter("kp", 40.0, min=0, max=200, unit="Nm", group="legs", writable="anywhere", description="stiff")
        logger.parameter("style", "trot", choices=("walk", "trot"), group="legs", writable="anywhere")
        logger.parameter("limits", [1.0, 2.0], writable="anywhere")
        logger.parameter("steps", 5, min=1, max=9, step=2)
        logger.parameter("on", True, writable="anywhere")
        logger.parameter("words", ["a", "bc"], writable="anywhere")
        logger.start()
        join(control=True)
        wait_until(lambda: sum("rcl_interfaces::srv" in token for token in tokens(other)) == 6)
        known = ros(Stores.ROS2_JAZZY)

        def ask(service: str, *values: object) -> object:
            token = next(one for one in tokens(other) if f"::{service}_/" in one)
            name, type_name, type_hash = token.split("/")[-4].replace("%", "/"), *token.split("/")[-3:-1]
            request = known.types[f"rcl_interfaces/srv/{service}_Request"](*values)
            payload = bytes(known.serialize_cdr(request, f"rcl_interfaces/srv/{service}_Request"))
            attachment = Attachment(3, time.time_ns(), bytes(range(16))).encoded()
            key = f"7{name}/{type_name}/{type_hash}"
            (reply,) = other.get(key, payload=payload, attachment=attachment, timeout=DEADLINE_S)
            return known.deserialize_cdr(reply.ok.payload.to_bytes(), f"rcl_interfaces/srv/{service}_Response")

        def parameter(name: str, kind: int, value: object = None) -> object:
            fields = [kind, False, 0, 0.0, "", *(np.array([], code) for code in ("u1", "?", "i8", "f8")), []]
            if kind:
                fields[kind] = value
            one = known.types["rcl_interfaces/msg/ParameterValue"](*fields)
            return known.types["rcl_interfaces/msg/Parameter"](name, one)

        with turning(logger.collect):
            yield ask, parameter, logger

    @pytest.mark.parametrize("distribution", WITH_HASHES)
    def test_types_and_hashes_are_those_of_the_distribution(self, distribution):
        known = ros(WITH_HASHES[distribution])
        assert {
            name: known.hash_rihs01(f"rcl_interfaces/srv/{name}") for name in parameters.HASHES
        } == parameters.HASHES
        assert known.hash_rihs01(parameters.EVENT) == parameters.EVENT_HASH

    def test_they_are_listed_described_and_read_as_other_people_decode_them(self, asked):
        ask, _, _ = asked
        names = ["log.legs.kp", "log.legs.style", "log.limits", "log.steps", "log.on", "log.words"]
        listed = ask("ListParameters", [], 0).result
        assert (listed.names, listed.prefixes) == (names, ["log.legs", "log"])
        assert ask("ListParameters", ["log.legs"], 1).result.names == names[:2]
        assert ask("ListParameters", ["log"], 1).result.names == names[2:]
        assert ask("ListParameters", ["lo"], 0).result.names == []
        values = ask("GetParameters", [*names, "none"]).values
        assert [one.type for one in values] == ask("GetParameterTypes", [*names, "none"]).types.tolist()
        assert [one.type for one in values] == [3, 4, 8, 2, 1, 9, 0]
        assert (values[0].double_value, values[1].string_value, values[2].double_array_value.tolist()) == (
            40.0, "trot", [1.0, 2.0],
        )  # fmt: skip
        assert (values[3].integer_value, values[4].bool_value, values[5].string_array_value) == (5, True, ["a", "bc"])
        kp, style, steps, none = ask(
            "DescribeParameters", ["log.legs.kp", "log.legs.style", "log.steps", "x"]
        ).descriptors
        assert (kp.name, kp.type, kp.description, kp.read_only) == ("log.legs.kp", 3, "Nm; stiff", False)
        (range_,) = kp.floating_point_range
        assert (range_.from_value, range_.to_value, range_.step) == (0.0, 200.0, 0.0)
        assert (style.additional_constraints, style.floating_point_range) == ("one of walk, trot", [])
        assert (steps.read_only, steps.integer_range[0].to_value, steps.integer_range[0].step) == (True, 9, 2)
        assert (none.name, none.type) == ("", 0)

    def test_they_are_set_alone_or_together_and_each_change_is_an_event(self, asked, other):
        ask, parameter, logger = asked
        events = Echo(other, "/parameter_events")
        given = [parameter("log.legs.kp", 3, 50.0), parameter("log.legs.kp", 3, 300.0), parameter("log.steps", 2, 7)]
        results = ask("SetParameters", given).results
        assert [one.successful for one in results] == [True, False, False]
        assert "0 to 200" in results[1].reason
        assert "set on the robot alone" in results[2].reason
        (changed,) = events.next()[1].changed_parameters
        assert (changed.name, changed.value.type, changed.value.double_value) == ("log.legs.kp", 3, 50.0)
        refused = [parameter("log.on", 1, False), parameter("log.legs.style", 4, "fly")]
        result = ask("SetParametersAtomically", refused).result
        assert (result.successful, "walk, trot" in result.reason, bool(logger.parameters["on"])) == (False, True, True)
        fit = [
            parameter("log.on", 1, False), parameter("log.legs.style", 4, "walk"),
            parameter("log.words", 9, ["x", "y"]), parameter("log.limits", 8, np.array([3.0, 4.0])),
        ]  # fmt: skip
        assert ask("SetParametersAtomically", fit).result.successful
        assert not ask("SetParametersAtomically", [parameter("log.on", 0)]).result.successful
        assert "no parameter" in ask("SetParametersAtomically", [parameter("log.none", 1, True)]).result.reason
        assert logger.parameters.read() == {
            "/log/legs/kp": 50.0, "/log/legs/style": "walk", "/log/limits": (3.0, 4.0), "/log/steps": 5,
            "/log/on": False, "/log/words": ("x", "y"),
        }  # fmt: skip

    def test_without_control_they_are_read_alone(self, bench):
        node = parameters.NodeParameters("/bot", None, "somebody", Audit(lambda _: None))
        bench.logger.parameter("kp", 40.0, writable="anywhere")
        known = ros(Stores.ROS2_JAZZY)
        event = known.deserialize_cdr(node.turn(bench.logger.parameters.landing.described()), parameters.EVENT)
        assert (event.node, [one.name for one in event.new_parameters]) == ("/bot", ["log.kp"])
        assert node._tuned({"log.kp": 1.0})[0] is False
        assert [one.name for one in known.deserialize_cdr(node.turn([]), parameters.EVENT).deleted_parameters] == [
            "log.kp"
        ]
        assert node.turn([]) is None

    @pytest.mark.parametrize(
        ("values", "given", "words"),
        [
            ({"log.legs.kp": 50.0, "log.n": 7}, {"/log/legs/kp": 50.0, "/log/n": 7}, "2 set"),
            ({"log.legs.kp": 50.0, "log.x": 1, "log.y": 2}, None, "no parameter log.x, log.y; nothing was changed"),
            ({"log.legs.kp": None, "log.n": 7}, None, "can't be taken away, it is the program's; nothing was changed"),
            ({"log.n": 77}, None, "log.n is at most 9"),
        ],
    )
    def test_what_is_set_together_reaches_the_robot_as_a_whole_or_is_refused_in_words(self, values, given, words):
        infos = ParameterInfo("/log/legs/kp", ParameterKind.FLOAT, 1.0), ParameterInfo("/log/n", ParameterKind.INT, 5)
        known, told, came = ros(Stores.ROS2_JAZZY), [], []

        def tune(wanted, caller, elsewhere):
            if wanted.get("/log/n", 0) > 9:
                raise silo.RefusedError("log.n is at most 9")
            came.append((wanted, caller, elsewhere))
            return f"{len(wanted)} set", list(infos)

        node = parameters.NodeParameters("/bot", tune, "somebody", Audit(told.append))
        node.turn(infos)
        kinds = {float: (3, "double_value"), int: (2, "integer_value")}
        empty = [0, False, 0, 0.0, "", *(np.array([], code) for code in ("u1", "?", "i8", "f8")), []]
        asked = []
        for name, value in values.items():
            one = known.types["rcl_interfaces/msg/ParameterValue"](*empty)
            if value is not None:
                one = replace(one, type=kinds[type(value)][0], **{kinds[type(value)][1]: value})
            asked.append(known.types["rcl_interfaces/msg/Parameter"](name, one))
        kind, _, answer = node.services()["/bot/set_parameters_atomically"]
        request = known.types[f"{kind}_Request"](asked)
        data = answer(bytes(known.serialize_cdr(request, f"{kind}_Request")))
        result = known.deserialize_cdr(data, f"{kind}_Response").result
        assert (result.successful, words in result.reason) == (given is not None, True)
        assert came == ([(given, "somebody", True)] if given else [])
        assert told == [f"{', '.join(values)}, set by somebody: {result.reason}"]

    def test_what_is_no_request_is_told_in_words(self):
        node = parameters.NodeParameters("/bot", None, "somebody", Audit(lambda _: None))
        whole = b"\0\1\0\0" + struct.pack("<I", 2) + struct.pack("<I", 3) + b"ab\0\0" + struct.pack("<I", 1)
        for answer in (one[2] for one in node.services().values()):
            for data in [whole[:size] for size in range(16)] + [whole[:4] + b"\xff" * 40, b"\0\0" + whole]:
                with pytest.raises(ValueError, match="a request"):
                    answer(data)

    def test_a_text_that_is_no_utf_8_is_told_in_words_and_the_next_is_answered(self, asked, other):
        ask, _, _ = asked
        token = next(one for one in tokens(other) if "::GetParameters_/" in one)
        key = "/".join(["7" + token.split("/")[-4].replace("%", "/"), *token.split("/")[-3:-1]])
        wrong = b"\0\1\0\0" + struct.pack("<II", 1, 4) + b"k\xffp\0"
        attachment = Attachment(3, time.time_ns(), bytes(range(16))).encoded()
        (reply,) = other.get(key, payload=wrong, attachment=attachment, timeout=DEADLINE_S)
        told = reply.err.payload.to_bytes().decode()
        assert told == r"silo: a request has a text that is not UTF-8: b'k\xffp'"
        assert ask("GetParameters", ["log.legs.kp"]).values[0].double_value == 40.0


class TestPrograms:
    def test_no_router_is_said_with_the_way_out(self, runtime_folder, monkeypatch):
        monkeypatch.setattr(graph, "OPEN_MS", 100)
        with pytest.raises(silo.SiloError, match="ros2 run rmw_zenoh_cpp rmw_zenohd"):
            joined(f"unixsock-stream/{runtime_folder}/nobody").__enter__()

    @pytest.mark.slow
    def test_the_command_goes_on_when_the_robot_is_started_anew(self, bench, router, other, tmp_path):
        words = ["ros2", "bot", "--router", router, "--domain", "7", "--distro", "kilted"]
        command = [sys.executable, "-c", "from silo.cli import main; main()", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
            try:
                assert "bot is node /bot in domain 7" in program.stdout.readline()
                Echo(other, "/bot/log/kept")
                bench.logger.close()
                wait_until(lambda: not any("/MP/" in token for token in tokens(other)))
                with silo.Logger("bot", frequency=100, folder=tmp_path) as again:
                    again.array("fresh", 2)
                    again.serve()
                    Echo(other, "/bot/log/fresh")
            finally:
                program.send_signal(signal.SIGINT)
            assert program.wait(DEADLINE_S) == 0
        wait_until(lambda: not tokens(other))

    @pytest.mark.slow
    def test_other_peoples_subscriber_gets_every_sample(self, bench, client, join, router, monkeypatch, tmp_path):
        sdk = pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk")
        endpoints = json.dumps([router])
        monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f"connect/endpoints={endpoints}")
        got: list[float] = []
        subscriber = sdk.ROS2Subscriber(
            "/bot/log/x", "std_msgs/msg/Float64", lambda message: got.append(message.data), "float64 data", domain_id=7
        )
        try:
            bridge = join()
            bridge.reads("/log/x")
            client.start()
            bench.ticks(200)
            wait_until(lambda: len(got) == 200)
            assert got == list(range(1, 201))
        finally:
            subscriber.close()
            subscriber.session_mgr.session.close()
