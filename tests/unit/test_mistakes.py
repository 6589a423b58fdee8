"""Natural mistakes at every door of the Python API: each is told of by an error of silo that names what is wrong.

An operator that signals lack is Python's own TypeError.
"""

import copy
import datetime
import enum
import math
import pickle

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import Edit
from silo.logger.null import NullLogger

Z, N = np.zeros(3), np.zeros(1, int)
ODD = "\ud800"  # half a character: no file can hold it


class Colour(enum.Enum):
    RED = "red"


class Thing:
    x = 1.0
    half = ODD

    def __init__(self):
        self.inside = {}
        self.inside["itself"] = self.inside


class Hostile:
    """Fails wherever it is looked into."""

    def __repr__(self):
        raise RuntimeError("no")

    def __bool__(self):
        raise ValueError("no")

    @property
    def __array_interface__(self):
        raise ValueError("no")


ADD = {
    "name and variable exchanged": (lambda log: log.add("tau", Z), 'write log.add(tau, "tau")'),
    "a number for a name": (lambda log: log.add(Z, 5), "name must be a text, got 5 (int)"),
    "bytes for a name": (lambda log: log.add(Z, b"z"), "name must be a text, got b'z' (bytes)"),
    "an array for a name": (lambda log: log.add(Z, Z), "name must be a text, got array"),
    "a blank name": (lambda log: log.add(Z, " "), "more than blanks"),
    "half a character in a name": (lambda log: log.add(Z, ODD), "whole characters"),
    "a number for a group": (lambda log: log.add(Z, "z", group=5), 'group must be a text, got 5 (int); write group="'),
    "None for a group": (lambda log: log.add(Z, "z", group=None), "group must be a text, got None"),
    "a number for a unit": (lambda log: log.add(Z, "z", unit=5), "unit must be a text, got 5"),
    "units in a list": (lambda log: log.add(Z, "z", unit=["m"] * 3), "unit must be a text"),
    "a unit of two lines": (lambda log: log.add(Z, "z", unit="m\n"), "unit must be of printable characters"),
    "a number for a description": (lambda log: log.add(Z, "z", description=5), "description must be a text"),
    "half a character in a description": (lambda log: log.add(Z, "z", description=ODD), "whole characters"),
    "a number for a kind": (lambda log: log.add(Z, "z", kind=5), "kind must be a text"),
    "a list for a kind": (lambda log: log.add(Z, "z", kind=["pose"]), "kind must be a text"),
    "a number for labels": (lambda log: log.add(N, "n", labels=5), "labels must be an enumeration or a dict"),
    "a list for labels": (lambda log: log.add(N, "n", labels=["a", "b"]), "labels={0: 'stand', 1: 'walk'}"),
    "a member for labels": (lambda log: log.add(N, "n", labels=Colour.RED), "labels must be an enumeration"),
    "labels the wrong way round": (lambda log: log.add(N, "n", labels={"a": 0}), "labels must be a whole number"),
    "numbers as labels": (lambda log: log.add(N, "n", labels={0: 5}), "label of 0 must be a text"),
    "labels beyond 64 bits": (
        lambda log: log.add(N, "n", labels={10**30: "a"}),
        "whole number from -9223372036854775808",
    ),
    "labels of floats": (lambda log: log.add(Z, "z", labels={0: "a"}), "labels name the values of integers"),
    "a negative string_bytes": (lambda log: log.add(lambda: "a", "s", string_bytes=-1), "from 1 to 1000000, got -1"),
    "text for string_bytes": (lambda log: log.add(lambda: "a", "s", string_bytes="64"), "got '64'"),
    "a float for string_bytes": (lambda log: log.add(lambda: "a", "s", string_bytes=1.5), "got 1.5"),
    "a huge string_bytes": (lambda log: log.add(lambda: "a", "s", string_bytes=10**12), "got 1000000000000"),
    "a number for attr": (lambda log: log.add(Thing(), "x", attr=5), "an attribute must be a text"),
    "bytes for attr": (lambda log: log.add(Thing(), "x", attr=b"x"), "an attribute must be a text"),
    "attributes in a list": (lambda log: log.add(Thing(), "x", attr=["x"]), "an attribute must be a text"),
    "a class": (lambda log: log.add(Thing, "thing"), "Thing is a class, not a variable"),
    "what holds itself": (lambda log: log.add(Thing(), attr="inside"), "holds itself"),
    "what fails when looked into": (
        lambda log: log.add(Hostile(), "h"),
        "h: looking into Hostile failed (ValueError: no)",
    ),
    "a hostile name": (lambda log: log.add(Z, Hostile()), "got a Hostile"),
}
CALLS = {
    "an argument misspelt": (
        lambda log: log.add(Z, "z", dividr=2),
        "log.add() has no argument 'dividr', did you mean 'divider'?",
    ),
    "the original's bufferSize": (
        lambda log: log.add(Z, "z", bufferSize=9),
        "did you mean 'size'?: write size=1000",
    ),
    "the original's bufferType": (lambda log: log.add(Z, "z", bufferType=1), "did you mean 'buffer'?"),
    "a short word of set": (lambda log: log.add(Z, "z", buf="looping"), "did you mean 'buffer'?"),
    "a word of now and the one of before": (lambda log: log.add(Z, "z", size=9, buffer_size=9), "did you mean 'size'?"),
    "a rate": (lambda log: log.add(Z, "z", rate=50), 'write divider=2 (every second tick) or divider="50Hz"'),
    "units": (lambda log: log.add(Z, "z", units="m"), "did you mean 'unit'?"),
    "a type": (lambda log: log.add(Z, "z", type="pose"), "did you mean 'kind'?"),
    "a thing unheard of": (lambda log: log.add(Z, "z", colour=2), "no argument 'colour', it takes source, name, group"),
    "nothing": (
        lambda log: log.add(),
        "log.add() needs source: write log.add(source, name=..., group=..., unit=..., ...)",
    ),
    "a name alone": (lambda log: log.add("tau"), 'write log.add(tau, "tau")'),
    "a name twice": (lambda log: log.add(Z, "z", name="z"), "got 'name' twice"),
    "too much by place": (lambda log: log.add(Z, "z", "", "-", 1, 1, 9, 1, 5), "takes 8 arguments by place"),
    "buffer size and type exchanged": (
        lambda log: log.add(Z, "z", "", "-", 1, silo.Action.SAVE, silo.BufferType.LOOPING, 100),
        "buffer must be",
    ),
    "a type for a size": (
        lambda log: log.add(Z, "z", size=silo.BufferType.LOOPING),
        "size must be a whole number from 1 to 2147483647, got BufferType.LOOPING, "
        "which is for buffer: write buffer='looping'",
    ),
    "a type for an action": (
        lambda log: log.add(Z, "z", action=silo.BufferType.LOOPING),
        "which is for buffer: write buffer='looping'",
    ),
    "an action for a type": (
        lambda log: log.add(Z, "z", buffer=silo.Action.SAVE),
        "which is for action: write action='save'",
    ),
    "an action misspelt": (lambda log: log.add(Z, "z", action="pubish"), "got pubish; did you mean 'publish'?"),
    "a member's name": (lambda log: log.add(Z, "z", action="Action.SAVE"), "did you mean 'save'?"),
    "a ring": (lambda log: log.add(Z, "z", buffer="ring"), "did you mean 'looping'?"),
    "a whole float": (lambda log: log.add(Z, "z", divider=500 / 100), "got 5.0; write divider=5"),
    "half a tick": (lambda log: log.add(Z, "z", divider=2.5), "got 2.5; nothing was changed"),
    "several dividers": (lambda log: log.add(Z, "z", divider=np.array([1, 2])), "divider must be a whole number"),
    "a number for an action": (lambda log: log.add(Z, "z", action=7), "save (1), both (0) or publish (2), got 7"),
    "None for a divider": (lambda log: log.add(Z, "z", divider=None), "divider must be a whole number"),
    "a short kind": (lambda log: log.add(np.zeros(4), "z", kind="quat"), "unknown kind 'quat'"),
    "a kind in capitals": (lambda log: log.add(np.zeros(4), "z", kind="Quaternion"), "did you mean 'quaternion'?"),
    "array of nothing": (lambda log: log.array(), "log.array() needs name: write log.array(name, shape=..."),
    "array with a misspelt argument": (
        lambda log: log.array("q", 3, unt="rad"),
        "log.array() has no argument 'unt', did you mean 'unit'?",
    ),
    "array with a unit by place": (
        lambda log: log.array("q", 3, float, "rad"),
        "takes 3 arguments by place (name, shape, dtype), got 4",
    ),
    "update by place": (
        lambda log: log.update(False),
        "takes no arguments by place, got 1; name the others: read_script=False",
    ),
    "update as the original": (lambda log: log.update(readScript=True), "did you mean 'read_script'?"),
    "set a number by place": (lambda log: log.set("z", 2), "log.set() takes 1 argument by place (name), got 2"),
    "start by place": (lambda log: log.start(True), "name the others: unsaved=True"),
    "serve a group by place": (lambda log: log.serve("robot"), "name the others: group='robot'"),
    "serve misspelt": (lambda log: log.serve(groups="x"), "did you mean 'group'?"),
    "save by type": (lambda log: log.save(type="csv"), "log.save() has no argument 'type', did you mean 'types'?"),
    "save to a path": (lambda log: log.save("csv", path="x"), "did you mean 'folder'?"),
    "read nothing": (lambda log: log.read_new_values(), "needs name: write log.read_new_values(name)"),
    "close with an argument": (lambda log: log.close(True), "log.close() takes no arguments by place, got 1"),
    "remove nothing": (lambda log: log.remove("/"), "name an element or a namespace"),
    "remove what isn't there": (lambda log: log.remove("nope"), "no element or namespace 'nope'"),
}
ARRAY = {
    "a negative length": (lambda log: log.array("a", -1), "each length of shape must be a whole number from 0"),
    "a negative length in a tuple": (lambda log: log.array("a", (2, -3)), "got -3"),
    "two negative lengths": (lambda log: log.array("a", (-2, -3)), "got -2"),
    "a float": (lambda log: log.array("a", 1.5), "shape must be a whole number or several"),
    "a float in a tuple": (lambda log: log.array("a", (1.5,)), "got 1.5"),
    "text": (lambda log: log.array("a", "3"), 'write log.array("q", 12)'),
    "None": (lambda log: log.array("a", None), "shape must be"),
    "True": (lambda log: log.array("a", True), "got True"),
    "the type in its place": (lambda log: log.array("a", float), "shape must be"),
    "the type's name in its place": (lambda log: log.array("a", "f8"), 'log.array("n", dtype=int)'),
    "too many values": (lambda log: log.array("a", 10**12), "got 1000000000000"),
    "too many values together": (lambda log: log.array("a", (10**5, 10**5)), "1000000 values together"),
    "more than 64 bits": (lambda log: log.array("a", 10**30), "from 0 to 1000000"),
    "too many dimensions": (lambda log: log.array("a", (1,) * 70), "at most 32 dimensions"),
    "name and shape exchanged": (lambda log: log.array(3, "a"), "name must be a text, got 3"),
    "no such dtype": (lambda log: log.array("a", dtype="nonsense"), "dtype 'nonsense' is no type of NumPy"),
    "a number for a dtype": (lambda log: log.array("a", dtype=5), "dtype 5 is no type"),
    "a field twice": (lambda log: log.array("a", dtype=[("a", float), ("a", int)]), "occurs more than once"),
    "objects": (lambda log: log.array("a", dtype=object), "no fixed size"),
    "a time without unit": (lambda log: log.array("a", dtype="M8"), "dtype='M8[ns]'"),
    "a number for a unit": (lambda log: log.array("a", 3, unit=5), "unit must be a text"),
}
TABLE = {
    "set a setting misspelt": (lambda log: log.set("z", dividr=2), "no setting 'dividr'; did you mean 'divider'?"),
    "set a name misspelt": (
        lambda log: log.set("zz", divider=2),
        "no element or namespace 'zz'; did you mean '/log/z'?",
    ),
    "set a setting twice": (lambda log: log.set("z", divider=2, div=3), "divider is given twice"),
    "set text for a switch": (lambda log: log.set("z", enabled="maybe"), "enabled must be on or off, got maybe"),
    "remove a number": (lambda log: log.remove(5), "name must be a text, got 5"),
    "set a number": (lambda log: log.set(5, divider=5), "name must be a text, got 5"),
    "set None": (lambda log: log.set(None, divider=5), "name must be a text"),
    "set a list": (lambda log: log.set(["x", "z"], divider=2), "one call for each"),
    "apply a number": (lambda log: log._scripted.apply(5), "edits must be a list"),
    "apply numbers": (lambda log: log._scripted.apply([5]), "an edit must be silo.Edit"),
    "apply texts": (lambda log: log._scripted.apply("x"), "edits must be a list"),
    "apply options alone": (lambda log: log._scripted.apply([silo.ElementOptions()]), "an edit must be"),
    "apply an edit of a number": (lambda log: log._scripted.apply([Edit(5, silo.ElementOptions())]), "an edit must be"),
    "load a number": (lambda log: log.load_script(5), "path must be a path, got 5"),
    "load a list": (lambda log: log.load_script(["a"]), "path must be a path"),
    "load NUL": (lambda log: log.load_script("a\0b"), "without NUL"),
    "load a long name": (lambda log: log.load_script("x" * 5000), "at most 4095 bytes"),
    "save to a number": (lambda log: log.save_script(5), "path must be a path"),
    "save to a long name": (lambda log: log.save_script("x" * 300), "255 in each name"),
    "update with a number": (lambda log: log.update(read_script=5), "read_script must be True or False"),
}
DATA = {
    "a row that there isn't": (lambda log: log.elements["zz"], "no element 'zz'; did you mean '/log/z'?"),
    "save a number": (lambda log: log.save(5), "unknown file type 5; there are"),
    "save None": (lambda log: log.save(None), "unknown file type None"),
    "save a wrong word": (lambda log: log.save(["cvs"]), "did you mean 'csv'?"),
    "save two in one text": (lambda log: log.save("csv, silo"), "write ['csv', 'silo']"),
    "save a name as type": (lambda log: log.save("run.csv"), "log.save('csv', name='run')"),
    "save what is converted": (lambda log: log.save("parquet"), "`silo convert` writes .parquet"),
    "save as the original": (lambda log: log.save("binary"), "did you mean 'silo'?"),
    "save bytes": (lambda log: log.save(b"csv"), "unknown file type b'csv'"),
    "save an array": (lambda log: log.save(Z), "unknown file type"),
    "save under a number": (lambda log: log.save("csv", 5), "name must be a text, got 5"),
    "save in a number": (lambda log: log.save("csv", "x", 5), "folder must be a path, got 5"),
    "save in NUL": (lambda log: log.save("csv", folder="a\0b"), "without NUL"),
    "read a number": (lambda log: log.read_new_values(5), "name must be a text"),
    "read None": (lambda log: log.read_new_values(None), "name must be a text"),
    "serve a number": (lambda log: log.serve(group=5), "group must be a text"),
    "serve no group": (lambda log: log.serve(group=""), "no group ''"),
    "serve a strange group": (lambda log: log.serve(group="no-such-group"), "groupadd no-such-group"),
    "serve by a number": (lambda log: log.serve(config=5), "config must be a path, got 5"),
    "serve by no file": (lambda log: log.serve(config="nope.json5"), "nope.json5 (No such file or directory)"),
    "serve by a folder": (lambda log: log.serve(config="."), "config must be a file"),
}
MADE = {
    "the time step": (lambda: silo.Logger("a", dt=0.002), "did you mean 'frequency'?: write frequency=500 (ticks per"),
    "a short word for frequency": (
        lambda: silo.Logger("a", freq=500),
        "silo.Logger() has no argument 'freq', did you mean 'frequency'?",
    ),
    "the rate": (lambda: silo.Logger("a", rate=500), "did you mean 'frequency'?"),
    "the name of the option": (lambda: silo.Logger("a", frequency_hz=500), "did you mean 'frequency'?"),
    "the frequency by place": (
        lambda: silo.Logger("a", 500),
        "takes 1 argument by place (name), got 2; name the others: frequency=500",
    ),
    "a time as a text": (lambda: silo.connect("a", timeout_s="5 S"), "got '5 S'; write timeout_s=5"),
    "a blank in the name": (lambda: silo.Logger("my robot"), "write silo.Logger('my_robot')"),
    "a storage misspelt": (lambda: silo.Logger("a", storage="dsik"), "did you mean 'disk'?"),
    "threads misspelt": (lambda: silo.Logger("a", threads="serialised"), "did you mean 'serialized'?"),
    "whole tiers in a float": (lambda: silo.Logger("a", size_tiers=2.0), "write size_tiers=2"),
    "init misspelt": (lambda: silo.init("a", freq=500), "did you mean 'frequency'?"),
    "add misspelt": (lambda: silo.add(Z, "z", dividr=2), "did you mean 'divider'?"),
    "add to nothing misspelt": (lambda: NullLogger("a").add(Z, "z", dividr=2), "did you mean 'divider'?"),
    "nothing made misspelt": (lambda: NullLogger("a", freq=2), "did you mean 'frequency'?"),
    "open nothing": (silo.open_log, "silo.open_log() needs which"),
    "too much for a client": (
        lambda: object.__new__(Client).acknowledge([], "me", 3),
        "client.acknowledge() takes 2 arguments by place (names, who), got 3; nothing was done",
    ),
    "too little for a client": (
        lambda: object.__new__(Client).arm_trigger(),
        "client.arm_trigger() needs name: write client.arm_trigger(name, armed=...)",
    ),
    "register nothing": (silo.register, "silo.register() needs cls"),
    "one frame": (lambda: silo.types.vector_at_position("a"), "needs position_frame"),
    "a method of a logger": (lambda: silo.set("x", divider=2), "has no attribute 'set'; write silo.get_logger().set"),
    "another word for open_log": (lambda: silo.load("x"), "did you mean 'silo.open_log'?"),
    "a float overflows": (lambda: silo.Logger("a", frequency=10**400), "frequency must be above 0"),
    "a list for storage": (lambda: silo.Logger("a", storage=["memory"]), "storage must be"),
    "a dict for threads": (lambda: silo.Logger("a", threads={}), "threads must be"),
    "a prefix of two lines": (lambda: silo.Logger("a", prefix="a\nb"), "prefix must be of printable"),
    "a hostile folder": (lambda: silo.Logger("a", folder=Hostile()), "folder must be a path, got a Hostile"),
    "a folder that can't be told": (lambda: silo.Logger("a", folder=b"\xff"), "whole characters"),
    "a clock beyond 64 bits": (lambda: silo.Logger("a", clock=lambda: 10**30), "64 bits of nanoseconds"),
    "a clock beyond all time": (lambda: silo.Logger("a", clock=lambda: 1e300), "64 bits of nanoseconds"),
    "a clock of infinity": (lambda: silo.Logger("a", clock=lambda: math.inf), "clock must return int"),
    "register a number": (lambda: silo.register(5), "takes a class first, got 5"),
    "register an object": (lambda: silo.register(Thing(), "x"), "write silo.register(Thing"),
    "register text": (lambda: silo.register("Thing", "x"), "takes a class first"),
    "register a number as field": (lambda: silo.register(Thing, 5), "an attribute must be a text"),
    "register a list of fields": (lambda: silo.register(Thing, ["x"]), "an attribute must be a text"),
    "register twice": (lambda: silo.register(Thing, "x", "x"), "'x' is there twice"),
    "register no function": (lambda: silo.register(Thing, "x", area=5), "area must be a function"),
    "register no kinds": (lambda: silo.register(Thing, "x", kinds="pose"), "kinds must be a dict"),
    "register an unknown kind": (lambda: silo.register(Thing, "x", kinds={"x": "no"}), "unknown kind 'no'"),
    "register a kind of nothing": (lambda: silo.register(Thing, "x", kinds={"y": "pose"}), "none of x"),
    "frames of numbers": (lambda: silo.types.vector_at_position(5, 5), "frame's name must be a text"),
    "frames with commas": (lambda: silo.types.vector_at_position("a,b", "c"), "hold commas"),
    "open None": (lambda: silo.open_log(None), "which log must be a path"),
    "open a float": (lambda: silo.open_log(1.5), "which log must be"),
    "open an empty list": (lambda: silo.open_log([]), "which log must be"),
    "open a list of no paths": (lambda: silo.open_log([None]), "which log must be a path"),
    "open True": (lambda: silo.open_log(True), "a run number must be"),
    "open a negative run": (lambda: silo.open_log(-1), "a run number must be"),
    "open a long name": (lambda: silo.open_log("x" * 5000), "at most 4095 bytes"),
    "open in a number": (lambda: silo.open_log("a", 5), "folder must be a path"),
    "a log of a number": (lambda: silo.Log(5), "silo.open_log"),
    "a log of a path": (lambda: silo.Log("x.silo"), "silo.open_log"),
    "an array of a logger that does nothing": (lambda: NullLogger().array("a", -1), "from 0 to 1000000"),
    "a script of a logger that does nothing": (lambda: NullLogger().save_script(5), "path must be a path"),
}
SIGNALS = {
    "a number": (lambda log, x, z: log[5], "named by a text, got 5 (int)"),
    "a list": (lambda log, x, z: log[["x"]], "named by a text"),
    "a slice": (lambda log, x, z: log["x":"z"], "named by a text"),
    "a pattern of a number": (lambda log, x, z: log.names(5), "pattern must be a text"),
    "a table of a list": (lambda log, x, z: log.to_pandas(["x"]), "pattern must be a text"),
    "a namespace of None": (lambda log, x, z: log.namespace(None), "name must be a text"),
    "value at text": (lambda log, x, z: x.value("a"), "must be numbers, in seconds"),
    "value at None": (lambda log, x, z: x.value(None), "must be numbers"),
    "value at a complex": (lambda log, x, z: x.value(1j), "must be numbers"),
    "clip at text": (lambda log, x, z: x.clip("a"), "must be numbers"),
    "clip at two": (lambda log, x, z: x.clip([1, 2]), "start_s must be one time"),
    "clip at NaN": (lambda log, x, z: x.clip(math.nan), "start_s must be one time"),
    "average to text": (lambda log, x, z: x.mean(0, "b"), "must be numbers"),
    "resample at text": (lambda log, x, z: x.resample("a"), "must be numbers"),
    "resample at None": (lambda log, x, z: x.resample(None), "must be numbers"),
    "resample at infinity": (lambda log, x, z: x.resample(math.inf), "and finite"),
    "resample too often": (lambda log, x, z: x.resample(1e30), "at most 100,000,000"),
    "resample on a matrix": (lambda log, x, z: x.resample(np.zeros((2, 2))), "must have one dimension"),
    "a unit of a number": (lambda log, x, z: x.to(5), "unit must be a text"),
    "another unit of None": (lambda log, x, z: x.with_unit(None), "unit must be a text"),
    "plus text": (lambda log, x, z: x + "a", "take a signal, a number"),
    "text plus": (lambda log, x, z: "a" + x, "take a signal, a number"),
    "plus None": (lambda log, x, z: x + None, "take a signal, a number"),
    "plus a huge number": (lambda log, x, z: x + 10**400, "at most 64 bits"),
    "plus a time": (lambda log, x, z: x + datetime.timedelta(1), "take a signal, a number"),
    "minus a log": (lambda log, x, z: x - log, "a log is no array: log.to_pandas()"),
    "times another length": (lambda log, x, z: z * np.zeros(5), "array of shape (5,): the values have shape"),
    "power of text": (lambda log, x, z: x ** "a", "take a signal, a number"),
    "rotate by a number": (lambda log, x, z: z.rotate(5), "a quaternion must be a signal"),
    "an order of a number": (lambda log, x, z: z.quaternion(5), "order of Euler angles must be a text"),
    "a signal as an attribute": (lambda log, x, z: log.z, "a log has no 'z': the signal is log['z']"),
    "a pattern for a name": (lambda log, x, z: log["*"], "log.glob('*') are all signals that match"),
    "counted from text": (lambda log, x, z: x.counted_from("a"), "start (in nanoseconds"),
}


