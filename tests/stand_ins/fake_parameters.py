"""Parameters of a made-up logger: what is set holds at once."""

import threading
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from silo.core.tuning.parameters import ParameterInfo, ParameterKind, ParameterValue, Wave, Writable
from silo.parameters.requests import ExcitationState, ParametersSet, ParameterTable
from tests.waiting import DEADLINE_S

FLOAT = ParameterKind.FLOAT
PARAMETERS = [
    ParameterInfo("/log/gait/height", FLOAT, 0.48, (), 0.4, 0.54, 0.005, "m", value=0.48, description="above ground"),
    ParameterInfo("/log/gait/name", ParameterKind.ENUM, "trot", choices=("walk", "trot", "pace"), value="trot"),
    ParameterInfo("/log/gains/kp", FLOAT, 40.0, (), 0.0, 200.0, unit="Nm/rad", value=40.0, locked=True),
    ParameterInfo("/log/gains/fixed", FLOAT, 1.0, value=1.0, writable=Writable.NO),
]


class FakeParameters:
    """`parameters_locked` is what the program says; `put` sets as somebody else does; `answers` holds answers up."""

    calls: list[tuple[Any, ...]]

    def __init__(self) -> None:
        self.parameter_infos = list(PARAMETERS)
        self.parameters_locked = False
        self.parameters = self
        self.answers = threading.Event()
        self.answers.set()

    def put(self, values: Mapping[str, ParameterValue]) -> None:
        self.parameter_infos = [replace(one, value=values.get(one.name, one.value)) for one in self.parameter_infos]

    def set(self, values: Mapping[str, ParameterValue]) -> ParametersSet:
        self.calls.append(("set_parameters", dict(values)))
        assert self.answers.wait(DEADLINE_S)
        self.put(values)
        return ParametersSet("a", 17)

    def excite(self, name: str, wave: Wave, *, wait: Any, **more: Any) -> ExcitationState:
        self.calls.append(("excite", name, wave.value, more["amplitude"], more["duration"], more["high_hz"]))
        while not wait(ExcitationState("a", 3.0, 5), 0.01):
            pass
        return ExcitationState("a", 3.0, 5, "stopped by a key", 9)

    def _list_parameters(self) -> ParameterTable:
        return ParameterTable(list(self.parameter_infos), self.parameters_locked)
