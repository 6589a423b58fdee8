"""Mistakes that type checkers must find, each told by `# wrong`; the lines without are right. Read by mypy, never run."""

# ruff: noqa

from pathlib import Path

import numpy as np

import silo

log = silo.Logger("typed", frequency=500, storage="disk", threads="serialized", folder=Path("logs"))
x = np.zeros(3)

silo.Logger("typed", freq=500)  # wrong
silo.Logger("typed", storage="dsk")  # wrong
silo.Logger("typed", threads="many")  # wrong
silo.Logger("typed", frequency="500Hz", max_time="60s")
silo.init("typed", frequency=500, storage="memory")
silo.init("typed", freq=500)  # wrong

log.add(x, "a", "group", "rad", 2, "publish", 100, "looping")
log.add(x, "a", divider=np.int64(2), action=silo.Action.SAVE, enabled=np.bool_(True))
log.add(x, "a", divider="50Hz", size="10s", buffer="growing", action="both")
log.add(x, "a", dividr=2)  # wrong
log.add(x, "a", action="pubish")  # wrong
log.add(x, "a", buffer="ring")  # wrong
log.add(x, "a", buffer=silo.Action.SAVE)  # wrong
log.add(x, "a", divider=2.5)  # wrong
log.add(x, 5)  # wrong
silo.add(x, "a", group="joints", divider=2)
silo.add(x, "a", dividr=2)  # wrong
silo.add(x, "a", action="pubish")  # wrong

q = log.array("q", 12, unit="rad", divider="50Hz")
q[:] = 1
log.array("q", (3, 3), dtype="f4")
log.array("q", np.int64(3))
log.array("q", 12, dividr=2)  # wrong
log.array("q", 12, action="pubish")  # wrong
log.array(12)  # wrong
silo.array("q", 12, dividr=2)  # wrong

log.set("joints", divider="50Hz", size="10s", action="both", on=False)
log.set("joints", dividr=2)  # wrong
log.set("joints", action="pubish")  # wrong
log.set("joints", 2)  # wrong

log.start(unsaved="save")
log.start(unsaved="keep")  # wrong
log.save(["silo", "csv"], folder=Path("logs"))
log.save("bag")
log.save(silo.types.FileType.CSV)
log.save(["cvs"])  # wrong
log.save("cvs")  # wrong
silo.save(["cvs"])  # wrong
silo.save(["csv", silo.types.FileType.SILO])
log.publish()  # wrong
silo.get_logger().set("joints", divider=2)
silo.get_logger().set("joints", dividr=2)  # wrong

silo.ElementOptions(divider=2, action=silo.Action.PUBLISH)
silo.ElementOptions(dividr=2)  # wrong
silo.ElementOptions(divider="50Hz")  # wrong
silo.Edit("/log/q", silo.ElementOptions(size=100))
silo.Edit("/log/q", divider=2, size="10s")
silo.Edit("/log/q", dividr=2)  # wrong
log.snapshot().elements
log.save("csv").path
log.elements["q"].unit
log.mark()
log.mark("push", 3)
silo.open_log("bag", stamps="header")
silo.open_log("bag", stamps="publish")  # wrong
silo.compare("a", "b", signal="q").plot()
log.snapshot().elemnts  # wrong
log.freq  # wrong
log.trigger("fall", "q_0 > 1", pre="5s")
log.trigger("fall", "q_0 > 1", before="5s")  # wrong
log.limit("q", (-2, -1, 1, 2))
log.limit("q", low=-1)  # wrong
silo.connect("robot", timeout_s=1)
silo.connect("robot", timeout=1)  # wrong