@pytest.fixture
def log(new_logger, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return new_logger()


@pytest.fixture
def logged(log):
    """A logger that holds something, and stands still."""
    log.add(Z, "z")
    log.add(Thing(), "x", attr="x")
    log.update()
    log.start()
    log.collect()
    log.stop()
    return log


@pytest.fixture(scope="module")
def signals(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    logger = silo.Logger("mistakes", folder=folder, script=folder / "no.yaml")
    logger.add(Z, "z")
    logger.add(Thing(), "x", attr="x")
    logger.update()
    logger.start()
    for _ in range(7):
        logger.collect()
    (saved,) = logger.save()
    logger.close()
    found = silo.open_log(saved.path)
    return found, found["x"], found["z"]


@pytest.mark.parametrize("option", [{"frequency": "2ms"}, {"frequency": "500rpm"}, {"max_time": "10 m"}])
def test_a_number_of_another_unit_is_no_advice(option):
    with pytest.raises(silo.ElementError, match=f"got '{next(iter(option.values()))}'$"):
        silo.Logger("a", **option)


def told(call, words):
    with pytest.raises(silo.SiloError) as caught:
        call()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("mistake", ADD)
def test_what_add_is_given_is_told_of_and_the_table_stays(mistake, log):
    call, words = ADD[mistake]
    told(lambda: call(log), words)
    log.update()
    assert log.elements == []


@pytest.mark.parametrize("mistake", CALLS)
def test_a_wrong_call_is_told_of_and_the_table_stays(mistake, log):
    call, words = CALLS[mistake]
    told(lambda: call(log), words)
    log.update()
    assert log.elements == []


def test_a_wrong_call_is_a_type_error_too(log):
    with pytest.raises(TypeError):
        log.add(Z, "z", dividr=2)


def test_a_type_error_of_the_programs_own_is_not_taken_for_a_wrong_call(log):
    class Own:
        @property
        def x(self):
            return len(5)

    with pytest.raises(silo.errors.SourceError, match="has no len"):
        log.add(Own(), attr="x")


GIVEN = {
    "a number of NumPy": ({"divider": np.int64(2)}, "divider", 2),
    "an array of one": ({"divider": np.array(2)}, "divider", 2),
    "a rate": ({"divider": "50Hz"}, "divider", 2),
    "a word": ({"action": "publish"}, "action", silo.Action.PUBLISH),
    "a word in capitals": ({"action": "SAVE_AND_PUBLISH"}, "action", silo.Action.SAVE_AND_PUBLISH),
    "a word with blanks": ({"action": "save and publish"}, "action", silo.Action.SAVE_AND_PUBLISH),
    "an action's number": ({"action": np.int32(2)}, "action", silo.Action.PUBLISH),
    "a buffer": ({"buffer": "growing"}, "buffer", silo.BufferType.GROWING),
    "the original's buffer": ({"buffer": "EXPONENTIALLY_GROWING"}, "buffer", silo.BufferType.GROWING),
    "a time": ({"size": "10 s"}, "size", 1000),
    "a bool of NumPy": ({"enabled": np.False_}, "enabled", False),
    "a word for off": ({"enabled": "no"}, "enabled", False),
}


@pytest.mark.parametrize("what", GIVEN)
def test_options_are_taken_as_words_numbers_and_members(what, log):
    given, option, value = GIVEN[what]
    log.add(Z, "z", **given)
    log.update()
    assert getattr(log.elements[0].options, option) == value


def test_arguments_of_the_original_are_taken_in_its_order(log):
    log.add(Z, "z", "joints", "rad", 2, "publish", 100, "growing")
    log.update()
    (info,) = log.elements
    assert (info.name, info.unit) == ("/log/joints/z", "rad")
    assert info.options == silo.ElementOptions(True, 2, silo.Action.PUBLISH, silo.BufferType.GROWING, 100)


def test_words_of_the_logger_are_taken_in_any_case(new_logger):
    made = new_logger(storage="MEMORY", threads="Serialized", checked=np.True_)
    assert (made.options.storage, made.options.threads) == (silo.types.Storage.MEMORY, silo.types.Threads.SERIALIZED)
    assert made.options.checked is True


def test_members_are_found_by_their_names():
    assert silo.Action("publish") is silo.Action.PUBLISH
    assert silo.BufferType("Growing") is silo.BufferType.GROWING
    assert silo.types.FileType("csv") is silo.types.FileType.CSV


@pytest.mark.parametrize("mistake", ARRAY)
def test_what_array_is_given_is_told_of_and_the_table_stays(mistake, log):
    call, words = ARRAY[mistake]
    told(lambda: call(log), words)
    log.update()
    assert log.elements == []


@pytest.mark.parametrize("mistake", TABLE)
def test_what_changes_the_table_is_told_of_and_the_table_stays(mistake, logged):
    call, words = TABLE[mistake]
    before = logged.elements
    told(lambda: call(logged), words)
    assert logged.elements == before


@pytest.mark.parametrize("mistake", DATA)
def test_what_save_read_and_serve_are_given_is_told_of(mistake, logged):
    call, words = DATA[mistake]
    told(lambda: call(logged), words)
    assert logged.has_unsaved


@pytest.mark.parametrize("mistake", MADE)
def test_what_functions_of_silo_are_given_is_told_of(mistake):
    call, words = MADE[mistake]
    told(call, words)


@pytest.mark.parametrize("mistake", SIGNALS)
def test_what_a_log_and_its_signals_are_asked_is_told_of(mistake, signals):
    call, words = SIGNALS[mistake]
    told(lambda: call(*signals), words)


@pytest.mark.parametrize("call", ["update", "set", "save_script", "start", "snapshot", "save"])
def test_a_closed_logger_says_so(call, logged):
    logged.close()
    told(getattr(logged, call), "is closed; make a new one")


def test_a_wrong_name_asked_by_get_is_not_there_as_in_any_mapping(signals):
    assert signals[0].get(5) is None


def test_the_last_value_holds_on_to_the_end_of_time(signals):
    _, x, _ = signals
    assert x.value(1e300) == x.value(1e9) == 1.0


def test_text_that_no_file_can_hold_is_logged_with_a_question_mark(log):
    log.add(Thing(), attr="half")
    log.update()
    log.start()
    log.collect()
    (element,) = log.snapshot().elements
    assert element.entries[0].values.tolist() == [b"?"]


# ---------------------------------------------------------------------------------------------- clocks that fail later


@pytest.mark.parametrize(
    ("first", "later", "words"),
    [
        (5, None, "got None"),
        (5, "noon", "got 'noon'"),
        (5, 10**30, "within 64 bits"),
        (0.5, None, "got None"),
        (0.5, "noon", "got 'noon'"),
        (0.5, math.nan, "got nan"),
        (0.5, 1e300, "a time within 64 bits"),
    ],
)
def test_a_clock_that_returns_nonsense_costs_the_tick_and_says_so_each_time(new_logger, first, later, words):
    answers = [first, first, later, later, first]
    log = new_logger(clock=lambda: answers.pop(0))
    log.add(Z, "z")
    log.update()
    log.start()
    log.collect()
    for _ in range(2):
        with pytest.raises(silo.StateError, match=r"this tick is not logged") as caught:
            log.collect()
        assert words in str(caught.value)
    log.collect()
    assert log.ticks == 2


def test_a_clock_that_fails_costs_the_tick_and_says_why(new_logger):
    answers = [5, 5, OSError("no device"), 7]

    def clock():
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    log = new_logger(clock=clock)
    log.add(Z, "z")
    log.update()
    log.start()
    log.collect()
    with pytest.raises(silo.StateError, match=r"clock failed \(OSError: no device\); this tick is not logged"):
        log.collect()
    log.collect()
    assert log.snapshot().time_ns.tolist() == [5, 7]


class Own(BaseException):
    """A program's own way out."""


@pytest.mark.parametrize("way_out", [KeyboardInterrupt, SystemExit, GeneratorExit, Own])
def test_a_way_out_of_the_program_passes_through_a_source_and_the_tick_is_not_logged(log, way_out):
    answers = [1.0]

    def source():
        if isinstance(answers[-1], BaseException):
            raise answers[-1]
        return answers[-1]

    log.add(source, "s")
    log.update()
    log.start()
    log.collect()
    answers.append(way_out())
    with pytest.raises(way_out):
        log.collect()
    answers.append(2.0)
    log.collect()
    (element,) = log.snapshot().elements
    assert element.entries[0].values.tolist() == [1.0, 2.0]


def test_a_mark_needs_no_words_and_takes_several(logged):
    logged.start()
    logged.collect()
    logged.mark()
    logged.mark("push", 3)
    marks = [event.text for event in logged.snapshot().events if event.kind == "marker"]
    assert marks == ["mark", "push 3"]
    NullLogger().mark()


def test_the_path_of_one_file_and_the_row_of_one_name_are_asked_for_as_one_would_say(logged):
    saved = logged.save("csv")
    assert saved.path == saved[0].path
    assert saved.size_bytes == saved[0].size_bytes
    assert logged.elements["z"] is logged.elements["/log/z"]
    assert logged.elements["z"].name == "/log/z"
    assert [info.name for info in logged.elements[:1]] == ["/log/z"]


def test_an_element_that_is_deleted_like_a_key_stays_and_the_way_out_is_said(logged):
    def delete():
        del logged["z"]

    told(delete, "log['z'] is only looked at: log.remove('z') forgets it; nothing was changed")
    assert logged["z"].name == "/log/z"


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_logger_is_not_copied_and_goes_on(logged, how):
    logged.start()
    with pytest.raises(TypeError, match=f"logger '{logged.options.name}' can't be copied.*pass it on"):
        how(logged)
    logged.collect()
    assert logged.ticks == 1
