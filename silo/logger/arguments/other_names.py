"""What people ask a logger for by other names, and what to write instead.

Misspelt names are Python's own matter: it says which one was meant.
"""

import inspect
from collections.abc import Iterable
from typing import NoReturn

from silo.core.elements import LoggerOptions
from silo.errors import ArgumentError, StateError, UnknownNameError

_SETTING = "it is log.options.{}; it is given when the logger is made: silo.Logger('robot', {})"

FREQUENCIES = ("freq", "frequency", "frequency_hz", "set_frequency", "rate", "hz")
_INSTEAD = {
    "elements are published while the logger is served: log.add(x, 'x', action='publish') and log.serve()": "publish",
    _SETTING.format("frequency_hz", "frequency=500"): " ".join(FREQUENCIES),
    "it is 1 / log.options.frequency_hz": "dt",
    _SETTING.format("max_time_s", "max_time=60"): "max_time",
    _SETTING.format("prefix", "prefix='/log'"): "prefix",
    _SETTING.format("folder", "folder='logs'"): "folder",
    _SETTING.format("script", "script='robot.yaml'"): "script",
    _SETTING.format("storage", "storage='disk'"): "storage",
    "it is log.options": "opts",
    "it is log.options for the logger, log['x'].options for an element": "config",
    "log['x'].newest is the newest value, log.read_new_values('x') are those since the last call, "
    "silo.Log(log.snapshot())['x'] are all": "data",
    "log['x'].newest is the newest value, silo.Log(log.snapshot())['x'].values are all": "values",
    "it is log['x']; its .newest is the newest value": "get",
    "it is log.read_new_values('x')": "read readNewValues",
    "it is log['x'].newest": "latest",
    "it is list(log)": "names keys",
    "it is [(name, log[name]) for name in log]": "items",
    "log['x'].time_ns is that of its newest value; silo.Log(log.snapshot()).times are those of all ticks": "time",
    "they are silo.Log(log.snapshot()).times": "times",
    "it is silo.Log(log.snapshot()).to_pandas()": "df to_pandas",
    "it is log.elements": "signals variables",
    "add variables by log.add(x, 'x') before, then log.collect() once per tick; or log.value('cost', 1.0)": (
        "log log_dict log_scalar log_metric logkv add_scalar add_scalars add_histogram add_text"
    ),
    "facts of a run are given when the logger is made: silo.Logger('robot', about={'task': 'walk'})": (
        "summary log_param log_params metadata"
    ),
    "silo.init('robot') makes the default logger of a program; this one is made: log.add(x, 'x'), log.start()": "init",
    "silo logs numbers; words at the newest tick are log.mark('slipped')": "debug info warning error message",
    "it is log.mark('slipped')": "event annotate marker",
    "it is log.collect()": "tick step sample collect_data collectLoggerData",
    "it is log.start(), then log.collect() once per tick of your loop": "run",
    "it is log.start()": "begin startLogger",
    "it is log.start(); saved files are opened by silo.open_log('logs')": "open",
    "it is log.stop()": "end stopLogger",
    "it is log.restart()": "restartLogger",
    "it is log.update()": "updateLogger",
    "it is silo.Logger('robot', frequency=500)": "initLogger",
    "nothing is to be called: the helper process of log.serve() publishes": "publishData",
    "it is with log.episode('pick') as episode:": "begin_episode",
    "silo keeps no time: the loop is yours, time.sleep(...) in it": "wait sleep every join",
    "it is log.stop(); log.start() begins a new run": "pause",
    "it is log.start(), which begins a new run": "resume",
    "it is log.close()": "shutdown cleanup",
    "it is log.stop(), log.save() and log.close()": "finish",
    "it is log.is_running": "running started is_started isRunning state",
    "print(log) says how it stands; `silo info robot` in a shell, with log.serve()": "status show print",
    "a closed logger raises StateError; log.is_running says whether it logs": "closed",
    "log.start() begins with empty buffers, log.remove('x') forgets an element": "clear",
    "it is log.restart(): a new run with empty buffers": "reset",
    "it is log.save('csv'), name='...' beside it": "write dump export save_csv save_as to_csv saveLoggerData",
    "it is log.save(): what was collected is kept without it too, also when the program is killed": "flush",
    "it is log.save('bag')": "save_bag",
    "it is silo.Log(log.snapshot())['x'].values": "to_numpy",
    "it is silo.Log(log.snapshot()).plot('x')": "plot",
    "it is silo.Log(log.snapshot()).eval('x > 1')": "eval",
    "settings: log.load_script('robot.yaml'); a saved log: silo.open_log('logs')": "load",
    "it is log.load_script('robot.yaml')": "load_config",
    "it is log.save_script('robot.yaml')": "save_config",
    "it is log.load_script('robot.yaml'), or log.update() which reads the logger's own": "update_script",
    "it is log.add(x, 'x')": "register append add_signal add_variable",
    "it is log.array('x', 12)": "add_array zeros",
    "it is log.remove('x')": "delete",
    "it is log.serve(), then silo.connect('robot').stream(['x'])": "stream",
    "it is silo.connect('robot') in another program, once this one has called log.serve()": "connect",
    "it is log.set('x', divider=2)": "set_divider apply",
    "it is log.value('cost', 1.0)": "scalar set_value put",
    "it is log.parameter('kp', 50.0)": "param",
    "len(log) counts elements, log['x'].held samples, log.ticks ticks": "count",
    "it is log['x'].options.size": "size",
    "it is log.serve(), then silo-tui in a terminal": "view watch",
    "it is log['x']": "element",
    "it is log.set('x', enabled=True)": "enable",
    "it is log.set('x', enabled=False)": "disable",
    "it is log.limit('x', (red_low, yellow_low, yellow_high, red_high))": "alarm limits add_limit set_limit set_limits",
    "it is log.trigger('fall', 'x > 1')": "triggers add_trigger set_trigger",
    "it is log.derive('x', None)": "remove_derived",
    "it is log.limit('x', None)": "remove_limits",
    "it is log.trigger('fall', None)": "remove_trigger",
    "it is log['x'].failures": "source_failures",
    "it is sum(log[name].lost for name in log)": "lost",
    "it is silo's own": "is_closed lock extras ignored revision segment_path saved_before_start problems abandon",
}
OTHER_NAMES = {name: way_out for way_out, names in _INSTEAD.items() for name in names.split()}
SETTLED = (*FREQUENCIES, "max_time")


