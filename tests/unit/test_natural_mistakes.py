"""What people write who read the README once: each call is answered in our words, with what to write instead.

A row is the call as it is typed, and a piece of the message that names the way out. `log` is a logger that stands still
and holds ten ticks of `joints/q`, `run` the same as an opened log, `q` its signal, `null` a logger that does nothing.
"""

import ast
import copy
import inspect
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.errors import ArgumentError
from silo.history.arrays import Pin, Stream
from silo.live.topic import Topic
from silo.live.view import View
from silo.logger.arguments.other_names import OTHER_NAMES

MISTAKES = {
    # a logger's methods by other names
    "log.publish(x)": "log.add(x, 'x', action='publish') and log.serve()",
    "log.freq": "it is log.options.frequency_hz",
    "log.frequency": "silo.Logger('robot', frequency=500)",
    "log.max_time": "it is log.options.max_time_s",
    "log.opts": "it is log.options",
    "log.data": "log['x'].newest is the newest value",
    "log.names()": "it is list(log)",
    "log.log(x)": "log.collect() once per tick",
    "log.info('slipped')": "log.mark('slipped')",
    "log.run()": "it is log.start()",
    "log.tick()": "it is log.collect()",
    "log.pause()": "it is log.stop()",
    "log.reset()": "it is log.restart()",
    "log.clear()": "log.start() begins with empty buffers",
    "log.flush()": "it is log.save()",
    "log.shutdown()": "it is log.close()",
    "log.write('csv')": "it is log.save('csv')",
    "log.to_csv('x.csv')": "it is log.save('csv')",
    "log.to_pandas()": "silo.Log(log.snapshot()).to_pandas()",
    "log.plot('q')": "silo.Log(log.snapshot()).plot('x')",
    "log.load('robot.yaml')": "log.load_script('robot.yaml')",
    "log.register(x)": "it is log.add(x, 'x')",
    "log.add_signal(x, 'x')": "it is log.add(x, 'x')",
    "log.items()": "it is [(name, log[name]) for name in log]",
    "log.df": "silo.Log(log.snapshot()).to_pandas()",
    "log.time": "log['x'].time_ns is that of its newest value",
    "log.add_scalar('reward', 1.0)": "add variables by log.add(x, 'x') before",
    "log.elements['joints/qq']": "no element 'joints/qq'; did you mean",
    "log['joints/q'].values": "silo.Log(log.snapshot())['/log/joints/q'].values are all",
    "log['joints/q'].value": "it is .newest",
    "log['joints/q'].divider": "it is .options.divider",
    "log.save(['csv', 'silo']).path": "2 files were saved: [file.path for file in saved] has it of each",
    "silo.Logger('a', dt=0.002)": "write frequency=500 (ticks per second: 1 / dt)",
    "log.add(x, 'x', decimation=5)": "did you mean 'divider'?: write divider=2",
    "log.delete('q')": "it is log.remove('x')",
    "log.running": "it is log.is_running",
    "setattr(log, 'frequency', 500)": "it is given when the logger is made: silo.Logger('robot', frequency=500)",
    "log.__setitem__('joints/q', 3)": "x[:] = ...",
    "null.publish(x)": "action='publish'",
    "null.freq": "log.options.frequency_hz",
    "silo.get_logger().tick()": "it is log.collect()",
    "silo.get_logger('robot')": "silo.get_logger() takes no arguments by place, got 1",
    # triggers, limits, derived signals
    "log.trigger('fall')": "log.trigger() needs when: write log.trigger(name, when",
    "log.trigger(when='q_0 > 1')": "log.trigger() needs name",
    "log.trigger('fall', 'joints/q_x > 1', before='5s')": "log.trigger() has no argument 'before', it takes name",
    "log.trigger('fall', 'joints/q_x > 1', 5, 1)": "name the others: pre=5",
    "log.trigger('fall', 'joints/q_x > 1', presist='1s')": "did you mean 'persist'?",
    "log.trigger(5, None)": "the trigger's name must be a text, got 5 (int)",
    "log.limit(5, None)": "the signal's name must be a text, got 5 (int)",
    "log.limit('joints/q')": "log.limit() needs bounds: write log.limit(name, bounds",
    "log.limit('joints/q', -1, 1)": "log.limit() takes 2 arguments by place (name, bounds), got 3",
    "log.limit('joints/q', low=-1)": "log.limit() has no argument 'low', did you mean 'bounds'?: write bounds=(None",
    "log.limit('joints/q', (-2, -1, 1, 2), hysterisis=1)": "did you mean 'hysteresis'?",
    "log.derive('power')": "log.derive() needs expression: write log.derive(name, expression",
    "log.derive('power', 'joints/q * 2', units='W')": "did you mean 'unit'?",
    # options and edits
    "silo.ElementOptions(dividr=2)": "did you mean 'divider'?",
    "silo.ElementOptions(buf='looping')": "did you mean 'buffer'?",
    "silo.ElementOptions(True, 1, 1, 1, 9, 9)": "takes 5 arguments by place (enabled, divider",
    "silo.Edit('joints/q')": "silo.Edit() needs options: write silo.Edit(name, options)",
    "silo.Edit('joints/q', dividr=2)": "did you mean 'divider'?",
    "silo.Edit('joints/q', silo.ElementOptions(), divider=2)": "got both",
    "silo.Action('pubish')": "did you mean 'publish'?",
    "silo.BufferType('ring')": "there are fixed, looping, growing",
    "silo.types.FileType('cvs')": "did you mean 'csv'?",
    # data
    "log.snapshot()['q']": "silo.Log(recording)['q'] is a signal",
    "list(log.snapshot())": "recording.elements",
    "log.snapshot().signals": "silo.Log(recording)['x'] is a signal",
    "log.snapshot().save('x.csv')": "write silo.Log(recording).save",
    "log.snapshot().elemnts": "did you mean 'elements'?",
    "log.read_new_values('joints/q')[0]": "new.time_ns, new.values",
    "list(log.read_new_values('joints/q'))": "new.time_ns, new.values",
    "log.read_new_values('joints/q').value": "they are .values",
    "log.read_new_values('joints/q').times": "it is .time_ns",
    # saved logs
    "run.head()": "it is log.to_pandas().head()",
    "run.mean()": "it is of a signal: log['/log/x'].mean()",
    "run[['joints/q', 'x']]": "[log[name] for name in ['joints/q', 'x']] are several",
    "q.resample(hz=10)": "did you mean 'times'?",
    "run.columns": "list(log) has the names",
    "run['joints/qq']": "did you mean '/log/joints/q",
    "q.data": "it is .values",
    "q.fft()": "it is .spectrum()",
    "q.counted_from()": "signal.counted_from() needs start",
    "q.component(name='x', unit='m')": "signal.component() has no argument",
    "silo.compare(run, run).plot('q', 'v')": "comparison.plot() takes 1 argument by place (name), got 2",
    # clients
    "silo.connect('robot', timeout=1)": "silo.connect() has no argument 'timeout', did you mean 'timeout_s'?",
    "silo.Client('robot')": "silo.connect('robot')",
    "topic.read(timeout=1)": "topic.read() has no argument 'timeout', did you mean 'timeout_s'?",
    "topic.read(1, 2)": "topic.read() takes 1 argument by place (timeout_s), got 2",
    "topic.read_async(timeout=1)": "did you mean 'timeout_s'?",
    # members of enumerations, fields of what is returned
    "silo.Action.BOTH": "did you mean 'SAVE_AND_PUBLISH'?",
    "silo.Action.PUBLISHED": "did you mean 'PUBLISH'?",
    "silo.BufferType.RING": "EXPONENTIALLY_GROWING; did you mean 'LOOPING'?",
    "silo.types.FileType.Csv": "did you mean 'CSV'?",
    "log.options.frequency": "it is .frequency_hz",
    "setattr(log.options, 'frequency_hz', 100)": "options keeps its .frequency_hz: it is given when the logger is made",
    "delattr(log.options, 'frequency_hz')": "options keeps its .frequency_hz: it is given when the logger is made",
    "delattr(silo.ElementOptions(divider=2), 'divider')": "options keeps its .divider: log.set('x', divider=3) changes",
    "delattr(log['joints/q'], 'info')": "an element keeps its .info: log.set('x', divider=3) changes how it is logged",
    "silo.ElementOptions().rate": "it is the logger's frequency / .divider",
    "setattr(log['joints/q'].options, 'divider', 3)": "log.set('x', divider=3) changes them",
    "setattr(log['joints/q'], 'divider', 3)": "log.set('x', divider=3) changes how it is logged",
    "log['joints/q'][0]": "log['/log/joints/q'].newest[0]",
    "log.elements['joints/q'].divider": "it is .options.divider",
    "log.elements[0].newest": "log['x'].newest is the newest value",
    "log.save('csv').filename": "it is .path",
    "log.save('csv')[0].name": "it is .path",
    "log.save('csv', 'silo')": "write log.save(['csv', 'silo'])",
    "log.parameters.kp": "log.parameters['kp'] is the parameter of that name",
    "silo.compare(run, run).to_pandas()": "for row in comparison: row.name",
    "silo.compare(run, run).equal": "bool(comparison) says whether anything differs",
    "topic.latest()": "for batch in topic: batch.values[-1]",
    "topic.subscribe(print)": "for batch in topic: batch.values[-1]",
    "silo.runs(folder).latest": "it is runs[-1]",
    "silo.runs(folder).filter('x > 1')": "it is runs.where(",
    "silo.mujoco('robot.xml')": "silo.mujoco() needs data",
    # habits of others: wandb, TensorBoard, logging, the C++ original
    "log.log('x', 1)": "add variables by log.add(x, 'x') before",
    "log.add_histogram('w', x)": "add variables by log.add(x, 'x') before",
    "log.summary": "silo.Logger('robot', about={'task': 'walk'})",
    "log.error('slipped')": "log.mark('slipped')",
    "log.collectLoggerData()": "it is log.collect()",
    "log.readNewValues('x')": "it is log.read_new_values('x')",
    "log.set_frequency(100)": "silo.Logger('robot', frequency=500)",
    "log.isRunning()": "it is log.is_running",
    "log.triggers": "it is log.trigger('fall', 'x > 1')",
    "log.status()": "print(log) says how it stands",
    "log.sleep()": "the loop is yours",
    # of logs and signals
    "run.__setitem__('z', q)": "a log is only read",
    "run.__delitem__('joints/q')": "a log is only read",
    "np.array(run)": "log.to_pandas() is a table of all signals",
    "run.save('csv')": "says the format alone: write the file's name before it, 'run.csv'",
    "q.__setitem__(0, 5)": "signal.values.copy()",
    "silo.open_log(run.path, 'joints/q')": "signals are chosen from the log",
}
WORK = {
    "round(q, 2).unit": "rad",
    "run.__enter__() is run": True,
    "[row.name for row in silo.compare(run, run)]": [],
    "open(log.save('csv')).read(5)": "time,",
    "len(silo.open_log(log.save('silo')[0]))": 1,
    "log.save('csv', name='silo').path.endswith('/silo.csv')": True,
}


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the calls are about."""
    folder = tmp_path_factory.mktemp("mistakes")
    log = silo.Logger("natural", frequency=100, folder=folder, script=folder / "none.yaml")
    q = log.array("q", 3, group="joints", unit="rad")
    log.update()
    log.start()
    for tick in range(10):
        q[:] = tick
        log.collect()
    log.stop()
    run = silo.open_log(log.save("silo")[0].path)
    yield {
        "log": log,
        "null": silo.NullLogger(),
        "run": run,
        "q": run["joints/q"],
        "x": np.zeros(3),
        "silo": silo,
        "topic": Topic("/log/joints/q", lambda topic: None),
        "np": np,
        "folder": folder,
    }
    log.close()


@pytest.mark.parametrize("call", MISTAKES)
def test_a_natural_mistake_is_told_of_with_what_to_write_instead(call, names):
    with pytest.raises(silo.SiloError) as caught:
        eval(call, dict(names))
    assert MISTAKES[call] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("call", WORK)
def test_what_looks_as_if_it_worked_does(call, names):
    assert eval(call, dict(names)) == WORK[call]


def test_a_wrong_call_of_the_loop_names_what_was_called(new_logger):
    log = new_logger()
    log.array("x")
    log.start()
    with pytest.raises(TypeError, match=r"log\.collect\(\) takes 0 positional arguments"):
        log.collect(5)
    with pytest.raises(TypeError, match=r"log\.mark\(\) got an unexpected keyword argument 'foo'"):
        log.mark("hit", foo=2)


def test_a_unit_in_the_place_of_the_group_is_asked_back(new_logger, caplog):
    new_logger().add(np.zeros(3), "x", "rad")
    assert "'rad' is its group, is it meant as a unit? write unit='rad'" in caplog.text
    caplog.clear()
    new_logger().add(np.zeros(3), "x", "joints")
    assert "is its group" not in caplog.text


def test_what_is_written_instead_is_there(names):
    import re

    for word, way_out in OTHER_NAMES.items():
        assert not hasattr(type(names["log"]), word), f"log.{word} is there by itself"
        for method in re.findall(r"log\.(\w+)", way_out):
            assert hasattr(names["log"], method), f"{word}: there is no log.{method}"
        for function in re.findall(r"silo\.(\w+)", way_out):
            assert hasattr(silo, function), f"{word}: there is no silo.{function}"


@pytest.mark.parametrize("kind", [silo.types.Serving, silo.Client, silo.Log, silo.Signal, silo.Logger, silo.NullLogger])
def test_every_method_that_programs_call_tells_of_a_wrong_call(kind):
    left = {"collect", "mark"}  # the control loop's: nothing may stand before them
    ours = {name for cls in kind.__mro__ if cls.__module__.startswith("silo") for name in vars(cls)} - left
    bare = [name for name in ours if not name.startswith("_") and is_bare(inspect.getattr_static(kind, name))]
    assert bare == []


@pytest.mark.parametrize("kind", [Topic, View, Stream, Pin, silo.types.Comparison])
def test_what_a_client_and_a_comparison_give_tells_of_a_wrong_call(kind):
    assert [name for name, found in vars(kind).items() if not name.startswith("_") and is_bare(found)] == []


def is_bare(found):
    function = found.__func__ if isinstance(found, classmethod) else found
    return type(function).__name__ == "function" and not hasattr(function, "__wrapped__")


def test_a_name_that_is_not_there_is_missing_as_in_any_object(names):
    for thing in (names["log"], names["null"], names["log"].snapshot(), names["log"].read_new_values("joints/q")):
        assert not hasattr(thing, "nonsense")
        assert getattr(thing, "nonsense", 5) == 5


def test_a_recording_is_copied_and_pickled_as_before(names):
    recording = names["log"].snapshot()
    for other in (copy.copy(recording), copy.deepcopy(recording), pickle.loads(pickle.dumps(recording))):
        assert other.time_ns.tolist() == recording.time_ns.tolist()


def test_a_program_may_keep_things_of_its_own_in_a_logger(names):
    names["log"].robot = "anymal"
    names["log"].data = [1, 2]
    assert (names["log"].robot, names["log"].data) == ("anymal", [1, 2])
    del names["log"].data


def test_what_is_only_told_of_is_listed_nowhere(names):
    import pydoc

    shown = pydoc.render_doc(silo.Logger)
    for word in ("publish", "tick", "freq"):
        assert word not in dir(names["log"])
        assert word not in dir(names["null"])
        assert word not in dir(silo.Logger)
        assert f" {word}(" not in shown
        assert f" {word} =" not in shown
    assert {"collect", "add", "is_running"} <= set(dir(names["log"])) & set(dir(silo.Logger))


def _advised() -> set[tuple[str, str]]:
    """What messages and documentation advise of a logger, a log or a client: the object's name and the method."""
    found = set()
    for path in Path(silo.__file__).parent.rglob("*.py"):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)) if "log." in text or "client." in text else ():
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found |= set(re.findall(r"\b(log|client)\.([a-z_]+)\(", node.value))
    return found


def test_what_is_advised_is_there():
    """All in one test: what is advised stands in 450 files, which each worker would read to name a test for each."""
    kinds = {"log": (silo.Logger, silo.Log), "client": (silo.Client,)}
    advised = _advised()
    assert {"log", "client"} == {whose for whose, _ in advised}
    missing = [f"{whose}.{method}" for whose, method in advised if not any(hasattr(k, method) for k in kinds[whose])]
    assert not missing


def test_the_elements_of_a_logger_are_called_by_nobody(new_logger):
    with pytest.raises(ArgumentError, match=r"write log\.elements, of which log\.elements\['joints/q'\] is one"):
        new_logger().elements()
