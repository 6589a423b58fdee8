"""Which marks a helper process takes into the event log, whenever the run that they are of goes on as another one."""

from types import SimpleNamespace

from silo.helper.marks import MarkReader
from silo.segment.reader import SegmentReader


class Robot:
    """A replica of a logger, whose `run` is looked at just when something happens."""

    def __init__(self, log) -> None:
        self.log, self.happens = log, lambda: None
        self.now = SimpleNamespace(robot=SimpleNamespace(conditions=SimpleNamespace(derived=())))

    @property
    def run(self):
        happens, self.happens = self.happens, lambda: None
        happens()
        return self.log._present.run.id

    def open_reader(self):
        return SegmentReader(self.log._present.path)


def test_what_is_marked_while_the_run_is_looked_at_which_is_cut_then_is_taken(new_logger):
    log = new_logger("bot", frequency=100)
    log.array("x")
    log.start()
    log.collect()
    taken = []
    events = SimpleNamespace(
        log=SimpleNamespace(of_run=lambda run: []), publish_mark=lambda one: taken.append(one.text)
    )
    robot = Robot(log)
    marks = MarkReader(robot, events)

    def marked_and_cut():
        log.mark("c")
        log.set("x", divider=2, cut=True)
        log.collect()
        log.mark("d")

    marks.take_run()
    log.mark("a")
    marks.take()
    log.mark("b")
    robot.happens = marked_and_cut
    marks.take_run()
    assert taken == ["a", "b", "c"]
    marks.take_run()
    assert taken == ["a", "b", "c", "d"]
