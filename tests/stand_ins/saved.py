"""A log with something of everything, the same each time."""

import numpy as np

import silo
from silo.core.elements import BufferType, Entry, LoggedEvent, Stretch
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files import write
from tests.stand_ins.fake_signals import START_NS

SECOND = 10**9


def element(
    name, values, unit="-", *, suffixes=(), kind="", shape=None, labels=None, divider=1, first=0,
    buffer_type=BufferType.LOOPING, prefix="/log/", **more,
):  # fmt: skip
    """An element as a file has it: of one column of samples, or of several, which are a vector if nothing else is said.

    `name` is behind the prefix, or the whole one where it begins with a slash.
    """
    name = name if name.startswith("/") else prefix + name
    columns = [np.asarray(one) for one in (values if len(values) and np.ndim(values[0]) else [values])]
    several = len(columns) > 1
    suffixes = suffixes or ([f"_{at}" for at in range(len(columns))] if several else [""])
    entries = tuple(
        RecordedEntry(name + suffix, Entry(suffix, column.dtype.str, labels), column)
        for suffix, column in zip(suffixes, columns, strict=True)
    )
    shape = (len(columns),) * several if shape is None else shape
    kind = kind or ("vector" if several else "scalar")
    return RecordedElement(name, unit, kind, shape, divider, buffer_type, first, entries, **more)


def twenty_seconds(seconds=0, number=1):
    """What a log of 20 s holds, that many seconds later: with a hole, marks, episodes, nan and words.

    Rounded, as the last digits of a sine are those of the processor.
    """
    at = np.arange(8000) / 400
    torque = np.round(np.sin(2 * np.pi * at), 6) * number
    torque[4000] = 40.0
    nan = np.where(at % 7 < 0.1, np.nan, at)
    elements = (
        element("legs/LF/torque", torque, "Nm"),
        element("legs/RF/torque", np.round(np.cos(3 * at), 6) * 100, "Nm"),
        element("legs/LF/contact", np.sin(2 * np.pi * at) > 0),
        element("base/position", np.stack([at, at**2, -at]), "m", suffixes=("_x", "_y", "_z")),
        element("state/gait", (at[::4] // 5).astype("i4") % 3, divider=4, labels={0: "stand", 1: "walk", 2: "trot"}),
        element("state/operator", np.array([b"ann"] * 100 + [b"bob"] * 100, "S8"), divider=40),
        element("imu/temperature", nan[::40], "degC", divider=40, lost=3),
        element("imu/power", np.round(10.0 ** (at / 4), 6), "W"),
    )
    begin_ns = START_NS + seconds * SECOND
    times = begin_ns + 2_500_000 * np.arange(8000, dtype=np.int64)
    times[6000:] += 2 * SECOND
    told = [("marker", "push 3", 1200), ("triggered", "fall fired", 4000), ("marker", 'episode "walk" begin', 4400),
            ("marker", 'episode "walk" end good', 6400)]  # fmt: skip
    events = tuple(LoggedEvent(kind, text, int(times[tick]), tick, int(times[tick])) for kind, text, tick in told)
    facts = {"frequency_hz": 400.0, "started_ns": begin_ns, "about": {"task": f"gait{number}", "operator": "ann"}}
    return Recording("robot", times, 8000, elements, events=events, **facts)


def recorded_in_two(folder, hole=0):
    """Save 20 ticks of a run as a recording in two files has them, with a hole of so many ticks between the two."""
    times = START_NS + np.arange(20, dtype=np.int64) * 10_000_000
    times[10:] += hole * 10_000_000
    stretch = Stretch("run", 1, recorder="walks", since=0)
    for number, ticks in ((1, slice(0, 10)), (2, slice(10, 20))):
        end = ticks.stop + hole * (number - 1)
        made = Recording("robot", times[ticks], end, [element("n", np.arange(20.0)[ticks])], stretch=stretch)
        write(made, folder, "robot", ["bag"], f"robot_20260921_14-00-00_{number:05}")


def cut_in_two(folder):
    """Save a run of 20 ticks that was cut after 10 of them."""
    with silo.Logger("arm", folder=folder, script=folder / "none.yaml") as log:
        q = log.array("q", 2)
        log.start()
        for tick in range(20):
            q[:] = tick
            log.collect()
            if tick == 9:
                log.set("q", divider=2, cut=True)
        log.save()