class Elsewhere:
    """A name that a logger lacks: asking for it raises UnknownNameError with what to write instead.

    An element of that name goes first; without a `way_out` there is nothing else to be told. A hook for missing names
    would do the same, and have Python look `log.collect` up 8 ns slower in each tick.
    """

    def __init__(self, name: str, way_out: str = "") -> None:
        self._name, self._way_out = name, way_out

    def __get__(self, thing: object, owner: type) -> NoReturn:
        named = getattr(thing, "_named", None)
        element = named(self._name) if named is not None else None
        if element is None and not self._way_out:
            raise AttributeError(
                f"'{owner.__name__}' object has no attribute '{self._name}'", name=self._name, obj=thing
            )
        way_out = f"its element is log[{element.info.name!r}], with .newest and .options" if element else self._way_out
        raise UnknownNameError(f"a logger has no '{self._name}': {way_out}", name=self._name)


class Settled(Elsewhere):
    """One that is settled when a logger is made: setting it later would do nothing, and raises StateError."""

    def __set__(self, thing: object, value: object) -> NoReturn:
        raise StateError(f"{self._name} can't be set later: {self._way_out}; nothing was changed")


def tell_of_element(cls: type, name: str) -> None:
    """Have `log.q` tell of `log["q"]`, where the class has no such name."""
    if name.isidentifier() and not name.startswith("_") and not any(name in vars(base) for base in cls.__mro__):
        setattr(cls, name, Elsewhere(name))


class HidesOtherNames(type):
    """The class of loggers: `dir()`, completion and `help()` list what there is, not what is told of."""

    def __dir__(cls) -> list[str]:
        return listed(super().__dir__(), cls)


def listed(names: Iterable[str], cls: type) -> list[str]:
    """The names of an object without those that are only told of: what its `__dir__` returns."""
    return [name for name in names if not isinstance(inspect.getattr_static(cls, name, None), Elsewhere)]


def no_attribute_of(element: str, name: str) -> NoReturn:
    """Raise UnknownNameError: `log.q = value`."""
    raise UnknownNameError(
        f"log.{name} = ... would change nothing of the element log[{element!r}]: write into the array that was added, "
        "x[:] = ..., or add the object that has it, log.add(robot, attr='x'); nothing was changed",
        name=name,
    )


class LoggerNames(metaclass=HidesOtherNames):
    """What a logger and one that does nothing have in common: its name, and what is told of what they lack."""

    options: LoggerOptions

    @property
    def name(self) -> str:
        """The logger's name."""
        return self.options.name

    def __bool__(self) -> bool:
        return True  # also without elements

    def __setitem__(self, name: str, value: object) -> NoReturn:
        raise ArgumentError(
            f"log[{name!r}] is only looked at: write into the array that was added, x[:] = ..., or change how it is "
            f"logged by log.set({name!r}, divider=2); nothing was changed"
        )

    def __delitem__(self, name: str) -> NoReturn:
        raise ArgumentError(f"log[{name!r}] is only looked at: log.remove({name!r}) forgets it; nothing was changed")

    def __dir__(self) -> list[str]:
        return listed(super().__dir__(), type(self))


for _name, _way_out in OTHER_NAMES.items():
    setattr(LoggerNames, _name, (Settled if _name in SETTLED else Elsewhere)(_name, _way_out))
