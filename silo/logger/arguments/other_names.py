"""What people ask a logger for by other names, and what to write instead.

Misspelt names are Python's own matter: it says which one was meant.
"""

from collections.abc import Iterable
from typing import NoReturn

from silo.core.elements import LoggerOptions
from silo.errors import ArgumentError, StateError, UnknownNameError

_SAVED = "log.save('csv') writes files; silo.Log(log.snapshot()) has the data as signals"
_SETTING = "it is log.options.{}; it is given when the logger is made: silo.Logger('robot', {})"

FREQUENCIES = ("freq", "frequency", "frequency_hz", "set_frequency", "rate", "hz")
OTHER_NAMES = {
    "publish": "elements are published while the logger is served: log.add(x, 'x', action='publish') and log.serve()",
    **dict.fromkeys(FREQUENCIES, _SETTING.format("frequency_hz", "frequency=500")),
    "dt": "it is 1 / log.options.frequency_hz",
    "max_time": _SETTING.format("max_time_s", "max_time=60"),
    "prefix": _SETTING.format("prefix", "prefix='/log'"),
    "folder": _SETTING.format("folder", "folder='logs'"),
    "script": _SETTING.format("script", "script='robot.yaml'"),
    "storage": _SETTING.format("storage", "storage='disk'"),
    "opts": "it is log.options",
    "config": "it is log.options for the logger, log['x'].options for an element",
    "data": "log['x'].newest is the newest value, log.read_new_values('x') are those since the last call, "
    "silo.Log(log.snapshot())['x'] are all",
    "values": "log['x'].newest is the newest value, silo.Log(log.snapshot())['x'].values are all",
    "get": "it is log['x']; its .newest is the newest value",
    "read": "it is log.read_new_values('x')",
    "latest": "it is log['x'].newest",
    "names": "it is list(log)",
    "keys": "it is list(log)",
    "items": "it is [(name, log[name]) for name in log]",
    "time": "log['x'].time_ns is that of its newest value; silo.Log(log.snapshot()).times are those of all ticks",
    "times": "they are silo.Log(log.snapshot()).times",
    "df": "it is silo.Log(log.snapshot()).to_pandas()",
    "signals": "it is log.elements",
    "variables": "it is log.elements",
    **dict.fromkeys(
        (
            "log",
            "log_dict",
            "log_scalar",
            "log_metric",
            "logkv",
            "add_scalar",
            "add_scalars",
            "add_histogram",
            "add_text",
        ),
        "add variables by log.add(x, 'x') before, then log.collect() once per tick; or log.value('cost', 1.0)",
    ),
    **dict.fromkeys(
        ("summary", "log_param", "log_params", "metadata"),
        "facts of a run are given when the logger is made: silo.Logger('robot', about={'task': 'walk'})",
    ),
    "init": "silo.init('robot') makes the default logger of a program; this one is made: log.add(x, 'x'), log.start()",
    **dict.fromkeys(
        ("debug", "info", "warning", "error", "message"),
        "silo logs numbers; words at the newest tick are log.mark('slipped')",
    ),
    **dict.fromkeys(("event", "annotate", "marker"), "it is log.mark('slipped')"),
    **dict.fromkeys(("tick", "step", "sample", "collect_data", "collectLoggerData"), "it is log.collect()"),
    "run": "it is log.start(), then log.collect() once per tick of your loop",
    **dict.fromkeys(("begin", "startLogger"), "it is log.start()"),
    "open": "it is log.start(); saved files are opened by silo.open_log('logs')",
    **dict.fromkeys(("end", "stopLogger"), "it is log.stop()"),
    "restartLogger": "it is log.restart()",
    "updateLogger": "it is log.update()",
    "initLogger": "it is silo.Logger('robot', frequency=500)",
    "readNewValues": "it is log.read_new_values('x')",
    "publishData": "nothing is to be called: the helper process of log.serve() publishes",
    "begin_episode": "it is with log.episode('pick') as episode:",
    **dict.fromkeys(("wait", "sleep", "every", "join"), "silo keeps no time: the loop is yours, time.sleep(...) in it"),
    "pause": "it is log.stop(); log.start() begins a new run",
    "resume": "it is log.start(), which begins a new run",
    "shutdown": "it is log.close()",
    "finish": "it is log.stop(), log.save() and log.close()",
    **dict.fromkeys(("running", "started", "is_started", "isRunning", "state"), "it is log.is_running"),
    **dict.fromkeys(
        ("status", "show", "print"), "print(log) says how it stands; `silo info robot` in a shell, with log.serve()"
    ),
    "closed": "a closed logger raises StateError; log.is_running says whether it logs",
    "clear": "log.start() begins with empty buffers, log.remove('x') forgets an element",
    "reset": "it is log.restart(): a new run with empty buffers",
    **dict.fromkeys(
        ("write", "dump", "export", "save_csv", "save_as", "to_csv", "saveLoggerData"),
        "it is log.save('csv'), name='...' beside it",
    ),
    "flush": "it is log.save(): what was collected is kept without it too, also when the program is killed",
    "save_bag": "it is log.save('bag')",
    "to_pandas": "it is silo.Log(log.snapshot()).to_pandas()",
    "to_numpy": "it is silo.Log(log.snapshot())['x'].values",
    "plot": "it is silo.Log(log.snapshot()).plot('x')",
    "eval": "it is silo.Log(log.snapshot()).eval('x > 1')",
    "load": "settings: log.load_script('robot.yaml'); a saved log: silo.open_log('logs')",
    "load_config": "it is log.load_script('robot.yaml')",
    "save_config": "it is log.save_script('robot.yaml')",
    "update_script": "it is log.load_script('robot.yaml'), or log.update() which reads the logger's own",
    "register": "it is log.add(x, 'x')",
    "append": "it is log.add(x, 'x')",
    "add_signal": "it is log.add(x, 'x')",
    "add_variable": "it is log.add(x, 'x')",
    "add_array": "it is log.array('x', 12)",
    "zeros": "it is log.array('x', 12)",
    "delete": "it is log.remove('x')",
    "stream": "it is log.serve(), then silo.connect('robot').stream(['x'])",
    "connect": "it is silo.connect('robot') in another program, once this one has called log.serve()",
    "set_divider": "it is log.set('x', divider=2)",
    **dict.fromkeys(("scalar", "set_value", "put"), "it is log.value('cost', 1.0)"),
    "param": "it is log.parameter('kp', 50.0)",
    "count": "len(log) counts elements, log['x'].held samples, log.ticks ticks",
    "size": "it is log['x'].options.size",
    **dict.fromkeys(("view", "watch"), "it is log.serve(), then silo-tui in a terminal"),
    # members of 0.1
    "cleanup": "it is log.close()",
    "element": "it is log['x']",
    "enable": "it is log.set('x', enabled=True)",
    "disable": "it is log.set('x', enabled=False)",
    "apply": "it is log.set('x', divider=2)",
    **dict.fromkeys(
        ("alarm", "limits", "add_limit", "set_limit", "set_limits"),
        "it is log.limit('x', (red_low, yellow_low, yellow_high, red_high))",
    ),
    **dict.fromkeys(("triggers", "add_trigger", "set_trigger"), "it is log.trigger('fall', 'x > 1')"),
    "remove_derived": "it is log.derive('x', None)",
    "remove_limits": "it is log.limit('x', None)",
    "remove_trigger": "it is log.trigger('fall', None)",
    "source_failures": "it is log['x'].failures",
    "lost": "it is sum(log[name].lost for name in log)",
    **dict.fromkeys(
        (
            "is_closed",
            "lock",
            "extras",
            "ignored",
            "revision",
            "segment_path",
            "saved_before_start",
            "problems",
            "abandon",
        ),
        "it is silo's own",
    ),
}
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
    return [name for name in names if not isinstance(_static(cls, name), Elsewhere)]


def _static(cls: type, name: str) -> object:
    return next((vars(base)[name] for base in cls.__mro__ if name in vars(base)), None)


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
