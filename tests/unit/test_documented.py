"""Every public name tells its arguments, what it returns and the errors that it raises: the reference is made of it."""

import dataclasses
import enum
import inspect
import re
import textwrap
from pathlib import Path

import msgspec
import pytest

import silo
from silo import errors
from silo.fleet.exchange import encoded
from silo.live.topic import Batch, Topic
from silo.requests import GetStatus
from silo.rpc.versions import PROTOCOL

ERRORS = {name for name, found in vars(errors).items() if inspect.isclass(found)} | {"ExpressionError"}
# what it takes and returns is what Logger says; its own docstrings say what it does instead
LIKE_LOGGER = vars(silo.NullLogger).keys() & set(dir(silo.Logger))
PUBLIC = {name: getattr(home, name) for home in (silo, silo.types) for name in home.__all__}
PUBLIC |= {"Topic": Topic, "Batch": Batch}
CLASSES = {name: found for name, found in PUBLIC.items() if inspect.isclass(found)}


def callables():
    """Each public function and method of ours once, by its name."""
    found = {}
    for name, thing in PUBLIC.items():
        if inspect.isfunction(thing):
            found[name] = thing
        elif inspect.isclass(thing):
            for key in dir(thing):
                home = next((base for base in thing.__mro__ if key in vars(base)), None)
                if home is None:  # of the class of the class
                    continue
                method = getattr(vars(home)[key], "__func__", vars(home)[key])
                ours = home.__module__.startswith("silo") and inspect.isfunction(method)
                if ours and not key.startswith("_") and not (thing is silo.NullLogger and key in LIKE_LOGGER):
                    found[f"{name}.{key}"] = method
    return found


CALLABLES = callables()


def sections(text: str) -> dict[str, str]:
    """`Args`, `Returns`, `Raises` of a docstring, and what stands before them under an empty name."""
    parts = re.split(r"^(Args|Returns|Raises|Attributes):\n", text, flags=re.MULTILINE)
    return {"": parts[0]} | dict(zip(parts[1::2], map(textwrap.dedent, parts[2::2]), strict=True))


def named(section: str) -> list[str]:
    return re.findall(r"^\*{0,2}(\w+): \S", section, re.MULTILINE)


def parameters(function) -> list[str]:
    """Their names, without the object or class that the caller doesn't write."""
    names = list(inspect.signature(function).parameters)
    bound = function.__qualname__.count(".") and not isinstance(function, staticmethod)
    return names[1:] if bound and names[:1] in (["self"], ["cls"]) else names


def told(name: str) -> dict[str, str]:
    return sections(inspect.getdoc(CALLABLES[name]) or "")


@pytest.mark.parametrize("name", CALLABLES)
def test_all_arguments_are_documented_and_no_others(name):
    if name == "init":  # its docstring sends to the class
        assert "silo.Logger" in told(name)[""]
        return
    assert named(told(name).get("Args", "")) == parameters(CALLABLES[name])


@pytest.mark.parametrize("name", CALLABLES)
def test_what_is_returned_is_documented(name):
    annotation = inspect.signature(CALLABLES[name]).return_annotation
    if annotation in (None, "None", inspect.Signature.empty):
        return
    words = told(name)
    assert "Returns" in words or re.search(r"^Return|`[^`]+`\.?\n*Return|Yield", words[""], re.MULTILINE)


@pytest.mark.parametrize("name", CALLABLES)
def test_the_errors_that_it_raises_are_documented(name):
    try:
        code = inspect.getsource(inspect.unwrap(CALLABLES[name]))
    except OSError:  # made at run time from one that is tested by its own name
        return
    raised = set(re.findall(r"\braise (\w+)\(", code)) & ERRORS
    words = told(name)
    assert raised - set(named(words.get("Raises", ""))) - set(re.findall(r"\w+Error", words[""])) == set()


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_says_what_it_is_made_of(name):
    cls = CLASSES[name]
    assert cls.__doc__
    if issubclass(cls, enum.Enum | Exception):
        return
    if dataclasses.is_dataclass(cls):
        fields = [field.name for field in dataclasses.fields(cls)]
    elif issubclass(cls, msgspec.Struct):
        fields = [field.name for field in msgspec.structs.fields(cls)]
    else:
        fields = getattr(cls, "_fields", None) or parameters(cls.__init__)
    words = " ".join(inspect.getdoc(base) or "" for base in cls.__mro__ if base.__module__.startswith("silo"))
    words += inspect.getdoc(cls.__init__) or ""
    if cls is silo.NullLogger:
        return  # takes the arguments of Logger
    assert [field for field in fields if not field.startswith("_") and not re.search(rf"\b{field}\b", words)] == []


def test_the_reference_of_a_logger_has_each_member_first_what_every_program_calls():
    page = (Path(__file__).resolve().parents[2] / ".docs" / "reference" / "logger.md").read_text()
    names = re.findall(r"^::: silo\.Logger\.(\w+)$", page, re.MULTILINE)
    assert " ".join(names[:11]) == "add array value update serve start collect mark stop save close"
    assert sorted(names) == sorted(name for name in dir(silo.Logger) if not name.startswith("_"))


def test_the_protocol_is_described_by_its_present_number_and_tag():
    page = (Path(__file__).resolve().parents[2] / ".docs" / "protocol.md").read_text()
    assert f"Protocol {PROTOCOL}.\n" in page
    assert "a map with its name under\n`type`" in page
    assert msgspec.msgpack.decode(encoded(GetStatus(client="somebody"))).items() >= {
        "type": "GetStatus", "client": "somebody", "protocol": PROTOCOL,
    }.items()  # fmt: skip
